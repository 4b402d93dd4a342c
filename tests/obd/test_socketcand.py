"""The text protocol of socketcand, beside python-can's own client."""

import can
import pytest
from can.interfaces.socketcand import socketcand as theirs
from hypothesis import given
from hypothesis import strategies as st

from onboard.obd.socketcand import ProtocolError, format_send, parse_element
from tests.typed import a

MESSAGES = st.one_of(
    st.builds(
        can.Message,
        arbitration_id=st.integers(0, 0x7FF),
        is_extended_id=st.just(value=False),
        data=st.binary(max_size=8),
    ),
    st.builds(
        can.Message,
        arbitration_id=st.integers(0, 0x1FFFFFFF),
        is_extended_id=st.just(value=True),
        data=st.binary(max_size=8),
    ),
)


def essence(message: can.Message) -> tuple[int, bool, bytes]:
    return message.arbitration_id, message.is_extended_id, bytes(message.data)


@given(MESSAGES, st.sampled_from(["", " "]))
def test_elements_are_parsed_as_by_python_can(message: can.Message, between: str) -> None:
    digits = 8 if message.is_extended_id else 3
    data = between.join(f"{byte:02X}" for byte in message.data)
    element = f"< frame {message.arbitration_id:0{digits}X} 1700000000.123456 {data} >"
    ours = a(can.Message, parse_element(element.removesuffix(">")))
    assert essence(ours) == essence(message)
    assert ours.timestamp == 1700000000.123456
    if not between:  # python-can takes the first blank for the end
        assert essence(theirs.convert_ascii_message_to_can_message(element)) == essence(message)


@given(MESSAGES)
def test_sent_elements_have_the_values_of_python_can(message: can.Message) -> None:
    def numbers(element: str) -> tuple[str, str, int, list[int], str]:
        head, command, identifier, *octets, tail = element.split()
        return head, command, len(identifier), [int(o, 16) for o in (identifier, *octets)], tail

    ours = numbers(format_send(message))
    assert ours == numbers(theirs.convert_can_message_to_ascii_message(message))


def test_a_frame_and_a_request_have_their_exact_text() -> None:
    message = a(can.Message, parse_element("< frame 7E8 23.424242 03410D32 "))
    assert essence(message) == (0x7E8, False, bytes.fromhex("03410D32"))
    request = can.Message(arbitration_id=0x18DB33F1, data=bytes.fromhex("02010D"))
    assert format_send(request) == "< send 18DB33F1 3 02 01 0D >"


@pytest.mark.parametrize("element", ["< error 004 23.4242", "< ok", "< hi", "< stat 1 2"])
def test_elements_without_a_data_frame_are_ignored(element: str) -> None:
    assert parse_element(element) is None


@pytest.mark.parametrize(
    "element",
    [
        "",
        "frame 7E8 1.0 00",
        "< frame ",
        "< frame 7E8",
        "< frame 7E8 now 00",
        "< frame 7E8 1.0 0",
        "< frame 7E8 1.0 GG",
        "< frame FFF 1.0 00",
        "< frame 3FFFFFFF 1.0 00",
        "< frame 7E8 1.0 00112233445566778899",
        "\x00\xff< frame 7E8 1.0 00",
    ],
)
def test_garbage_is_a_protocol_error(element: str) -> None:
    with pytest.raises(ProtocolError):
        parse_element(element)


@given(st.text(max_size=60))
def test_any_text_is_a_frame_or_not(text: str) -> None:
    for element in (text, "< frame " + text):
        try:
            message = parse_element(element)
        except ProtocolError:
            continue
        assert message is None or len(message.data) <= 8
