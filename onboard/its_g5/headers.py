"""Headers of GeoNetworking (EN 302 636-4-1 V1.4.1, clause 9) and of BTP-B (EN 302 636-5-1 V2.2.1).

Each is declared as a message: fields without gaps, most significant bit first.
"""

import math
from dataclasses import dataclass
from enum import Enum
from typing import Annotated

from onboard.messages.fields import Boolean, FixedPoint, OctetString, OpenEnumerated, Unsigned
from onboard.messages.record import Record

_LATITUDE = FixedPoint(32, 1e-7, "deg", lowest=-900_000_000, highest=900_000_000)
_LONGITUDE = FixedPoint(32, 1e-7, "deg", lowest=-1_800_000_000, highest=1_800_000_000)


class NextHeader(Enum):
    """What follows the basic header."""

    ANY = 0
    COMMON = 1
    SECURED = 2


class Transport(Enum):
    """What follows the extended header."""

    ANY = 0
    BTP_A = 1
    BTP_B = 2
    IPV6 = 3


@dataclass(frozen=True, slots=True)
class BasicHeader:
    """Basic header (9.6), outside of the signature: forwarders count the hops in it."""

    version: Annotated[int, Unsigned(4)]
    next_header: Annotated[NextHeader | int, OpenEnumerated(NextHeader, 4)]
    reserved: Annotated[int, Unsigned(8)]
    lifetime_multiplier: Annotated[int, Unsigned(6)]
    lifetime_base: Annotated[int, Unsigned(2)]
    """Unit of the multiplier: 50 ms, 1 s, 10 s or 100 s."""
    remaining_hops: Annotated[int, Unsigned(8)]


@dataclass(frozen=True, slots=True)
class CommonHeader:
    """Common header (9.7)."""

    transport: Annotated[Transport | int, OpenEnumerated(Transport, 4)]
    reserved: Annotated[int, Unsigned(4)]
    header_type: Annotated[int, Unsigned(4)]
    header_subtype: Annotated[int, Unsigned(4)]
    traffic_class: Annotated[int, Unsigned(8)]
    """DCC profile, 0 the most urgent (TS 102 636-4-2)."""
    is_mobile: Annotated[bool, Boolean()]
    reserved_flags: Annotated[int, Unsigned(7)]
    payload_bytes: Annotated[int, Unsigned(16)]
    """With the header of BTP."""
    maximum_hops: Annotated[int, Unsigned(8)]
    reserved_octet: Annotated[int, Unsigned(8)]


@dataclass(frozen=True, slots=True)
class LongPositionVector:
    """Who sends, and where it is (9.5.2)."""

    is_manual: Annotated[bool, Boolean()]
    """Whether the address was configured by hand."""
    station_type: Annotated[int, Unsigned(5)]
    reserved: Annotated[int, Unsigned(10)]
    mac: Annotated[bytes, OctetString(6)]
    timestamp_ms: Annotated[int, Unsigned(32)]
    """TAI since 2004, less whole multiples of 2^32 ms."""
    latitude_deg: Annotated[float, _LATITUDE]
    longitude_deg: Annotated[float, _LONGITUDE]
    is_accurate: Annotated[bool, Boolean()]
    speed_m_s: Annotated[float, FixedPoint(15, 0.01, "m/s", lowest=-16_384, highest=16_383)]
    heading_rad: Annotated[float, FixedPoint(16, math.radians(0.1), "rad", highest=0xFFFF)]


POSITION_VECTOR = Record(LongPositionVector)


@dataclass(frozen=True, slots=True)
class SingleHopBroadcast:
    """Extended header of a packet to whoever receives it (9.8.4)."""

    source: Annotated[LongPositionVector, POSITION_VECTOR]
    media_dependent: Annotated[int, Unsigned(32)] = 0


@dataclass(frozen=True, slots=True)
class Area:
    """Destination of a packet (9.8.5): around a point."""

    latitude_deg: Annotated[float, _LATITUDE]
    longitude_deg: Annotated[float, _LONGITUDE]
    distance_a_m: Annotated[int, Unsigned(16)]
    """Radius of a circle; half the length of a rectangle, long half axis of an ellipse."""
    distance_b_m: Annotated[int, Unsigned(16)] = 0
    angle_deg: Annotated[int, Unsigned(16)] = 0
    """Direction of the length, clockwise from north."""


AREA = Record(Area)


@dataclass(frozen=True, slots=True)
class GeoBroadcast:
    """Extended header of a packet to all in an area (9.8.5)."""

    sequence: Annotated[int, Unsigned(16)]
    reserved: Annotated[int, Unsigned(16)]
    source: Annotated[LongPositionVector, POSITION_VECTOR]
    area: Annotated[Area, AREA]
    reserved_end: Annotated[int, Unsigned(16)] = 0


@dataclass(frozen=True, slots=True)
class BtpB:
    """Header of BTP-B: to which service."""

    port: Annotated[int, Unsigned(16)]
    port_info: Annotated[int, Unsigned(16)] = 0


BASIC = Record(BasicHeader)
COMMON = Record(CommonHeader)
SINGLE_HOP = Record(SingleHopBroadcast)
GEO_BROADCAST = Record(GeoBroadcast)
BTP_B = Record(BtpB)
