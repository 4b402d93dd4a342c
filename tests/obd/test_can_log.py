"""Recordings of a CAN bus: every format gives the same frames, with absolute stamps if stated."""

import time
from collections.abc import Callable, Iterator
from pathlib import Path

import can
import pytest

from onboard.obd.can_frame import CanFrame
from onboard.obd.can_log import CanLogError, read_can_log
from onboard.observations import Discarded

FRAMES = [
    CanFrame(10.0, 0x7E8, is_extended_id=False, data=bytes.fromhex("03410D3200000000")),
    CanFrame(10.05, 0x18DAF110, is_extended_id=True, data=bytes.fromhex("03410D33")),
    CanFrame(10.1, 0x100, is_extended_id=False, data=b""),
]


@pytest.fixture(name="recording")
def _recording(tmp_path: Path) -> Callable[..., Path]:
    def write(name: str) -> Path:
        path = tmp_path / name
        with can.Logger(path) as log:
            for frame in FRAMES:
                log.on_message_received(
                    can.Message(
                        timestamp=frame.stamp_s,
                        arbitration_id=frame.arbitration_id,
                        is_extended_id=frame.is_extended_id,
                        data=frame.data,
                        channel=1,
                    )
                )
        return path

    return write


@pytest.mark.parametrize("name", ["a.log", "a.asc", "a.blf", "a.trc", "a.csv", "a.db", "a.log.gz"])
def test_a_recording_in_any_format_gives_its_frames(
    recording: Callable[..., Path], name: str
) -> None:
    frames = list(read_can_log(recording(name)))
    assert [(f.arbitration_id, f.is_extended_id, f.data) for f in frames] == [
        (f.arbitration_id, f.is_extended_id, f.data) for f in FRAMES
    ]
    steps = [later.stamp_s - frames[0].stamp_s for later in frames]
    assert steps == pytest.approx([0.0, 0.05, 0.1], abs=1e-3)


def test_one_channel_of_a_recording(tmp_path: Path) -> None:
    path = tmp_path / "two.log"
    path.write_text("(1.0) can0 100#00\n(1.1) can1 101#00\n(1.2) can0 102#00\n", encoding="ascii")
    assert [f.arbitration_id for f in read_can_log(path)] == [0x100, 0x101, 0x102]
    assert [f.arbitration_id for f in read_can_log(path, "can0")] == [0x100, 0x102]


@pytest.mark.parametrize("stamp", ["nan", "-inf", "inf", "1e300"])
def test_a_frame_whose_stamp_is_no_time_is_discarded(tmp_path: Path, stamp: str) -> None:
    path = tmp_path / "odd.log"
    path.write_text(f"({stamp}) can0 100#00\n(1.2) can0 102#00\n", encoding="ascii")
    discarded: list[Discarded] = []
    (frame,) = read_can_log(path, on_discarded=discarded.append)
    assert frame.arbitration_id == 0x102
    assert [(each.stamp_s, each.reason) for each in discarded] == [(0.0, "log_line")]


def test_a_damaged_archive_is_refused_with_a_reason(tmp_path: Path) -> None:
    path = tmp_path / "odd.log.gz"
    path.write_bytes(b"\x1f\x8b" + bytes(30))
    with pytest.raises(CanLogError, match=r"odd\.log\.gz: cannot be read: \w+ \w+"):
        list(read_can_log(path))


def test_bad_lines_are_counted_and_remote_and_error_frames_ignored(tmp_path: Path) -> None:
    path = tmp_path / "bad.log"
    path.write_text(
        "(1.0) can0 7E8#03410D32\nnonsense\n(1.1) can0 ZZZ#00\n(1.2) can0 100#R8\n"
        "(1.3) can0 20000088#0000000000000000\n(1.4) can0 100##1AABB\n(1.5) can0 7E8#03\x00\n"
        "(1.6) can0 7E8#0341\n",
        encoding="ascii",
    )
    discarded: list[Discarded] = []
    frames = list(read_can_log(path, on_discarded=discarded.append))
    assert [frame.stamp_s for frame in frames] == [1.0, 1.4, 1.6]
    assert [(d.stamp_s, d.reason) for d in discarded] == [
        (1.0, "log_line"),
        (1.0, "log_line"),
        (1.4, "log_line"),
    ]


