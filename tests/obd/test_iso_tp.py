"""Long messages of frames that are lost, duplicated, late or short; can-isotp is the other end."""

import math
from collections import deque

import isotp
import pytest
from hypothesis import given
from hypothesis import strategies as st

from onboard.obd.iso_tp import Aborted, Message, Reassembly
from onboard.obd.n_pdu import (
    ConsecutiveFrame,
    FirstFrame,
    FlowControl,
    FlowStatus,
    NPdu,
    SingleFrame,
    decode,
    encode,
)
from tests.typed import a, every

GO_ON = FlowControl(FlowStatus.CONTINUE_TO_SEND, 0, 0)
VIN = bytes.fromhex("49 02 01") + b"1G1JC5444R7252367"


def units_of(payload: bytes) -> list[NPdu]:
    """A long message segmented by can-isotp."""
    sent: deque[bytes] = deque()
    to_sender: deque[isotp.CanMessage] = deque()
    sender = isotp.TransportLayerLogic(
        rxfn=lambda timeout: to_sender.popleft() if to_sender else None,
        txfn=lambda message: sent.append(bytes(message.data)),
        address=isotp.Address(isotp.AddressingMode.Normal_11bits, rxid=0x7E0, txid=0x7E8),
        params={"tx_padding": 0x55},
    )
    sender.send(payload)
    sender.process()
    if len(payload) > 7:
        to_sender.append(isotp.CanMessage(arbitration_id=0x7E0, data=encode(GO_ON)))
        while sender.transmitting():
            sender.process()
    return [decode(frame) for frame in sent]


def receive(
    units: list[ConsecutiveFrame | FirstFrame | FlowControl | SingleFrame],
    start: float = 0.0,
    step: float = 0.01,
) -> list[Aborted | Message]:
    reassembly = Reassembly()
    for n, unit in enumerate(units):
        reassembly.receive_pdu(unit, start + n * step)
    return events_of(reassembly)


def events_of(reassembly: Reassembly) -> list[Aborted | Message]:
    events = []
    while (event := reassembly.next_event()) is not None:
        events.append(event)
    return events


@pytest.mark.long
@given(payload=st.binary(min_size=1, max_size=300) | st.binary(min_size=4090, max_size=4095))
def test_messages_of_another_implementation_are_reassembled(payload: bytes) -> None:
    assert receive(units_of(payload)) == [Message(payload)]


def test_a_single_frame_is_a_message() -> None:
    assert receive([SingleFrame(b"\x41\x0d\x32")]) == [Message(b"\x41\x0d\x32")]


def test_flow_control_is_the_other_direction_and_changes_nothing() -> None:
    first, *others = units_of(VIN)
    assert receive([GO_ON, first, GO_ON, *others]) == [Message(VIN)]


def test_a_lost_frame_aborts_the_message() -> None:
    first, _, last = units_of(VIN)
    assert receive([first, last]) == [
        Aborted("n_wrong_sn", "got 2, expected 1, after 6 of 20 bytes")
    ]


def test_after_a_lost_frame_the_next_message_is_read() -> None:
    first, second, third = units_of(VIN)
    assert receive([first, third, first, second, third])[-1] == Message(VIN)


def test_a_duplicated_frame_aborts_the_message() -> None:
    first, second, third = units_of(VIN)
    aborted, stray = every(Aborted, receive([first, second, second, third]))
    assert aborted.reason == "n_wrong_sn"
    assert stray.reason == "unexpected_consecutive_frame"


def test_a_consecutive_frame_without_a_first_frame_is_discarded() -> None:
    assert receive([ConsecutiveFrame(1, b"1234567")]) == [
        Aborted("unexpected_consecutive_frame", "no message is being received")
    ]


@pytest.mark.parametrize("interrupter", [SingleFrame(b"new"), FirstFrame(20, VIN[:6])])
def test_a_new_message_aborts_the_old_one(interrupter: FirstFrame | SingleFrame) -> None:
    first, second, third = units_of(VIN)
    aborted, message = receive([first, interrupter, second, third])[:2]
    assert aborted == Aborted("n_unexp_pdu", "after 6 of 20 bytes")
    assert isinstance(message, Message)


def test_only_the_last_frame_may_be_short() -> None:
    first, second, third = units_of(VIN)
    short = ConsecutiveFrame(1, a(ConsecutiveFrame, second).data[:6])
    assert a(Aborted, receive([first, short])[0]).reason == "consecutive_frame_length"
    unpadded = ConsecutiveFrame(2, a(ConsecutiveFrame, third).data[:7])
    assert receive([first, second, unpadded]) == [Message(VIN)]


def test_a_message_is_aborted_after_n_cr() -> None:
    reassembly = Reassembly(n_cr_s=1.0)
    first, second, third = units_of(VIN)
    assert reassembly.get_timer() == math.inf
    reassembly.receive_pdu(first, 10.0)
    assert reassembly.get_timer() == 11.0
    reassembly.receive_pdu(second, 10.9)
    assert reassembly.get_timer() == 11.9
    reassembly.handle_timer(11.8)
    assert events_of(reassembly) == []
    reassembly.handle_timer(11.9)
    assert events_of(reassembly) == [Aborted("n_timeout_cr", "after 13 of 20 bytes")]
    assert reassembly.get_timer() == math.inf
    reassembly.receive_pdu(third, 12.0)
    assert [event.reason for event in every(Aborted, events_of(reassembly))] == [
        "unexpected_consecutive_frame"
    ]


def test_n_cr_applies_without_a_served_timer() -> None:
    first, second, third = units_of(VIN)
    timeout, *strays = every(Aborted, receive([first, second, third], step=1.5))
    assert timeout.reason == "n_timeout_cr"
    assert [stray.reason for stray in strays] == ["unexpected_consecutive_frame"] * 2


def test_a_message_longer_than_any_response_is_not_started() -> None:
    assert receive([FirstFrame(5000, b"ab"), SingleFrame(b"x")]) == [
        Aborted("n_buffer_overflow", "FF_DL 5000"),
        Message(b"x"),
    ]


@given(
    st.lists(
        st.one_of(
            st.builds(SingleFrame, st.binary(min_size=1, max_size=7)),
            st.builds(FirstFrame, st.integers(8, 40), st.binary(min_size=6, max_size=6)),
            st.builds(ConsecutiveFrame, st.integers(0, 15), st.binary(min_size=1, max_size=7)),
            st.just(GO_ON),
        ),
        max_size=30,
    )
)
def test_any_order_of_units_gives_only_messages_of_the_announced_length(
    units: list[ConsecutiveFrame | FirstFrame | FlowControl | SingleFrame],
) -> None:
    lengths = {unit.length for unit in units if isinstance(unit, FirstFrame)}
    lengths |= {len(unit.data) for unit in units if isinstance(unit, SingleFrame)}
    messages = [event for event in receive(units) if isinstance(event, Message)]
    assert {len(message.payload) for message in messages} <= lengths
    assert len(messages) <= len(units)
