"""GeoNetworking and BTP headers for printing: all kinds of packets, declared in `onboard/its_g5`.

Of kinds that vehicles here do not receive (EN 302 636-4-1 V1.4.1, 9.8), who sends them is read.
"""

from dataclasses import dataclass
from typing import Any

from onboard.errors import DecodeError
from onboard.its_g5 import packet
from onboard.its_g5.headers import (
    AREA,
    BTP_B,
    COMMON,
    GEO_BROADCAST,
    POSITION_VECTOR,
    SINGLE_HOP,
    CommonHeader,
    NextHeader,
    Transport,
)


@dataclass(frozen=True, slots=True)
class _Kind:
    """Extended header of a packet type."""

    name: str
    size_bytes: int
    source_at: int = 4
    """Where the long position vector of the source begins, here behind the sequence number."""
    has_area: bool = False
    """Whether an area follows it."""


_TOPOLOGICALLY_SCOPED = 5
_SINGLE_HOP = _Kind("single_hop_broadcast", SINGLE_HOP.size_bytes, 0)
_MULTI_HOP = _Kind("topologically_scoped_broadcast", 28)
_KINDS = {
    1: _Kind("beacon", POSITION_VECTOR.size_bytes, 0),
    2: _Kind("geounicast", 48),
    3: _Kind("geoanycast", GEO_BROADCAST.size_bytes, has_area=True),
    4: _Kind("geobroadcast", GEO_BROADCAST.size_bytes, has_area=True),
}
_SHAPES = "circle", "rectangle", "ellipse"
_SECOND_FIELDS = {Transport.BTP_A: "source_port", Transport.BTP_B: "destination_port_info"}
"""What follows the port of the destination."""


@dataclass(frozen=True, slots=True)
class Header:
    """Fields of a header, and what follows it."""

    fields: dict[str, Any]
    content: bytes
    is_secured: bool = False
    """Whether 1609.2 data follow, in which the common header is."""
    port: int | None = None
    """Destination port of BTP."""


def read_basic(data: bytes) -> Header:
    """Read the basic header (9.6), and without security the headers behind it.

    Raises:
        DecodeError: `too_short`, `unknown_version`, `unknown_next_header` or another reason of
            `read_common`.
    """
    header, content = packet.read_basic_header(data)
    unit_s = packet.LIFETIME_UNITS_S[header.lifetime_base]
    fields = {
        "version": header.version,
        "lifetime_s": header.lifetime_multiplier * unit_s,
        "remaining_hop_limit": header.remaining_hops,
    }
    if header.next_header is NextHeader.SECURED:
        return Header(fields, content, is_secured=True)
    common = read_common(content)
    return Header(fields | common.fields, common.content, port=common.port)


def read_common(data: bytes) -> Header:
    """Read common header (9.7), extended header and BTP.

    Raises:
        DecodeError: `too_short`; `unknown_header_type` for location services and others; or
            `unknown_transport` for what is not BTP.
    """
    common = COMMON.decode(data[: COMMON.size_bytes])
    kind = _kind(common)
    extended = data[COMMON.size_bytes :][: kind.size_bytes]
    end = kind.source_at + POSITION_VECTOR.size_bytes
    source = POSITION_VECTOR.decode(extended[kind.source_at : end])
    fields = {
        "packet": kind.name,
        "traffic_class": common.traffic_class,
        "mobile": common.is_mobile,
        "maximum_hop_limit": common.maximum_hops,
        "source": POSITION_VECTOR.as_dict(source),
    }
    if kind.has_area:
        shape = common.header_subtype
        area = AREA.as_dict(AREA.decode(extended[end : end + AREA.size_bytes]))
        fields["area"] = {"shape": _SHAPES[shape] if shape < len(_SHAPES) else shape} | area
    payload = data[COMMON.size_bytes + kind.size_bytes :][: common.payload_bytes]
    if len(payload) < common.payload_bytes:
        raise DecodeError("too_short", f"{len(payload)} of {common.payload_bytes} octets")
    if not payload:
        return Header(fields, b"")
    transport = common.transport
    if not isinstance(transport, Transport) or transport not in _SECOND_FIELDS:
        name = transport.name.lower() if isinstance(transport, Transport) else str(transport)
        raise DecodeError("unknown_transport", name)
    btp = BTP_B.decode(payload[: BTP_B.size_bytes])
    second = _SECOND_FIELDS[transport]
    fields[transport.name.lower()] = {"destination_port": btp.port, second: btp.port_info}
    return Header(fields, payload[BTP_B.size_bytes :], port=btp.port)


def _kind(common: CommonHeader) -> _Kind:
    if common.header_type == _TOPOLOGICALLY_SCOPED:
        return _MULTI_HOP if common.header_subtype else _SINGLE_HOP
    if common.header_type not in _KINDS:
        raise DecodeError("unknown_header_type", f"{common.header_type}.{common.header_subtype}")
    return _KINDS[common.header_type]
