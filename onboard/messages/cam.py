"""Cooperative awareness message: where its sender is and how it moves (EN 302 637-2 V1.4.1)."""

import math
from dataclasses import dataclass
from enum import Enum, IntFlag
from typing import Annotated, Any, ClassVar

from onboard.messages.cam_special import SPECIAL_VEHICLE, RoadSideContainer
from onboard.messages.fields import (
    BitString,
    Choice,
    Chosen,
    Enumerated,
    ExtensibleEnumerated,
    Integer,
    OctetString,
    Optional,
    Quantity,
    Unsigned,
)
from onboard.messages.its_common import (
    LATITUDE,
    LONGITUDE,
    PATH,
    POSITION,
    PROTOCOL_VERSION,
    PathPoint,
    ReferencePosition,
    ReportedHeading,
    ReportedSpeed,
    check_header,
)
from onboard.messages.record import Record

MESSAGE_ID = 2
"""Of CAMs in the ItsPduHeader."""

VEHICLE, ROAD_SIDE_UNIT = "vehicle", "road_side_unit"
"""Alternatives of the high frequency container; the low frequency container has the first only."""

_NO_HEADING, _NO_SPEED = ReportedHeading(), ReportedSpeed()
_ACCELERATION = Quantity(-160, 160, 0.1, "m/s2", unavailable=161)
_ACCELERATION_CONFIDENCE = Quantity(0, 101, 0.1, "m/s2", unavailable=102)


class DriveDirection(Enum):
    """Forward or in reverse."""

    FORWARD = 0
    BACKWARD = 1


class TrailerPresence(Enum):
    """What the vehicle's length includes."""

    NO_TRAILER = 0
    TRAILER_OF_KNOWN_LENGTH = 1
    TRAILER_OF_UNKNOWN_LENGTH = 2
    UNKNOWN = 3


class CurvatureConfidence(Enum):
    """Accuracy of a curvature."""

    PER_M_0_00002 = 0
    PER_M_0_0001 = 1
    PER_M_0_0005 = 2
    PER_M_0_002 = 3
    PER_M_0_01 = 4
    PER_M_0_1 = 5
    OUT_OF_RANGE = 6


class CurvatureCalculation(Enum):
    """Whether the yaw rate was used for the curvature."""

    YAW_RATE_USED = 0
    YAW_RATE_NOT_USED = 1
    UNAVAILABLE = 2


class YawRateConfidence(Enum):
    """Accuracy of a yaw rate."""

    DEG_S_0_01 = 0
    DEG_S_0_05 = 1
    DEG_S_0_1 = 2
    DEG_S_1 = 3
    DEG_S_5 = 4
    DEG_S_10 = 5
    DEG_S_100 = 6
    OUT_OF_RANGE = 7


class AccelerationControl(IntFlag):
    """What acts on the speed."""

    BRAKE_PEDAL = 1 << 0
    GAS_PEDAL = 1 << 1
    EMERGENCY_BRAKE = 1 << 2
    COLLISION_WARNING = 1 << 3
    ADAPTIVE_CRUISE_CONTROL = 1 << 4
    CRUISE_CONTROL = 1 << 5
    SPEED_LIMITER = 1 << 6


class CamLights(IntFlag):
    """Lights that are on."""

    LOW_BEAM = 1 << 0
    HIGH_BEAM = 1 << 1
    LEFT_TURN_SIGNAL = 1 << 2
    RIGHT_TURN_SIGNAL = 1 << 3
    DAYTIME_RUNNING = 1 << 4
    REVERSE = 1 << 5
    FOG_LIGHT = 1 << 6
    PARKING_LIGHTS = 1 << 7


NO_LIGHTS = CamLights(0)


class VehicleRole(Enum):
    """What the vehicle is in use for."""

    DEFAULT = 0
    PUBLIC_TRANSPORT = 1
    SPECIAL_TRANSPORT = 2
    DANGEROUS_GOODS = 3
    ROAD_WORK = 4
    RESCUE = 5
    EMERGENCY = 6
    SAFETY_CAR = 7
    AGRICULTURE = 8
    COMMERCIAL = 9
    MILITARY = 10
    ROAD_OPERATOR = 11
    TAXI = 12
    RESERVED_1 = 13
    RESERVED_2 = 14
    RESERVED_3 = 15


@dataclass(frozen=True, slots=True)
class BasicContainer:
    """Who sends, and from where."""

    station_type: Annotated[int, Unsigned(8)]
    position: Annotated[ReferencePosition, POSITION]
    """Of a vehicle: the middle of its front, on the ground."""


@dataclass(frozen=True, slots=True)
class VehicleLength:
    """Overall length."""

    length_m: Annotated[float | None, Quantity(1, 1022, 0.1, "m", unavailable=1023)] = None
    trailer: Annotated[TrailerPresence | None, Enumerated(TrailerPresence, unavailable=4)] = None


@dataclass(frozen=True, slots=True)
class Acceleration:
    """Acceleration along one axis: forward, to the left, or upward."""

    acceleration_m_s2: Annotated[float | None, _ACCELERATION] = None
    confidence_m_s2: Annotated[float | None, _ACCELERATION_CONFIDENCE] = None


@dataclass(frozen=True, slots=True)
class ReportedCurvature:
    """Of the path, positive to the left."""

    curvature_per_m: Annotated[
        float | None, Quantity(-1023, 1022, 1e-4, "1/m", unavailable=1023)
    ] = None
    confidence: Annotated[
        CurvatureConfidence | None, Enumerated(CurvatureConfidence, unavailable=7)
    ] = None


