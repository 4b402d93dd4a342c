"""Part I of a BSM: position, motion, brakes and size of the sender.

Field names, ranges and steps are those of SAE J2735 (2016 and 2020 agree here); values are SI.
"""

import math
from dataclasses import dataclass
from enum import Enum, IntFlag
from typing import Annotated

from onboard.kinematics.units import STANDARD_GRAVITY_M_S2
from onboard.messages.fields import Angle, BitString, Enumerated, Integer, OctetString, Quantity
from onboard.messages.record import Record

LATITUDE = Quantity(-900_000_000, 900_000_000, 1e-7, "deg", unavailable=900_000_001)
LONGITUDE = Quantity(-1_799_999_999, 1_800_000_000, 1e-7, "deg", unavailable=1_800_000_001)
ELEVATION = Quantity(-4095, 61439, 0.1, "m", unavailable=-4096)
SPEED = Quantity(0, 8190, 0.02, "m/s", unavailable=8191)
HEADING = Angle(28800)
_ACCELERATION = Quantity(-2000, 2000, 0.01, "m/s2", unavailable=2001)
_SEMI_AXIS = Quantity(0, 254, 0.05, "m", unavailable=255)


class TransmissionState(Enum):
    """The gear."""

    NEUTRAL = 0
    PARK = 1
    FORWARD_GEARS = 2
    REVERSE_GEARS = 3
    RESERVED_1 = 4
    RESERVED_2 = 5
    RESERVED_3 = 6


class WheelBrakes(IntFlag):
    """Wheels whose brakes are applied."""

    UNAVAILABLE = 1 << 0
    LEFT_FRONT = 1 << 1
    LEFT_REAR = 1 << 2
    RIGHT_FRONT = 1 << 3
    RIGHT_REAR = 1 << 4


ALL_WHEELS = (
    WheelBrakes.LEFT_FRONT | WheelBrakes.LEFT_REAR | WheelBrakes.RIGHT_FRONT
    | WheelBrakes.RIGHT_REAR
)  # fmt: skip


class ControlStatus(Enum):
    """State of traction control, ABS or stability control; `ENGAGED` means active now."""

    OFF = 1
    ON = 2
    ENGAGED = 3


class BrakeBoost(Enum):
    """State of brake boost assist."""

    OFF = 1
    ON = 2


class AuxiliaryBrakes(Enum):
    """State of the auxiliary brakes, usually the parking brake."""

    OFF = 1
    ON = 2
    RESERVED = 3


@dataclass(frozen=True, slots=True)
class PositionalAccuracy:
    """The 1-sigma error ellipse of the position."""

    semi_major_m: Annotated[float | None, _SEMI_AXIS] = None
    semi_minor_m: Annotated[float | None, _SEMI_AXIS] = None
    orientation_rad: Annotated[float | None, Angle(65535)] = None
    """Direction of the major axis, clockwise from true north."""


POSITIONAL_ACCURACY = Record(PositionalAccuracy)


@dataclass(frozen=True, slots=True)
class AccelerationSet:
    """Acceleration in vehicle axes: forward, right, down; yaw rate is positive to the right."""

    longitudinal_m_s2: Annotated[float | None, _ACCELERATION] = None
    lateral_m_s2: Annotated[float | None, _ACCELERATION] = None
    vertical_m_s2: Annotated[
        float | None, Quantity(-126, 127, 0.02 * STANDARD_GRAVITY_M_S2, "m/s2", unavailable=-127)
    ] = None
    yaw_rate_rad_s: Annotated[float, Quantity(-32767, 32767, math.radians(0.01), "rad/s")] = 0.0
    """J2735 has no code for "unavailable"."""


@dataclass(frozen=True, slots=True)
class BrakeSystemStatus:
    """Brakes and brake assistance."""

    wheel_brakes: Annotated[WheelBrakes, BitString(WheelBrakes, 5)] = WheelBrakes.UNAVAILABLE
    traction: Annotated[ControlStatus | None, Enumerated(ControlStatus, unavailable=0)] = None
    abs: Annotated[ControlStatus | None, Enumerated(ControlStatus, unavailable=0)] = None
    stability: Annotated[ControlStatus | None, Enumerated(ControlStatus, unavailable=0)] = None
    brake_boost: Annotated[BrakeBoost | None, Enumerated(BrakeBoost, unavailable=0)] = None
    auxiliary: Annotated[AuxiliaryBrakes | None, Enumerated(AuxiliaryBrakes, unavailable=0)] = None


@dataclass(frozen=True, slots=True)
class VehicleSize:
    """Overall width and length."""

    width_m: Annotated[float | None, Quantity(1, 1023, 0.01, "m", unavailable=0)] = None
    length_m: Annotated[float | None, Quantity(1, 4095, 0.01, "m", unavailable=0)] = None


@dataclass(frozen=True, slots=True)
class CoreData:
    """BSMcoreData; `None` stands for unavailable."""

    msg_cnt: Annotated[int, Integer(0, 127)]
    """Count of the sender's BSMs; it restarts at a random value with each pseudonym."""
    temporary_id: Annotated[bytes, OctetString(4)]
    sec_mark_s: Annotated[float | None, Quantity(0, 65534, 0.001, "s", unavailable=65535)] = None
    """Time of the position, within the minute of UTC."""
    latitude_deg: Annotated[float | None, LATITUDE] = None
    longitude_deg: Annotated[float | None, LONGITUDE] = None
    elevation_m: Annotated[float | None, ELEVATION] = None
    """Height above the WGS 84 ellipsoid."""
    accuracy: Annotated[PositionalAccuracy, POSITIONAL_ACCURACY] = PositionalAccuracy()
    transmission: Annotated[
        TransmissionState | None, Enumerated(TransmissionState, unavailable=7)
    ] = None
    speed_m_s: Annotated[float | None, SPEED] = None
    heading_rad: Annotated[float | None, HEADING] = None
    """Clockwise from true north."""
    steering_angle_rad: Annotated[
        float | None, Quantity(-126, 126, math.radians(1.5), "rad", unavailable=127)
    ] = None
    """Angle of the steering wheel, positive to the right."""
    acceleration: Annotated[AccelerationSet, Record(AccelerationSet)] = AccelerationSet()
    brakes: Annotated[BrakeSystemStatus, Record(BrakeSystemStatus)] = BrakeSystemStatus()
    size: Annotated[VehicleSize, Record(VehicleSize)] = VehicleSize()


CORE = Record(CoreData)
