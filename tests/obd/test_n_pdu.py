"""The four units of ISO 15765-2, byte for byte."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from onboard.obd.n_pdu import (
    ConsecutiveFrame,
    FirstFrame,
    FlowControl,
    FlowStatus,
    NPduError,
    SingleFrame,
    decode,
    encode,
)

BYTE = st.integers(0, 255)


@pytest.mark.parametrize(
    ("pdu", "frame"),
    [
        (SingleFrame(b"\x01\x0d"), "02 01 0D CC CC CC CC CC"),
        (SingleFrame(b"1234567"), "07 31 32 33 34 35 36 37"),
        (FirstFrame(20, b"\x49\x02\x011G1"), "10 14 49 02 01 31 47 31"),
        (FirstFrame(4095, b"abcdef"), "1F FF 61 62 63 64 65 66"),
        (FirstFrame(4096, b"ab"), "10 00 00 00 10 00 61 62"),
        (ConsecutiveFrame(1, b"JC5444R"), "21 4A 43 35 34 34 34 52"),
        (FlowControl(FlowStatus.CONTINUE_TO_SEND, 0, 0), "30 00 00 CC CC CC CC CC"),
        (FlowControl(FlowStatus.WAIT, 8, 0x14), "31 08 14 CC CC CC CC CC"),
        (FlowControl(FlowStatus.OVERFLOW, 0, 0xF3), "32 00 F3 CC CC CC CC CC"),
    ],
)
def test_each_unit_has_its_bytes(
    pdu: ConsecutiveFrame | FirstFrame | FlowControl | SingleFrame, frame: str
) -> None:
    assert encode(pdu) == bytes.fromhex(frame)
    assert decode(bytes.fromhex(frame)) == pdu


@given(
    pdu=st.one_of(
        st.builds(SingleFrame, st.binary(min_size=1, max_size=7)),
        st.builds(FirstFrame, st.integers(8, 0xFFF), st.binary(min_size=6, max_size=6)),
        st.builds(FirstFrame, st.integers(0x1000, 2**32 - 1), st.binary(min_size=2, max_size=2)),
        st.builds(ConsecutiveFrame, st.integers(0, 15), st.binary(min_size=7, max_size=7)),
        st.builds(FlowControl, st.sampled_from(FlowStatus), BYTE, BYTE),
    )
)
def test_every_unit_survives_the_bus(
    pdu: ConsecutiveFrame | FirstFrame | FlowControl | SingleFrame,
) -> None:
    assert decode(encode(pdu)) == pdu


def test_a_frame_that_is_not_padded_is_read() -> None:
    assert decode(bytes.fromhex("03 41 0D 32")) == SingleFrame(bytes.fromhex("41 0D 32"))
    assert decode(bytes.fromhex("30 00 00")) == FlowControl(FlowStatus.CONTINUE_TO_SEND, 0, 0)


@pytest.mark.parametrize(
    ("frame", "reason"),
    [
        ("", "frame_length"),
        ("03 41 0D 32 00 00 00 00 00", "frame_length"),
        ("03 41 0D", "single_frame_length"),
        ("00 41 0D 32", "single_frame_length"),
        ("08 41 0D 32 00 00 00 00", "single_frame_length"),
        ("10 07 41 0D 32 00 00 00", "first_frame_length"),
        ("10 14 41 0D 32 00 00", "first_frame_length"),
        ("10 00 00 00 00 14 41 0D", "first_frame_length"),
        ("21", "consecutive_frame_length"),
        ("30 00", "flow_control"),
        ("33 00 00", "flow_control"),
        ("41 0D 32", "n_pci_type"),
        ("FF FF FF FF FF FF FF FF", "n_pci_type"),
    ],
)
def test_invalid_units_are_refused_with_their_reason(frame: str, reason: str) -> None:
    with pytest.raises(NPduError) as refused:
        decode(bytes.fromhex(frame))
    assert refused.value.reason == reason


@given(st.binary(max_size=12))
def test_any_bytes_are_a_unit_or_refused(frame: bytes) -> None:
    try:
        pdu = decode(frame)
    except NPduError:
        return
    assert encode(pdu)[0] >> 4 == frame[0] >> 4
