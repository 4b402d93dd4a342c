"""Part I of a BSM: where the sender is and what it does, in every message.

Field names, ranges and steps are those of SAE J2735 (2016 and 2020 agree here); values are SI.
"""

import math
from dataclasses import dataclass
from enum import Enum, IntFlag
from typing import Annotated

from onboard.messages.fields import BitString, Enumerated, Integer, OctetString, Quantity
from onboard.messages.record import Record
from onboard.units import STANDARD_GRAVITY_M_S2

LATITUDE = Quantity(-900_000_000, 900_000_000, 1e-7, "deg", unavailable=900_000_001)
LONGITUDE = Quantity(-1_799_999_999, 1_800_000_000, 1e-7, "deg", unavailable=1_800_000_001)
ELEVATION = Quantity(-4095, 61439, 0.1, "m", unavailable=-4096)
SPEED = Quantity(0, 8190, 0.02, "m/s", unavailable=8191)
HEADING = Quantity(0, 28799, math.radians(0.0125), "rad", unavailable=28800)
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
    """Which wheels are braked."""

    UNAVAILABLE = 1 << 0
    LEFT_FRONT = 1 << 1
    LEFT_REAR = 1 << 2
    RIGHT_FRONT = 1 << 3
    RIGHT_REAR = 1 << 4


class ControlStatus(Enum):
    """Of traction control, ABS or stability control: `ENGAGED` is at work now."""

    OFF = 1
    ON = 2
    ENGAGED = 3


class BrakeBoost(Enum):
    """Whether the brake assistant pushes along."""

    OFF = 1
    ON = 2


class AuxiliaryBrakes(Enum):
    """The brakes beside the service brake, the parking brake mostly."""

    OFF = 1
    ON = 2
    RESERVED = 3


@dataclass(frozen=True, slots=True)
class PositionalAccuracy:
    """One standard deviation of the position, as an ellipse."""

    semi_major_m: Annotated[float | None, _SEMI_AXIS] = None
    semi_minor_m: Annotated[float | None, _SEMI_AXIS] = None
    orientation_rad: Annotated[
        float | None, Quantity(0, 65534, math.tau / 65535, "rad", unavailable=65535)
    ] = None
    """Of the major axis, clockwise from true north."""


POSITIONAL_ACCURACY = Record(PositionalAccuracy)


@dataclass(frozen=True, slots=True)
class AccelerationSet:
    """Acceleration in the axes of the car: forward, right, down. Yaw turns to the right."""

    longitudinal_m_s2: Annotated[float | None, _ACCELERATION] = None
    lateral_m_s2: Annotated[float | None, _ACCELERATION] = None
    vertical_m_s2: Annotated[
        float | None, Quantity(-126, 127, 0.02 * STANDARD_GRAVITY_M_S2, "m/s2", unavailable=-127)
    ] = None
    yaw_rate_rad_s: Annotated[float, Quantity(-32767, 32767, math.radians(0.01), "rad/s")] = 0.0
    """The standard has no code for "unavailable"."""


@dataclass(frozen=True, slots=True)
class BrakeSystemStatus:
    """The brakes and what helps them."""

    wheel_brakes: Annotated[WheelBrakes, BitString(WheelBrakes, 5)] = WheelBrakes.UNAVAILABLE
    traction: Annotated[ControlStatus | None, Enumerated(ControlStatus, unavailable=0)] = None
    abs: Annotated[ControlStatus | None, Enumerated(ControlStatus, unavailable=0)] = None
    stability: Annotated[ControlStatus | None, Enumerated(ControlStatus, unavailable=0)] = None
    brake_boost: Annotated[BrakeBoost | None, Enumerated(BrakeBoost, unavailable=0)] = None
    auxiliary: Annotated[AuxiliaryBrakes | None, Enumerated(AuxiliaryBrakes, unavailable=0)] = None


@dataclass(frozen=True, slots=True)
class VehicleSize:
    """From bumper to bumper and from side to side."""

    width_m: Annotated[float | None, Quantity(1, 1023, 0.01, "m", unavailable=0)] = None
    length_m: Annotated[float | None, Quantity(1, 4095, 0.01, "m", unavailable=0)] = None


@dataclass(frozen=True, slots=True)
class CoreData:
    """What every BSM says. `None`: the sender does not know."""

    msg_cnt: Annotated[int, Integer(0, 127)]
    """Counts the sender's BSMs, and starts anywhere again when it changes its identity."""
    temporary_id: Annotated[bytes, OctetString(4)]
    sec_mark_s: Annotated[float | None, Quantity(0, 65534, 0.001, "s", unavailable=65535)] = None
    """When the position was true, within the minute of UTC."""
    latitude_deg: Annotated[float | None, LATITUDE] = None
    longitude_deg: Annotated[float | None, LONGITUDE] = None
    elevation_m: Annotated[float | None, ELEVATION] = None
    """Above the ellipsoid."""
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
    """Of the steering wheel, positive to the right."""
    acceleration: Annotated[AccelerationSet, Record(AccelerationSet)] = AccelerationSet()
    brakes: Annotated[BrakeSystemStatus, Record(BrakeSystemStatus)] = BrakeSystemStatus()
    size: Annotated[VehicleSize, Record(VehicleSize)] = VehicleSize()


CORE = Record(CoreData)
