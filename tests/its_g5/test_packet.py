"""GeoNetworking packets: the bits of a recorded one, round trips, and what is refused."""

from contextlib import suppress
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from onboard.errors import DecodeError
from onboard.its_g5 import packet
from onboard.its_g5.headers import POSITION_VECTOR, Area
from onboard.its_g5.packet import GeoPacket
from onboard.messages.record import Record
from tests.messages.strategies import records
from tests.tools.test_decode_its import BASIC, COMMON

RECORDED = packet.decode(COMMON)
packets = st.builds(
    GeoPacket,
    port=st.integers(0, 0xFFFF),
    payload=st.binary(max_size=50),
    source=records(POSITION_VECTOR),
    traffic_class=st.integers(0, 255),
    area=st.none() | records(Record(Area)),
)


def test_a_recorded_packet_has_its_values_and_is_encoded_to_the_same_bits() -> None:
    header, content = packet.read_basic_header(BASIC + COMMON)
    assert (header.version, header.remaining_hops) == (1, 1)
    assert (RECORDED.port, RECORDED.maximum_hops, RECORDED.area) == (2001, 1, None)
    assert RECORDED.source.latitude_deg == pytest.approx(48.7668616)
    assert RECORDED.source.longitude_deg == pytest.approx(11.4320679)
    assert packet.encode(RECORDED) == content


@given(packets)
def test_every_packet_is_read_again_with_padding_behind_it(sent: GeoPacket) -> None:
    content = packet.encode(sent)
    framed = packet.with_basic_header(content, is_secured=False)
    header, rest = packet.read_basic_header(framed + bytes(5))
    packet.check_hops(header, rest)
    assert packet.decode(rest) == sent
    assert packet.port_in(rest) == sent.port
    assert packet.payload_in(content) == sent.payload


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ((0, 0x21), "unknown_version"),
        ((0, 0x15), "unknown_next_header"),
        ((3, 0xFF), "bad_hop_limit"),
        ((3, 0x02), "bad_hop_limit"),
        ((4 + 6, 0xFF), "bad_hop_limit"),
        ((4 + 0, 0x10), "unknown_transport"),
        ((4 + 1, 0x10), "unknown_packet"),
        ((4 + 5, 0xFF), "too_short"),
    ],
)
def test_each_kind_of_bad_header_has_its_reason(change: tuple[int, int], reason: str) -> None:
    octets = bytearray(BASIC + COMMON)
    octets[change[0]] = change[1]
    assert _reason(bytes(octets)) == reason


def test_a_packet_truncated_anywhere_is_too_short() -> None:
    whole = BASIC + COMMON
    assert {_reason(whole[:cut]) for cut in range(4 + 8 + 28 + 4)} == {"too_short"}


def test_a_position_off_the_earth_cannot_be_sent_and_is_refused() -> None:
    far = replace(RECORDED, source=replace(RECORDED.source, latitude_deg=100.0))
    assert packet.decode(packet.encode(far)).source.latitude_deg == pytest.approx(90.0)
    octets = bytearray(COMMON)
    octets[8 + 12 : 8 + 16] = b"\x7f\xff\xff\xff"
    assert _reason(BASIC + bytes(octets)) == "out_of_range"


@given(st.binary(max_size=80))
def test_any_bytes_raise_only_decode_errors(noise: bytes) -> None:
    for frame in (noise, BASIC + noise, BASIC + COMMON[:4] + noise):
        with suppress(DecodeError):
            _read(frame)
        packet.port_in(noise)
        packet.payload_in(noise)


def _reason(frame: bytes) -> str:
    with pytest.raises(DecodeError) as refused:
        _read(frame)
    return refused.value.reason


def _read(frame: bytes) -> GeoPacket:
    header, content = packet.read_basic_header(frame)
    packet.check_hops(header, content)
    return packet.decode(content)