@dataclass(frozen=True, slots=True)
class ReportedYawRate:
    """Yaw rate, positive to the left."""

    yaw_rate_rad_s: Annotated[
        float | None, Quantity(-32_766, 32_766, math.radians(0.01), "rad/s", unavailable=32_767)
    ] = None
    confidence: Annotated[
        YawRateConfidence | None, Enumerated(YawRateConfidence, unavailable=8)
    ] = None


@dataclass(frozen=True, slots=True)
class SteeringAngle:
    """Angle of the steering wheel, positive to the left."""

    angle_rad: Annotated[
        float | None, Quantity(-511, 511, math.radians(1.5), "rad", unavailable=512)
    ] = None
    confidence_rad: Annotated[
        float | None, Quantity(1, 126, math.radians(1.5), "rad", unavailable=127)
    ] = None


@dataclass(frozen=True, slots=True)
class TollingZone:
    """A place where 5.8 GHz tolling is protected."""

    latitude_deg: Annotated[float | None, LATITUDE]
    longitude_deg: Annotated[float | None, LONGITUDE]
    zone_id: Annotated[int | None, Optional(Integer(0, 134_217_727))] = None


@dataclass(frozen=True, slots=True)
class HighFrequency:
    """How a vehicle moves, in each of its CAMs."""

    heading: Annotated[ReportedHeading, Record(ReportedHeading)] = _NO_HEADING
    speed: Annotated[ReportedSpeed, Record(ReportedSpeed)] = _NO_SPEED
    direction: Annotated[DriveDirection | None, Enumerated(DriveDirection, unavailable=2)] = None
    length: Annotated[VehicleLength, Record(VehicleLength)] = VehicleLength()
    width_m: Annotated[float | None, Quantity(1, 61, 0.1, "m", unavailable=62)] = None
    longitudinal: Annotated[Acceleration, Record(Acceleration)] = Acceleration()
    curvature: Annotated[ReportedCurvature, Record(ReportedCurvature)] = ReportedCurvature()
    curvature_calculation: Annotated[
        CurvatureCalculation | int, ExtensibleEnumerated(CurvatureCalculation)
    ] = CurvatureCalculation.UNAVAILABLE
    yaw_rate: Annotated[ReportedYawRate, Record(ReportedYawRate)] = ReportedYawRate()
    acceleration_control: Annotated[
        AccelerationControl | None, Optional(BitString(AccelerationControl, 7))
    ] = None
    lane: Annotated[int | None, Optional(Integer(-1, 14))] = None
    """From the outside of the road, which is 0; -1: beside it."""
    steering: Annotated[SteeringAngle | None, Optional(Record(SteeringAngle))] = None
    lateral: Annotated[Acceleration | None, Optional(Record(Acceleration))] = None
    vertical: Annotated[Acceleration | None, Optional(Record(Acceleration))] = None
    performance_class: Annotated[int | None, Optional(Integer(0, 7))] = None
    tolling_zone: Annotated[TollingZone | None, Optional(Record(TollingZone, extensible=True))] = (
        None
    )


@dataclass(frozen=True, slots=True)
class LowFrequency:
    """What changes slowly, in two CAMs a second."""

    role: Annotated[VehicleRole, Enumerated(VehicleRole)] = VehicleRole.DEFAULT
    lights: Annotated[CamLights, BitString(CamLights, 8)] = NO_LIGHTS
    path: Annotated[tuple[PathPoint, ...], PATH] = ()
    """Past positions, newest first."""


@dataclass(frozen=True, slots=True)
class CamParameters:
    """The containers."""

    basic: Annotated[BasicContainer, Record(BasicContainer, extensible=True)]
    high_frequency: Annotated[
        Chosen,
        Choice(
            {
                VEHICLE: Record(HighFrequency),
                ROAD_SIDE_UNIT: Record(RoadSideContainer, extensible=True),
            },
            extensible=True,
        ),
    ]
    low_frequency: Annotated[
        Chosen | None, Optional(Choice({VEHICLE: Record(LowFrequency)}, extensible=True))
    ] = None
    special_vehicle: Annotated[Chosen | None, Optional(SPECIAL_VEHICLE)] = None


@dataclass(frozen=True, slots=True)
class Cam:
    """A cooperative awareness message."""

    kind: ClassVar[str] = "cam"
    user_priority: ClassVar[int] = 3
    """That of access category AC_BE, which is DCC profile DP2 (TS 102 636-4-2)."""

    station_id: Annotated[bytes, OctetString(4)]
    generation_delta_time_s: Annotated[float, Quantity(0, 65_535, 0.001, "s")]
    """Time of the position: TAI since 2004, less whole multiples of 65.536 s."""
    parameters: Annotated[CamParameters, Record(CamParameters, extensible=True)]


CAM = Record(Cam)
_HEAD = bytes((PROTOCOL_VERSION, MESSAGE_ID))
"""Of the ItsPduHeader, before the station ID."""


def encode(message: Cam) -> bytes:
    """Return the message. Raises `ValueError`, naming the field that cannot carry its value."""
    return _HEAD + CAM.encode(message)


def decode(data: bytes) -> Cam:
    """Read a CAM.

    Raises:
        DecodeError: `too_short`, `unknown_version`, `not_a_cam`, `trailing_bytes`, `out_of_range`
            or `too_long`.
    """
    check_header(data, MESSAGE_ID, "cam")
    return CAM.decode(data[len(_HEAD) :])


def station_id_in(data: bytes) -> bytes | None:
    """Return the sender's station ID without decoding the rest; `None` if it is not a CAM."""
    return data[2:6] if data.startswith(_HEAD) and len(data) >= 6 else None


def as_dict(message: Cam) -> dict[str, Any]:
    """Return the message as it stands in a trace line."""
    return CAM.as_dict(message)