@pytest.mark.parametrize(
    ("name", "content", "why"),
    [
        ("a.txt", b"\0hello", "no line has the format of candump"),
        ("a", b"hello\n", "no line has the format of candump"),
        ("a.txt", b" (0.0) can0 100 [0] \n (0.1) can0 100 [0] \n (0.0) can0 100 [0] \n", "-td?"),
        ("a.mf4", b"MDF     4.10", "The asammdf package was not found"),
        ("nowhere.log", None, "no such file"),
        ("a.xyz", b"", 'unknown log format ".xyz"; known are .asc, .blf, .csv'),
        (
            "a.log",
            b"can0  7E8   [4]  03 41 0D 32\n",
            "candump without time stamps; record with candump -L",
        ),
        ("a.csv", b"header\nno frame\n", "unreadable CAN log"),
        ("a.log.gz", b"not gzip", "cannot be read"),
    ],
)
def test_a_file_that_is_no_recording_is_an_error_of_one_line(
    tmp_path: Path, name: str, content: bytes | None, why: str
) -> None:
    path = tmp_path / name
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(CanLogError) as raised:
        list(read_can_log(path))
    assert str(raised.value).startswith(f"{path}: ")
    assert why in str(raised.value)
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize(
    ("written", "name"), [("a.log", "a.txt"), ("b.log", "b"), ("c.blf", "c.log"), ("d.asc", "d")]
)
def test_a_recording_without_its_ending_is_recognised_by_its_content(
    recording: Callable[..., Path], written: str, name: str
) -> None:
    path = recording(written)
    assert [f.data for f in read_can_log(path.rename(path.with_name(name)))] == [
        f.data for f in FRAMES
    ]


@pytest.fixture
def far_from_utc(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Time zone in which ASC files and `candump -tA` are written and read."""
    monkeypatch.setenv("TZ", "XXX-05:30")
    time.tzset()
    yield
    monkeypatch.undo()
    time.tzset()


def test_asc_stamps_count_from_its_date(tmp_path: Path, far_from_utc: None) -> None:
    path = tmp_path / "a.asc"
    begin_s = 1_627_274_999.25
    with can.Logger(path) as log:
        log.on_message_received(can.Message(timestamp=begin_s, arbitration_id=0x7E8, data=b"a"))
        log.on_message_received(can.Message(timestamp=begin_s + 1, arbitration_id=0x7E8, data=b"b"))
    assert "date" in path.read_text().splitlines()[0]
    stamps_s = [frame.stamp_s for frame in read_can_log(path)]
    assert stamps_s == pytest.approx([begin_s, begin_s + 1], abs=1e-3)


@pytest.mark.parametrize(
    "stamps", [("1627274999.500000", "1627275000.000000"), ("000.000000", "000.500000")]
)
@pytest.mark.parametrize("flags", ["", "  RX - -"])
def test_lines_as_candump_prints_them(tmp_path: Path, stamps: tuple[str, str], flags: str) -> None:
    path = tmp_path / "a.txt"
    first, second = stamps
    path.write_text(
        f" ({first})  can0{flags}  7E8   [4]  03 41 0D 32\n"
        f" ({first})  can0{flags}  18DAF110   [2]  03 41   '.A'\n\n"
        f" ({first})  can0{flags}  123   [0]  remote request\n"
        f" ({first})  can0{flags}  20000088   [8]  00 00 00 00 00 00 00 00   ERRORFRAME\n"
        f" ({first})  can0{flags}  123   [4]  03 41\n"
        f" ({second})  can1{flags}  100   [0] \n"
    )
    discarded: list[Discarded] = []
    frames = list(read_can_log(path, on_discarded=discarded.append))
    assert frames == [
        CanFrame(float(first), 0x7E8, is_extended_id=False, data=bytes.fromhex("03410D32")),
        CanFrame(float(first), 0x18DAF110, is_extended_id=True, data=bytes.fromhex("0341")),
        CanFrame(float(second), 0x100, is_extended_id=False, data=b""),
    ]
    assert [(d.stamp_s, d.reason) for d in discarded] == [(float(first), "log_line")]
    assert [f.arbitration_id for f in read_can_log(path, "can1")] == [0x100]


def test_the_date_that_candump_prints_is_local_time(tmp_path: Path, far_from_utc: None) -> None:
    path = tmp_path / "a.txt"
    path.write_text(" (2021-07-26 10:19:59.500000)  can0  7E8   [2]  03 41\n")
    assert [frame.stamp_s for frame in read_can_log(path)] == [1_627_274_999.5]
