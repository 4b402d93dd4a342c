"""Data elements that ETSI ITS messages share (TS 102 894-2 V1.3.1), in SI.

Signs are those of the wire: yaw rate, curvature and lateral acceleration are positive to the left.
"""

import math
from dataclasses import dataclass
from enum import Enum, IntFlag
from typing import Annotated

from onboard.errors import DecodeError
from onboard.messages.fields import (
    Angle,
    Enumerated,
    ExtensibleQuantity,
    Optional,
    Quantity,
    SequenceOf,
    Unsigned,
)
from onboard.messages.record import Record

PROTOCOL_VERSION = 2
"""Of messages on TS 102 894-2 V1.x from 2018 on; 1 is of 2014, whose fields are others."""

PASSENGER_CAR = 5
ROAD_SIDE_UNIT = 15
"""Station types."""

LATITUDE = Quantity(-900_000_000, 900_000_000, 1e-7, "deg", unavailable=900_000_001)
LONGITUDE = Quantity(-1_800_000_000, 1_800_000_000, 1e-7, "deg", unavailable=1_800_000_001)
HEADING = Angle(3600, unavailable=3601)
SPEED = Quantity(0, 16382, 0.01, "m/s", unavailable=16383)
SPEED_CONFIDENCE = Quantity(1, 126, 0.01, "m/s", unavailable=127)
ANGLE_CONFIDENCE = Quantity(1, 126, math.radians(0.1), "rad", unavailable=127)
_SEMI_AXIS = Quantity(0, 4094, 0.01, "m", unavailable=4095)


class AltitudeConfidence(Enum):
    """Accuracy of an altitude."""

    M_0_01 = 0
    M_0_02 = 1
    M_0_05 = 2
    M_0_1 = 3
    M_0_2 = 4
    M_0_5 = 5
    M_1 = 6
    M_2 = 7
    M_5 = 8
    M_10 = 9
    M_20 = 10
    M_50 = 11
    M_100 = 12
    M_200 = 13
    OUT_OF_RANGE = 14


class LightBarSiren(IntFlag):
    """Warning devices in use."""

    LIGHT_BAR = 1 << 0
    SIREN = 1 << 1


@dataclass(frozen=True, slots=True)
class ConfidenceEllipse:
    """Ellipse in which the position is with a probability of 95 %."""

    semi_major_m: Annotated[float | None, _SEMI_AXIS] = None
    semi_minor_m: Annotated[float | None, _SEMI_AXIS] = None
    orientation_rad: Annotated[float | None, HEADING] = None
    """Direction of the major axis, clockwise from true north."""


@dataclass(frozen=True, slots=True)
class Altitude:
    """Height above the WGS 84 ellipsoid."""

    altitude_m: Annotated[
        float | None, Quantity(-100_000, 800_000, 0.01, "m", unavailable=800_001)
    ] = None
    confidence: Annotated[
        AltitudeConfidence | None, Enumerated(AltitudeConfidence, unavailable=15)
    ] = None


@dataclass(frozen=True, slots=True)
class ReferencePosition:
    """A position on WGS 84."""

    latitude_deg: Annotated[float | None, LATITUDE] = None
    longitude_deg: Annotated[float | None, LONGITUDE] = None
    ellipse: Annotated[ConfidenceEllipse, Record(ConfidenceEllipse)] = ConfidenceEllipse()
    altitude: Annotated[Altitude, Record(Altitude)] = Altitude()


POSITION = Record(ReferencePosition)


@dataclass(frozen=True, slots=True)
class ReportedHeading:
    """Direction of motion, clockwise from true north."""

    heading_rad: Annotated[float | None, HEADING] = None
    confidence_rad: Annotated[float | None, ANGLE_CONFIDENCE] = None


@dataclass(frozen=True, slots=True)
class ReportedSpeed:
    """Speed."""

    speed_m_s: Annotated[float | None, SPEED] = None
    confidence_m_s: Annotated[float | None, SPEED_CONFIDENCE] = None


MAX_DELTA_DEG = 0.013_107_1
"""Greatest offset between two points: 1.4 km north."""
_DELTA = Quantity(-131_071, 131_071, 1e-7, "deg", unavailable=131_072)


@dataclass(frozen=True, slots=True)
class DeltaPosition:
    """Offset of a position from another one."""

    latitude_deg: Annotated[float | None, _DELTA]
    longitude_deg: Annotated[float | None, _DELTA]
    altitude_m: Annotated[
        float | None, Quantity(-12_700, 12_799, 0.01, "m", unavailable=12_800)
    ] = None


DELTA_POSITION = Record(DeltaPosition)


@dataclass(frozen=True, slots=True)
class PathPoint:
    """A past position, as its offset from the point before it, the first from the sender."""

    position: Annotated[DeltaPosition, DELTA_POSITION]
    elapsed_s: Annotated[float | None, Optional(ExtensibleQuantity(1, 65_535, 0.01, "s"))] = None
    """Travel time between the two."""


PATH = SequenceOf(Record(PathPoint), 0, 40)


@dataclass(frozen=True, slots=True)
class CauseCode:
    """A kind of event."""

    cause: Annotated[int, Unsigned(8)]
    subcause: Annotated[int, Unsigned(8)] = 0


CAUSE_CODE = Record(CauseCode, extensible=True)


def check_header(data: bytes, message_id: int, name: str) -> None:
    """Check the ItsPduHeader: protocol version, message and sender.

    Args:
        data: the message.
        message_id: the expected one.
        name: short name of the expected message, for the reason.

    Raises:
        DecodeError: `too_short`, `unknown_version`, or `not_a_<name>` for another message.
    """
    if len(data) < 2:
        raise DecodeError("too_short", "ends within the header")
    if data[1] != message_id:
        raise DecodeError(f"not_a_{name}", f"message {data[1]}")
    if data[0] != PROTOCOL_VERSION:
        raise DecodeError("unknown_version", f"{data[0]} instead of {PROTOCOL_VERSION}")
