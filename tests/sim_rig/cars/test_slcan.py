"""Serial CAN: the messages of the protocol, and a line that is the bus of a box."""

import asyncio
import os
from contextlib import closing
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from onboard.errors import UserError
from onboard.kinematics.units import KM_H
from onboard.obd.can_frame import CanFrame
from sim_rig.cars.can_interface import CanInterface
from sim_rig.cars.ecu import Ecu
from sim_rig.cars.slcan import LONGEST, SlcanReader, encode


@st.composite
def frames(draw: st.DrawFn) -> CanFrame:
    is_extended_id = draw(st.booleans())
    identifier = draw(st.integers(0, (1 << (29 if is_extended_id else 11)) - 1))
    return CanFrame(5.0, identifier, is_extended_id, draw(st.binary(max_size=8)))


@pytest.mark.parametrize(
    ("message", "frame"),
    [
        # The examples of LAWICEL's CAN232 manual.
        (b"t10021133\r", CanFrame(5.0, 0x100, False, b"\x11\x33")),
        (b"T0000010021133\r", CanFrame(5.0, 0x100, True, b"\x11\x33")),
    ],
)
def test_the_examples_of_the_manual(message: bytes, frame: CanFrame) -> None:
    assert encode(frame) == message
    assert list(SlcanReader().receive_bytes(message, 5.0)) == [frame]
    assert list(SlcanReader().receive_bytes(message.lower().replace(b"t0", b"T0"), 5.0)) == [frame]
    assert not list(SlcanReader().receive_bytes(message[:-2] + b"\r", 5.0)), "truncated"


@given(st.lists(frames(), max_size=5), st.integers(1, 30))
def test_frames_come_back_however_the_line_cuts_them(sent: list[CanFrame], step: int) -> None:
    data = b"".join(map(encode, sent))
    reader = SlcanReader()
    chunks = (data[begin : begin + step] for begin in range(0, len(data), step))
    assert [frame for chunk in chunks for frame in reader.receive_bytes(chunk, 5.0)] == sent
    assert all(len(encode(frame)) <= LONGEST for frame in sent)


@given(st.binary(max_size=200))
def test_whatever_came_before_the_next_frame_is_read(garbage: bytes) -> None:
    reader = SlcanReader()
    list(reader.receive_bytes(garbage + b"\r", 5.0))
    frame = CanFrame(5.0, 0x7E8, False, b"\x03")
    assert list(reader.receive_bytes(encode(frame), 5.0)) == [frame]


@pytest.mark.parametrize("message", [b"S6", b"O", b"r1002", b"t8002", b"t1009" + b"00" * 9, b"t1"])
def test_what_is_no_data_frame_is_ignored(message: bytes) -> None:
    assert not list(SlcanReader().receive_bytes(message + b"\r", 5.0))


def test_an_ecu_answers_on_a_serial_line() -> None:
    async def ask() -> bytes:
        box, rig = os.openpty()
        answered = asyncio.Event()
        asyncio.get_running_loop().add_reader(box, answered.set)
        ecu = Ecu(lambda _now: 50 * KM_H, answer_after_s=0.0)
        with closing(CanInterface(ecu, Path(os.ttyname(rig)))):
            os.write(box, b"S6\rO\rt7DF302010D\r")
            await asyncio.wait_for(answered.wait(), 10.0)
            answer = os.read(box, 100)
        os.close(box)
        os.close(rig)
        return answer

    assert asyncio.run(ask()).startswith(b"t7E8803410D32")


def test_what_is_no_serial_line_is_named(tmp_path: Path) -> None:
    (tmp_path / "line").touch()

    async def open_line(path: Path) -> None:
        CanInterface(Ecu(lambda _now: 0.0), path)

    with pytest.raises(UserError, match="line: is no serial line"):
        asyncio.run(open_line(tmp_path / "line"))
    with pytest.raises(UserError, match="missing: cannot be opened: No such file"):
        asyncio.run(open_line(tmp_path / "missing"))
