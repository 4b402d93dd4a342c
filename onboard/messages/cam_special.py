"""Containers of a CAM that cars do not send: of special vehicles and of road-side units.

Source: EN 302 637-2 V1.4.1, annex A; TS 102 894-2 V1.3.1. A bit string of varying length is packed
as a list of booleans, and an octet string as a list of numbers.
"""

from dataclasses import dataclass
from enum import Enum, IntFlag
from typing import Annotated

from onboard.messages.fields import (
    BitString,
    Boolean,
    Choice,
    Enumerated,
    ExtensibleEnumerated,
    ExtensibleQuantity,
    Integer,
    Optional,
    Quantity,
    SequenceOf,
    Unsigned,
)
from onboard.messages.its_common import (
    CAUSE_CODE,
    LATITUDE,
    LONGITUDE,
    CauseCode,
    LightBarSiren,
)
from onboard.messages.record import Record

_LIGHT_BAR_SIREN = BitString(LightBarSiren, 2)


@dataclass(frozen=True, slots=True)
class PtActivation:
    """What a public transport vehicle asks a traffic light for."""

    activation_type: Annotated[int, Unsigned(8)]
    content: Annotated[tuple[int, ...], SequenceOf(Unsigned(8), 1, 20)]


@dataclass(frozen=True, slots=True)
class PublicTransport:
    """Container of a public transport vehicle."""

    passengers_embark: Annotated[bool, Boolean()]
    activation: Annotated[PtActivation | None, Optional(Record(PtActivation))] = None


class SpecialTransportType(IntFlag):
    """What is special about a transport."""

    HEAVY_LOAD = 1 << 0
    EXCESS_WIDTH = 1 << 1
    EXCESS_LENGTH = 1 << 2
    EXCESS_HEIGHT = 1 << 3


@dataclass(frozen=True, slots=True)
class SpecialTransport:
    """Container of a heavy or outsize transport."""

    transport_type: Annotated[SpecialTransportType, BitString(SpecialTransportType, 4)]
    light_bar_siren: Annotated[LightBarSiren, _LIGHT_BAR_SIREN]


@dataclass(frozen=True, slots=True)
class DangerousGoods:
    """Container of a transport of dangerous goods."""

    goods: Annotated[int, Integer(0, 19)]
    """Class of UN recommendations, in the order of the standard."""


class HardShoulder(Enum):
    """State of a hard shoulder."""

    FOR_STOPPING = 0
    CLOSED = 1
    FOR_DRIVING = 2


@dataclass(frozen=True, slots=True)
class ClosedLanes:
    """Lanes that are closed."""

    inner_shoulder: Annotated[HardShoulder | None, Optional(Enumerated(HardShoulder))] = None
    outer_shoulder: Annotated[HardShoulder | None, Optional(Enumerated(HardShoulder))] = None
    lanes: Annotated[tuple[bool, ...] | None, Optional(SequenceOf(Boolean(), 1, 13))] = None


@dataclass(frozen=True, slots=True)
class RoadWorks:
    """Container of a road works vehicle."""

    subcause: Annotated[int | None, Optional(Unsigned(8))]
    light_bar_siren: Annotated[LightBarSiren, _LIGHT_BAR_SIREN]
    closed_lanes: Annotated[ClosedLanes | None, Optional(Record(ClosedLanes, extensible=True))] = (
        None
    )


@dataclass(frozen=True, slots=True)
class Rescue:
    """Container of a rescue vehicle, such as a tow truck."""

    light_bar_siren: Annotated[LightBarSiren, _LIGHT_BAR_SIREN]


class EmergencyPriority(IntFlag):
    """What an emergency vehicle asks for."""

    RIGHT_OF_WAY = 1 << 0
    FREE_CROSSING_AT_SIGNAL = 1 << 1


@dataclass(frozen=True, slots=True)
class Emergency:
    """Container of an emergency vehicle."""

    light_bar_siren: Annotated[LightBarSiren, _LIGHT_BAR_SIREN]
    incident: Annotated[CauseCode | None, Optional(CAUSE_CODE)] = None
    priority: Annotated[EmergencyPriority | None, Optional(BitString(EmergencyPriority, 2))] = None


class TrafficRule(Enum):
    """Rule for the vehicles behind."""

    NO_PASSING = 0
    NO_PASSING_FOR_TRUCKS = 1
    PASS_TO_RIGHT = 2
    PASS_TO_LEFT = 3


@dataclass(frozen=True, slots=True)
class SafetyCar:
    """Container of a vehicle that leads others."""

    light_bar_siren: Annotated[LightBarSiren, _LIGHT_BAR_SIREN]
    incident: Annotated[CauseCode | None, Optional(CAUSE_CODE)] = None
    rule: Annotated[TrafficRule | int | None, Optional(ExtensibleEnumerated(TrafficRule))] = None
    speed_limit_m_s: Annotated[float | None, Optional(Quantity(1, 255, 1 / 3.6, "m/s"))] = None


SPECIAL_VEHICLE = Choice(
    {
        "public_transport": Record(PublicTransport),
        "special_transport": Record(SpecialTransport),
        "dangerous_goods": Record(DangerousGoods),
        "road_works": Record(RoadWorks),
        "rescue": Record(Rescue),
        "emergency": Record(Emergency),
        "safety_car": Record(SafetyCar),
    },
    extensible=True,
)


class ProtectedZoneType(Enum):
    """How long a zone is protected; a temporary one is an addition, number 1."""

    PERMANENT = 0


@dataclass(frozen=True, slots=True)
class ProtectedZone:
    """A place where 5.8 GHz tolling is protected."""

    zone_type: Annotated[ProtectedZoneType | int, ExtensibleEnumerated(ProtectedZoneType)]
    expires_s: Annotated[float | None, Optional(Quantity(0, (1 << 42) - 1, 0.001, "s"))]
    """TAI since 2004."""
    latitude_deg: Annotated[float | None, LATITUDE]
    longitude_deg: Annotated[float | None, LONGITUDE]
    radius_m: Annotated[float | None, Optional(ExtensibleQuantity(1, 255, 1.0, "m"))] = None
    zone_id: Annotated[int | None, Optional(Integer(0, 134_217_727))] = None


@dataclass(frozen=True, slots=True)
class RoadSideContainer:
    """High frequency container of a road-side unit."""

    zones: Annotated[
        tuple[ProtectedZone, ...] | None,
        Optional(SequenceOf(Record(ProtectedZone, extensible=True), 1, 16)),
    ] = None
