"""GeoNetworking and BTP headers (ETSI EN 302 636-4-1 V1.4.1, clause 9; EN 302 636-5-1 V2.2.1)."""

import struct
from dataclasses import dataclass
from typing import Any

from onboard.errors import DecodeError

VERSIONS = (0, 1)
_ANY, _COMMON, _SECURED = range(3)
"""Next headers of the basic header (table 4)."""
_LIFETIME_UNITS_S = 0.05, 1.0, 10.0, 100.0
_TENTH_MICRODEGREE, _CM_S, _TENTH_DEGREE = 1e-7, 0.01, 0.1


@dataclass(frozen=True, slots=True)
class _Kind:
    """Extended header of a packet type (9.8)."""

    name: str
    size_bytes: int
    source_at: int
    """Where the long position vector of the source begins."""
    area_at: int | None = None


_SINGLE_HOP = 28
_AREA = 28
_KINDS = {
    1: _Kind("beacon", 24, 0),
    2: _Kind("geounicast", 48, 4),
    3: _Kind("geoanycast", 44, 4, _AREA),
    4: _Kind("geobroadcast", 44, 4, _AREA),
}
_SHAPES = "circle", "rectangle", "ellipse"
_TRANSPORTS = {1: "btp_a", 2: "btp_b", 3: "ipv6"}
"""Next headers of the common header (table 6)."""


@dataclass(frozen=True, slots=True)
class Header:
    """Fields of a header, and what follows it."""

    fields: dict[str, Any]
    content: bytes
    is_secured: bool = False
    """Whether 1609.2 data follow, in which the common header is."""
    port: int | None = None
    """Destination port of BTP."""


def read_basic(packet: bytes) -> Header:
    """Read the basic header (9.6), and without security the headers behind it.

    Raises:
        DecodeError: `too_short`, `bad_version` or another reason of `read_common`.
    """
    first, lifetime, hops = _unpack(">BxBB", packet, 0)
    version, following = first >> 4, first & 0x0F
    if version not in VERSIONS:
        raise DecodeError("bad_version", str(version))
    fields = {
        "version": version,
        "lifetime_s": (lifetime >> 2) * _LIFETIME_UNITS_S[lifetime & 3],
        "remaining_hop_limit": hops,
    }
    if following == _SECURED:
        return Header(fields, packet[4:], is_secured=True)
    if following not in {_ANY, _COMMON}:
        raise DecodeError("unknown_next_header", str(following))
    common = read_common(packet[4:])
    return Header(fields | common.fields, common.content, port=common.port)


def read_common(data: bytes) -> Header:
    """Read common header (9.7), extended header and BTP.

    Raises:
        DecodeError: `too_short`; `unknown_header_type` for location services and others; or
            `unknown_transport` for what is not BTP.
    """
    following, header, traffic_class, flags, size, max_hops = _unpack(">BBBBHBx", data, 0)
    following >>= 4
    kind = _kind(header >> 4, header & 0x0F)
    extended = data[8 : 8 + kind.size_bytes]
    source = _position_vector(extended, kind.source_at)
    fields = {
        "packet": kind.name,
        "traffic_class": traffic_class,
        "mobile": bool(flags & 0x80),
        "maximum_hop_limit": max_hops,
        "source": source,
    }
    if kind.area_at is not None:
        fields["area"] = _area(extended, kind.area_at, header & 0x0F)
    start = 8 + kind.size_bytes
    payload = data[start : start + size]
    if len(payload) < size:
        raise DecodeError("too_short", f"{len(payload)} of {size} octets")
    if size == 0:
        return Header(fields, b"")
    if _TRANSPORTS.get(following) not in {"btp_a", "btp_b"}:
        name = _TRANSPORTS.get(following, str(following))
        raise DecodeError("unknown_transport", name)
    port, second = _unpack(">HH", payload, 0)
    other = "source_port" if _TRANSPORTS[following] == "btp_a" else "destination_port_info"
    fields[_TRANSPORTS[following]] = {"destination_port": port, other: second}
    return Header(fields, payload[4:], port=port)


def _kind(header_type: int, subtype: int) -> _Kind:
    if header_type == 5:  # topologically scoped broadcast
        multi_hop = _Kind("topologically_scoped_broadcast", 28, 4)
        return multi_hop if subtype else _Kind("single_hop_broadcast", _SINGLE_HOP, 0)
    if header_type not in _KINDS:
        raise DecodeError("unknown_header_type", f"{header_type}.{subtype}")
    return _KINDS[header_type]


def _position_vector(data: bytes, at: int) -> dict[str, Any]:
    """Long position vector (9.5.2)."""
    address, timestamp_ms, latitude, longitude, speed, heading = _unpack(">QIiiHH", data, at)
    signed_speed = (speed & 0x7FFF) - (speed << 1 & 0x8000)
    return {
        "gn_address": f"{address:016x}",
        "station_type": address >> 58 & 0x1F,
        "timestamp_ms": timestamp_ms,
        "latitude_deg": latitude * _TENTH_MICRODEGREE,
        "longitude_deg": longitude * _TENTH_MICRODEGREE,
        "position_accurate": bool(speed >> 15),
        "speed_m_s": signed_speed * _CM_S,
        "heading_deg": heading * _TENTH_DEGREE,
    }


def _area(data: bytes, at: int, shape: int) -> dict[str, Any]:
    latitude, longitude, distance_a_m, distance_b_m, angle_deg = _unpack(">iiHHH", data, at)
    return {
        "shape": _SHAPES[shape] if shape < len(_SHAPES) else shape,
        "latitude_deg": latitude * _TENTH_MICRODEGREE,
        "longitude_deg": longitude * _TENTH_MICRODEGREE,
        "distance_a_m": distance_a_m,
        "distance_b_m": distance_b_m,
        "angle_deg": angle_deg,
    }


def _unpack(form: str, data: bytes, at: int) -> tuple[Any, ...]:
    try:
        return struct.unpack_from(form, data, at)
    except struct.error as error:
        raise DecodeError("too_short", "ends within a header") from error
