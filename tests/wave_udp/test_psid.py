"""p-encoding of PSIDs, IEEE 1609.12-2019, 4.2."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from onboard.errors import DecodeError
from onboard.wave_udp import psid
from onboard.wave_udp.psid import p_decode, p_encode

# As the ISO/TC 204 and IEEE registries list them: value, and its p-encoding.
REGISTERED = {
    0x00: "00",
    0x20: "20",
    0x7F: "7f",
    0x80: "8000",
    0x82: "8002",
    0x100: "8080",
    0x27F: "81ff",
    0x4020: "bfa0",
    0x405F: "bfdf",
    0x407F: "bfff",
    0x4080: "c00000",
    0x84081: "c80001",
    0x204080: "e0000000",
    0x204097: "e0000017",
    0x1020407F: "efffffff",
}


@pytest.mark.parametrize(("value", "octets"), REGISTERED.items())
def test_registered_values(value: int, octets: str) -> None:
    assert p_encode(value).hex() == octets
    assert p_decode(bytes.fromhex(octets)) == (value, len(octets) // 2)


@given(st.integers(0, psid.HIGHEST), st.binary(max_size=4), st.binary(max_size=4))
def test_an_encoded_psid_is_decoded_at_any_position(
    value: int, before: bytes, after: bytes
) -> None:
    octets = p_encode(value)
    data = before + octets + after
    assert p_decode(data, len(before)) == (value, len(before) + len(octets))


@given(st.binary(min_size=1, max_size=4))
def test_every_value_has_one_encoding(data: bytes) -> None:
    try:
        value, end = p_decode(data)
    except DecodeError:
        return
    assert p_encode(value) == data[:end]


@pytest.mark.parametrize(
    ("octets", "reason"),
    [
        ("", "too_short"),
        ("80", "too_short"),
        ("c000", "too_short"),
        ("e00000", "too_short"),
        ("f0000000", "bad_psid"),
        ("ff", "bad_psid"),
    ],
)
def test_invalid_psid_bytes_are_refused(octets: str, reason: str) -> None:
    with pytest.raises(DecodeError) as refused:
        p_decode(bytes.fromhex(octets))
    assert refused.value.reason == reason


@pytest.mark.parametrize("value", [-1, psid.HIGHEST + 1])
def test_a_psid_beyond_the_range_is_a_value_error(value: int) -> None:
    with pytest.raises(ValueError, match="a PSID is 0 to 0x1020407f"):
        p_encode(value)


def test_the_lcca_psid_is_in_the_range_for_unregistered_use() -> None:
    assert psid.LCCA in psid.PRIVATE_USE
    assert len(psid.PRIVATE_USE) == 64
    assert p_encode(psid.PRIVATE_USE[0]).hex() == "bfa0"
    assert p_encode(psid.PRIVATE_USE[-1]).hex() == "bfdf"
