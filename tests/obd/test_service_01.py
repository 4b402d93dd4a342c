"""Service 01 of SAE J1979: requests and responses."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from onboard.obd.service_01 import (
    PID_LENGTHS,
    NegativeResponse,
    PositiveResponse,
    ResponseError,
    decode_response,
    request,
    speed_m_s,
    supported_pids,
)


def answer(payload: str) -> NegativeResponse | PositiveResponse | None:
    return decode_response(bytes.fromhex(payload))


def test_the_request_names_service_and_pid() -> None:
    assert request(0x0D) == bytes.fromhex("01 0D")


def test_a_speed() -> None:
    assert answer("41 0D 32") == PositiveResponse({0x0D: b"\x32"})
    assert speed_m_s(b"\x32") * 3.6 == pytest.approx(50)
    assert speed_m_s(b"\xff") * 3.6 == pytest.approx(255)


def test_several_pids_in_one_response() -> None:
    # engine speed, vehicle speed, throttle
    assert answer("41 0C 1A F8 0D 32 11 80") == PositiveResponse(
        {0x0C: b"\x1a\xf8", 0x0D: b"\x32", 0x11: b"\x80"}
    )


def test_a_pid_of_unknown_length_takes_the_rest() -> None:
    assert answer("41 0D 32 66 01 02 03") == PositiveResponse(
        {0x0D: b"\x32", 0x66: b"\x01\x02\x03"}
    )


def test_supported_pids_of_a_real_car() -> None:
    # BE 3F A8 13, from the J1979 example: the speed (0D) is among them, and the next bitmap (20)
    pids = supported_pids(0x00, bytes.fromhex("BE 3F A8 13"))
    assert 0x0D in pids
    assert 0x20 in pids
    assert pids == {
        1,
        3,
        4,
        5,
        6,
        7,
        0xB,
        0xC,
        0xD,
        0xE,
        0xF,
        0x10,
        0x11,
        0x13,
        0x15,
        0x1C,
        0x1F,
        0x20,
    }


@given(base=st.sampled_from([0x00, 0x20, 0x40]), pids=st.sets(st.integers(1, 32)))
def test_each_bit_is_one_pid(base: int, pids: set[int]) -> None:
    bitmap = sum(1 << (32 - n) for n in pids).to_bytes(4)
    assert supported_pids(base, bitmap) == {base + n for n in pids}


def test_negative_responses() -> None:
    assert answer("7F 01 12") == NegativeResponse(0x12)
    assert answer("7F 01 78") == NegativeResponse(0x78)


@pytest.mark.parametrize("payload", ["7F 22 31", "49 02 01 31", "62 F1 90 00", "01 0D"])
def test_other_services_are_ignored(payload: str) -> None:
    assert answer(payload) is None


@pytest.mark.parametrize(
    ("payload", "reason"),
    [
        ("41", "pid_length"),
        ("41 0D", "pid_length"),
        ("41 0C 1A", "pid_length"),
        ("41 0D 32 00", "pid_length"),
        ("41 66", "pid_length"),
        ("41 0D 32 0D 33", "pid_twice"),
        ("7F", "negative_response_length"),
        ("7F 01", "negative_response_length"),
        ("7F 01 12 00", "negative_response_length"),
    ],
)
def test_a_contradictory_response_is_refused(payload: str, reason: str) -> None:
    with pytest.raises(ResponseError) as refused:
        answer(payload)
    assert refused.value.reason == reason


@given(
    st.lists(st.sampled_from(sorted(PID_LENGTHS)), min_size=1, max_size=6, unique=True).flatmap(
        lambda pids: st.fixed_dictionaries(
            {pid: st.binary(min_size=PID_LENGTHS[pid], max_size=PID_LENGTHS[pid]) for pid in pids}
        )
    )
)
def test_known_pids_are_split_in_any_combination(values: dict[int, bytes]) -> None:
    payload = b"\x41" + b"".join(bytes([pid]) + data for pid, data in values.items())
    assert decode_response(payload) == PositiveResponse(values)


@given(st.binary(min_size=1, max_size=40))
def test_any_payload_is_decoded_or_refused(payload: bytes) -> None:
    try:
        decoded = decode_response(payload)
    except ResponseError:
        return
    if isinstance(decoded, PositiveResponse):
        assert len(payload) == 1 + sum(1 + len(data) for data in decoded.values.values())
