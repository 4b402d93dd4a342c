"""Part II of a BSM, vehicle safety extensions: events, path history and prediction, lights.

Field names, ranges and steps are those of SAE J2735 (2016 and 2020 agree here).
"""

from dataclasses import dataclass
from enum import IntFlag
from typing import Annotated

from onboard.messages.bsm_core import (
    ELEVATION,
    HEADING,
    LATITUDE,
    LONGITUDE,
    POSITIONAL_ACCURACY,
    SPEED,
    PositionalAccuracy,
    TransmissionState,
)
from onboard.messages.date_time import DateTime
from onboard.messages.fields import (
    Angle,
    BitString,
    Enumerated,
    Integer,
    OpenBitString,
    Optional,
    Quantity,
    SequenceOf,
)
from onboard.messages.record import Record


class VehicleEventFlags(IntFlag):
    """Events of the sender; a flag is set while its event lasts."""

    HAZARD_LIGHTS = 1 << 0
    STOP_LINE_VIOLATION = 1 << 1
    ABS_ACTIVATED = 1 << 2
    TRACTION_CONTROL_LOSS = 1 << 3
    STABILITY_CONTROL_ACTIVATED = 1 << 4
    HAZARDOUS_MATERIALS = 1 << 5
    RESERVED_1 = 1 << 6
    HARD_BRAKING = 1 << 7
    LIGHTS_CHANGED = 1 << 8
    WIPERS_CHANGED = 1 << 9
    FLAT_TIRE = 1 << 10
    DISABLED_VEHICLE = 1 << 11
    AIR_BAG_DEPLOYMENT = 1 << 12


class ExteriorLights(IntFlag):
    """Lights that are on."""

    LOW_BEAM = 1 << 0
    HIGH_BEAM = 1 << 1
    LEFT_TURN_SIGNAL = 1 << 2
    RIGHT_TURN_SIGNAL = 1 << 3
    HAZARD_SIGNAL = 1 << 4
    AUTOMATIC_LIGHT_CONTROL = 1 << 5
    DAYTIME_RUNNING = 1 << 6
    FOG_LIGHT = 1 << 7
    PARKING_LIGHTS = 1 << 8


class GnssStatus(IntFlag):
    """State of the sender's GNSS receiver."""

    UNAVAILABLE = 1 << 0
    IS_HEALTHY = 1 << 1
    IS_MONITORED = 1 << 2
    BASE_STATION = 1 << 3
    PDOP_UNDER_5 = 1 << 4
    IN_VIEW_UNDER_5 = 1 << 5
    LOCAL_CORRECTIONS = 1 << 6
    NETWORK_CORRECTIONS = 1 << 7


@dataclass(frozen=True, slots=True)
class TransmissionAndSpeed:
    """Gear and speed."""

    transmission: Annotated[TransmissionState | None, Enumerated(TransmissionState, unavailable=7)]
    speed_m_s: Annotated[float | None, SPEED]


@dataclass(frozen=True, slots=True)
class PositionConfidence:
    """Classes of accuracy: 0 is unavailable, 1 the worst, 15 the best (1 cm)."""

    position: Annotated[int, Integer(0, 15)]
    elevation: Annotated[int, Integer(0, 15)]


@dataclass(frozen=True, slots=True)
class MotionConfidence:
    """Classes of accuracy: 0 is unavailable, 1 the worst."""

    heading: Annotated[int, Integer(0, 7)]
    speed: Annotated[int, Integer(0, 7)]
    throttle: Annotated[int, Integer(0, 3)]


@dataclass(frozen=True, slots=True)
class FullPositionVector:
    """Initial position of a path history, if it is not the position of the BSM."""

    utc_time: Annotated[DateTime | None, Optional(Record(DateTime))]
    longitude_deg: Annotated[float | None, LONGITUDE]
    latitude_deg: Annotated[float | None, LATITUDE]
    elevation_m: Annotated[float | None, Optional(ELEVATION)]
    heading_rad: Annotated[float | None, Optional(HEADING)]
    speed: Annotated[TransmissionAndSpeed | None, Optional(Record(TransmissionAndSpeed))]
    accuracy: Annotated[PositionalAccuracy | None, Optional(POSITIONAL_ACCURACY)]
    time_confidence: Annotated[int | None, Optional(Integer(0, 39))]
    position_confidence: Annotated[PositionConfidence | None, Optional(Record(PositionConfidence))]
    motion_confidence: Annotated[MotionConfidence | None, Optional(Record(MotionConfidence))]


MAX_OFFSET_DEG = 0.013_107_1
"""Greatest offset of a path history point: 1.4 km north; less than 400 m east from 74 degrees of
latitude."""
_OFFSET = Quantity(-131071, 131071, 1e-7, "deg", unavailable=-131072)


@dataclass(frozen=True, slots=True)
class PathHistoryPoint:
    """A past position, as an offset from the initial position."""

    latitude_offset_deg: Annotated[float | None, _OFFSET]
    longitude_offset_deg: Annotated[float | None, _OFFSET]
    elevation_offset_m: Annotated[float | None, Quantity(-2047, 2047, 0.1, "m", unavailable=-2048)]
    age_s: Annotated[float | None, Quantity(1, 65534, 0.01, "s", unavailable=65535)]
    speed_m_s: Annotated[float | None, Optional(SPEED)] = None
    accuracy: Annotated[PositionalAccuracy | None, Optional(POSITIONAL_ACCURACY)] = None
    heading_rad: Annotated[float | None, Optional(Angle(240))] = None


@dataclass(frozen=True, slots=True)
class PathHistory:
    """Up to 23 points, newest first, between which the path is nearly straight."""

    initial_position: Annotated[
        FullPositionVector | None, Optional(Record(FullPositionVector, extensible=True))
    ]
    """Origin of the offsets; `None`: the position of the BSM."""
    gnss_status: Annotated[GnssStatus | None, Optional(BitString(GnssStatus, 8))]
    crumb_data: Annotated[
        tuple[PathHistoryPoint, ...], SequenceOf(Record(PathHistoryPoint, extensible=True), 1, 23)
    ]


@dataclass(frozen=True, slots=True)
class PathPrediction:
    """Predicted path of the sender, an arc of a circle."""

    radius_of_curve_m: Annotated[float | None, Quantity(-32767, 32766, 0.1, "m", unavailable=32767)]
    """Positive to the right; `None`: straight."""
    confidence: Annotated[float, Quantity(0, 200, 0.005, "")]
    """0 to 1."""


@dataclass(frozen=True, slots=True)
class VehicleSafetyExtensions:
    """Part II element that SAE J2945/1 requires of every light vehicle."""

    events: Annotated[VehicleEventFlags | None, Optional(OpenBitString(VehicleEventFlags, 13))] = (
        None
    )
    path_history: Annotated[PathHistory | None, Optional(Record(PathHistory, extensible=True))] = (
        None
    )
    path_prediction: Annotated[
        PathPrediction | None, Optional(Record(PathPrediction, extensible=True))
    ] = None
    lights: Annotated[ExteriorLights | None, Optional(OpenBitString(ExteriorLights, 9))] = None


SAFETY = Record(VehicleSafetyExtensions, extensible=True)
