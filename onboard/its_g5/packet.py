"""GeoNetworking packets: single-hop and geo-broadcast, with BTP-B (EN 302 636-4-1 V1.4.1).

On the air, the basic header precedes 1609.2 data, in which all the rest is (TS 103 097). Without
keys the rest follows it directly.
"""

from dataclasses import dataclass
from typing import Final, TypeVar

from onboard.errors import DecodeError
from onboard.its_g5.headers import (
    BASIC,
    BTP_B,
    COMMON,
    GEO_BROADCAST,
    SINGLE_HOP,
    Area,
    BasicHeader,
    BtpB,
    CommonHeader,
    GeoBroadcast,
    LongPositionVector,
    NextHeader,
    SingleHopBroadcast,
    Transport,
)
from onboard.messages.record import Record

VERSION: Final = 1
VERSIONS_READ: Final = (0, VERSION)
_GEO_BROADCAST, _TOPOLOGICALLY_SCOPED = 4, 5
"""Header types (table 7); of the second, subtype 0 is single-hop."""
_SHAPES: Final = range(3)
"""Subtypes of a geo-broadcast: circle, rectangle, ellipse."""
_MAXIMUM_HOPS_AT: Final = 6
"""Octet of the common header."""
LIFETIME_UNITS_S: Final = 0.05, 1.0, 10.0, 100.0
"""By the base of a lifetime."""

RecordT = TypeVar("RecordT")


@dataclass(frozen=True, slots=True)
class GeoPacket:
    """What follows the basic header."""

    port: int
    """BTP-B port of the service."""
    payload: bytes
    source: LongPositionVector
    traffic_class: int = 0
    maximum_hops: int = 1
    area: Area | None = None
    """Destination of a geo-broadcast; `None`: single-hop."""
    shape: int = 0
    """Of the area."""
    sequence: int = 0
    """Count of the sender's geo-broadcasts."""


def encode(packet: GeoPacket) -> bytes:
    """Return the packet from the common header on. Raises `ValueError` for what does not fit."""
    if packet.area is None:
        kind = _TOPOLOGICALLY_SCOPED, 0
        extended = SINGLE_HOP.encode(SingleHopBroadcast(packet.source))
    else:
        kind = _GEO_BROADCAST, packet.shape
        header = GeoBroadcast(packet.sequence, 0, packet.source, packet.area)
        extended = GEO_BROADCAST.encode(header)
    transported = BTP_B.encode(BtpB(packet.port)) + packet.payload
    common = CommonHeader(
        Transport.BTP_B, 0, *kind, packet.traffic_class, is_mobile=True, reserved_flags=0,
        payload_bytes=len(transported), maximum_hops=packet.maximum_hops, reserved_octet=0,
    )  # fmt: skip
    return COMMON.encode(common) + extended + transported


def decode(data: bytes) -> GeoPacket:
    """Read a packet from the common header on.

    Octets after the payload are padding of the link layer and ignored.

    Raises:
        DecodeError: `too_short`, `unknown_packet` for location services and others,
            `unknown_transport` for what is not BTP-B, `out_of_range`, or `bad_hop_limit` for a
            single-hop packet that may be forwarded.
    """
    common, rest = _take(COMMON, data)
    shape, sequence, area = 0, 0, None
    match common.header_type, common.header_subtype:
        case (5, 0):
            header, rest = _take(SINGLE_HOP, rest)
            source = header.source
            if common.maximum_hops > 1:
                raise DecodeError("bad_hop_limit", f"{common.maximum_hops} of a single hop")
        case (4, shape) if shape in _SHAPES:
            broadcast, rest = _take(GEO_BROADCAST, rest)
            source, sequence, area = broadcast.source, broadcast.sequence, broadcast.area
        case kind:
            raise DecodeError("unknown_packet", f"{kind[0]}.{kind[1]}")
    if common.transport is not Transport.BTP_B:
        raise DecodeError("unknown_transport", str(common.transport))
    if len(rest) < common.payload_bytes:
        raise DecodeError("too_short", f"{len(rest)} of {common.payload_bytes} octets")
    btp, payload = _take(BTP_B, rest[: common.payload_bytes])
    return GeoPacket(
        btp.port, payload, source, common.traffic_class, common.maximum_hops, area, shape, sequence
    )


def port_in(data: bytes) -> int | None:
    """Return the port of a packet from the common header on, without checking anything else."""
    if len(data) < 2:
        return None
    extended = SINGLE_HOP if data[1] >> 4 == _TOPOLOGICALLY_SCOPED else GEO_BROADCAST
    start = COMMON.size_bytes + extended.size_bytes
    return int.from_bytes(data[start : start + 2]) if len(data) >= start + 2 else None


def payload_in(data: bytes) -> bytes:
    """Return what follows the header of BTP-B, as `port_in`."""
    extended = SINGLE_HOP if data[1:2] and data[1] >> 4 == _TOPOLOGICALLY_SCOPED else GEO_BROADCAST
    return data[COMMON.size_bytes + extended.size_bytes + BTP_B.size_bytes :]


def with_basic_header(
    content: bytes, *, is_secured: bool, hops: int = 1, lifetime_s: float = 1.0
) -> bytes:
    """Return the packet as it is sent.

    Args:
        content: 1609.2 data, or without security the packet from the common header on.
        is_secured: whether it is 1609.2 data.
        hops: that the packet may take.
        lifetime_s: for which forwarders may keep it; rounded up to whole seconds, at most 63 s.
    """
    header = BasicHeader(
        VERSION,
        NextHeader.SECURED if is_secured else NextHeader.COMMON,
        reserved=0,
        lifetime_multiplier=min(max(1, -int(-lifetime_s // 1)), 63),
        lifetime_base=LIFETIME_UNITS_S.index(1.0),
        remaining_hops=hops,
    )
    return BASIC.encode(header) + content


def read_basic_header(packet: bytes) -> tuple[BasicHeader, bytes]:
    """Read the basic header, and return it with what follows it.

    Raises:
        DecodeError: `too_short`, `unknown_version` or `unknown_next_header`.
    """
    header, content = _take(BASIC, packet)
    if header.version not in VERSIONS_READ:
        raise DecodeError("unknown_version", f"{header.version} instead of {VERSION}")
    if not isinstance(header.next_header, NextHeader):
        raise DecodeError("unknown_next_header", str(header.next_header))
    return header, content


def check_hops(header: BasicHeader, content: bytes) -> None:
    """Check that a packet does not have more hops left than it was given (10.3.5).

    Args:
        header: the basic header.
        content: the packet from the common header on.

    Raises:
        DecodeError: `bad_hop_limit` or `too_short`.
    """
    if len(content) <= _MAXIMUM_HOPS_AT:
        raise DecodeError("too_short", "ends within the common header")
    maximum = content[_MAXIMUM_HOPS_AT]
    if header.remaining_hops > maximum:
        raise DecodeError("bad_hop_limit", f"{header.remaining_hops} hops left of {maximum}")


def _take(record: Record[RecordT], data: bytes) -> tuple[RecordT, bytes]:
    size = record.size_bytes
    return record.decode(data[:size]), data[size:]
