"""A perceived object of a CPM (TS 103 324 V2.1.1; TS 102 894-2 V2.1.1, PerceivedObject), in SI.

Axes point to the east, to the north and upward; angles are counted from east to north.
"""

import math
from dataclasses import dataclass
from enum import Enum, IntFlag
from typing import Annotated

from onboard.messages.fields import (
    Angle,
    BitString,
    Choice,
    Chosen,
    Enumerated,
    Integer,
    NotRead,
    OpenBitString,
    Optional,
    Quantity,
    SequenceOf,
    Unsigned,
)
from onboard.messages.its_common import ANGLE_CONFIDENCE, SPEED_CONFIDENCE, ReportedSpeed
from onboard.messages.record import Record

MAX_OBJECTS = 255
"""In one message."""
VEHICLE, VRU, GROUP, OTHER = "vehicle", "vru", "group", "other"
"""Alternatives of a class."""
CARTESIAN, POLAR = "cartesian", "polar"
"""Alternatives of a velocity and of an acceleration."""

_ACCELERATION_CONFIDENCE = Quantity(0, 101, 0.1, "m/s2", unavailable=102)


class AngularSpeedConfidence(Enum):
    """Accuracy of an angular speed."""

    DEG_S_1 = 0
    DEG_S_2 = 1
    DEG_S_5 = 2
    DEG_S_10 = 3
    DEG_S_20 = 4
    DEG_S_50 = 5
    OUT_OF_RANGE = 6


class StateComponent(IntFlag):
    """Components of an object's state."""

    X = 1 << 0
    Y = 1 << 1
    Z = 1 << 2
    X_VELOCITY_OR_SPEED = 1 << 3
    Y_VELOCITY_OR_DIRECTION = 1 << 4
    Z_VELOCITY = 1 << 5
    X_ACCELERATION_OR_MAGNITUDE = 1 << 6
    Y_ACCELERATION_OR_DIRECTION = 1 << 7
    Z_ACCELERATION = 1 << 8
    Z_ANGLE = 1 << 9
    Y_ANGLE = 1 << 10
    X_ANGLE = 1 << 11
    Z_ANGULAR_VELOCITY = 1 << 12


class Pedestrian(Enum):
    """Profile of a pedestrian."""

    ORDINARY = 1
    ROAD_WORKER = 2
    FIRST_RESPONDER = 3
    RESERVED = 4


class Bicyclist(Enum):
    """Profile of a light vehicle."""

    BICYCLE = 1
    WHEELCHAIR = 2
    HORSE = 3
    ROLLER_SKATES = 4
    E_SCOOTER = 5
    PERSONAL_TRANSPORTER = 6
    PEDELEC = 7
    SPEED_PEDELEC = 8
    RESERVED = 9


class Motorcyclist(Enum):
    """Profile of a motorcycle."""

    MOPED = 1
    MOTORCYCLE = 2
    SIDECAR_RIGHT = 3
    SIDECAR_LEFT = 4
    RESERVED = 5


class Animal(Enum):
    """Profile of an animal."""

    WILD = 1
    FARM = 2
    SERVICE = 3
    RESERVED = 4


class ClusterProfile(IntFlag):
    """Who is in a group."""

    PEDESTRIAN = 1 << 0
    BICYCLIST = 1 << 1
    MOTORCYCLIST = 1 << 2
    ANIMAL = 1 << 3


@dataclass(frozen=True, slots=True)
class Coordinate:
    """Distance from the reference position along one axis; the ends of the range are beyond it."""

    value_m: Annotated[float, Quantity(-131_072, 131_071, 0.01, "m")]
    confidence_m: Annotated[float | None, Quantity(1, 4095, 0.01, "m", unavailable=4096)] = None
    """Bound of the error at 95 %; 40.95 stands for more."""


@dataclass(frozen=True, slots=True)
class ObjectPosition:
    """Middle of the object's bounding box."""

    east: Annotated[Coordinate, Record(Coordinate)]
    north: Annotated[Coordinate, Record(Coordinate)]
    up: Annotated[Coordinate | None, Optional(Record(Coordinate))] = None


@dataclass(frozen=True, slots=True)
class VelocityComponent:
    """Velocity along one axis."""

    value_m_s: Annotated[
        float | None, Quantity(-16_383, 16_382, 0.01, "m/s", unavailable=16_383)
    ] = None
    confidence_m_s: Annotated[float | None, SPEED_CONFIDENCE] = None
    """Bound of the error at 95 %; 1.26 stands for more."""


@dataclass(frozen=True, slots=True)
class CartesianVelocity:
    """Velocity by its components."""

    east: Annotated[VelocityComponent, Record(VelocityComponent)]
    north: Annotated[VelocityComponent, Record(VelocityComponent)]
    up: Annotated[VelocityComponent | None, Optional(Record(VelocityComponent))] = None


@dataclass(frozen=True, slots=True)
class CartesianAngle:
    """An angle."""

    value_rad: Annotated[float | None, Angle(3600, unavailable=3601)] = None
    confidence_rad: Annotated[float | None, ANGLE_CONFIDENCE] = None


@dataclass(frozen=True, slots=True)
class PolarVelocity:
    """Velocity by speed and direction."""

    speed: Annotated[ReportedSpeed, Record(ReportedSpeed)]
    direction: Annotated[CartesianAngle, Record(CartesianAngle)]
    up: Annotated[VelocityComponent | None, Optional(Record(VelocityComponent))] = None


@dataclass(frozen=True, slots=True)
class AccelerationComponent:
    """Acceleration along one axis."""

    value_m_s2: Annotated[float | None, Quantity(-160, 160, 0.1, "m/s2", unavailable=161)] = None
    confidence_m_s2: Annotated[float | None, _ACCELERATION_CONFIDENCE] = None


@dataclass(frozen=True, slots=True)
class AccelerationMagnitude:
    """Acceleration in its own direction."""

    value_m_s2: Annotated[float | None, Quantity(0, 160, 0.1, "m/s2", unavailable=161)] = None
    confidence_m_s2: Annotated[float | None, _ACCELERATION_CONFIDENCE] = None


@dataclass(frozen=True, slots=True)
class PolarAcceleration:
    """Acceleration by magnitude and direction."""

    magnitude: Annotated[AccelerationMagnitude, Record(AccelerationMagnitude)]
    direction: Annotated[CartesianAngle, Record(CartesianAngle)]
    up: Annotated[AccelerationComponent | None, Optional(Record(AccelerationComponent))] = None


@dataclass(frozen=True, slots=True)
class CartesianAcceleration:
    """Acceleration by its components."""

    east: Annotated[AccelerationComponent, Record(AccelerationComponent)]
    north: Annotated[AccelerationComponent, Record(AccelerationComponent)]
    up: Annotated[AccelerationComponent | None, Optional(Record(AccelerationComponent))] = None


@dataclass(frozen=True, slots=True)
class ObjectAngles:
    """Orientation of the bounding box: rotations about the axes, in this order."""

    z: Annotated[CartesianAngle, Record(CartesianAngle)]
    y: Annotated[CartesianAngle | None, Optional(Record(CartesianAngle))] = None
    x: Annotated[CartesianAngle | None, Optional(Record(CartesianAngle))] = None


@dataclass(frozen=True, slots=True)
class AngularVelocity:
    """About the vertical axis, positive to the left."""

    value_rad_s: Annotated[
        float | None, Quantity(-255, 255, math.radians(1.0), "rad/s", unavailable=256)
    ] = None
    confidence: Annotated[
        AngularSpeedConfidence | None, Enumerated(AngularSpeedConfidence, unavailable=7)
    ] = None


_CORRELATIONS = SequenceOf(Quantity(-100, 100, 0.01, "", unavailable=101), 1, 13, extensible=True)


@dataclass(frozen=True, slots=True)
class CorrelationMatrix:
    """Correlations below the diagonal, column by column."""

    components: Annotated[StateComponent, OpenBitString(StateComponent, 13)]
    columns: Annotated[tuple[tuple[float | None, ...], ...], SequenceOf(_CORRELATIONS, 1, 13)]


@dataclass(frozen=True, slots=True)
class ObjectDimension:
    """Size of the bounding box along one of its axes."""

    value_m: Annotated[float | None, Quantity(1, 255, 0.1, "m", unavailable=256)] = None
    confidence_m: Annotated[float | None, Quantity(1, 31, 0.1, "m", unavailable=32)] = None


@dataclass(frozen=True, slots=True)
class VruCluster:
    """A group of vulnerable road users."""

    cluster_id: Annotated[int | None, Optional(Unsigned(8))]
    bounding_box: Annotated[
        None, Optional(NotRead("unknown_object_data", "bounding box of a group"))
    ]
    """Absent in CPMs."""
    size: Annotated[int, Unsigned(8)]
    profiles: Annotated[ClusterProfile | None, Optional(BitString(ClusterProfile, 4))] = None


_VRU = Choice(
    {
        "pedestrian": Enumerated(Pedestrian, unavailable=0),
        "bicyclist": Enumerated(Bicyclist, unavailable=0),
        "motorcyclist": Enumerated(Motorcyclist, unavailable=0),
        "animal": Enumerated(Animal, unavailable=0),
    },
    extensible=True,
)
_CLASS = Choice(
    {
        VEHICLE: Unsigned(8),  # station type, 0: unknown
        VRU: _VRU,
        GROUP: Record(VruCluster, extensible=True),
        OTHER: Unsigned(8),  # 1: an object, 2: several, 3: bulk material
    },
    extensible=True,
)


@dataclass(frozen=True, slots=True)
class ObjectClass:
    """What the object may be."""

    choice: Annotated[Chosen, _CLASS]
    confidence_percent: Annotated[int, Integer(1, 101)] = 101
    """101: unavailable."""


@dataclass(frozen=True, slots=True)
class MapReference:
    """A road segment or an intersection of a MAPEM."""

    region: Annotated[int | None, Optional(Unsigned(16))]
    number: Annotated[int, Unsigned(16)]


@dataclass(frozen=True, slots=True)
class LanePosition:
    """Distance from the beginning of a lane."""

    value_m: Annotated[float | None, Quantity(0, 32_766, 0.1, "m", unavailable=32_767)] = None
    confidence_m: Annotated[float | None, Quantity(0, 1022, 0.1, "m", unavailable=1023)] = None


_MAP_REFERENCE = Record(MapReference)


@dataclass(frozen=True, slots=True)
class MapPosition:
    """Place on a lane of a MAPEM."""

    reference: Annotated[
        Chosen | None,
        Optional(Choice({"road_segment": _MAP_REFERENCE, "intersection": _MAP_REFERENCE})),
    ] = None
    lane_id: Annotated[int | None, Optional(Unsigned(8))] = None
    connection_id: Annotated[int | None, Optional(Unsigned(8))] = None
    along: Annotated[LanePosition | None, Optional(Record(LanePosition))] = None


_DIMENSION = Optional(Record(ObjectDimension))


@dataclass(frozen=True, slots=True)
class CpmObject:
    """One object, at the time of its measurement."""

    object_id: Annotated[int | None, Optional(Unsigned(16))]
    """The sender's number for it, the same in all its messages."""
    measurement_delta_time_ms: Annotated[int, Integer(-2048, 2047)]
    """From the message's reference time; negative before it."""
    position: Annotated[ObjectPosition, Record(ObjectPosition)]
    velocity: Annotated[
        Chosen | None,
        Optional(Choice({POLAR: Record(PolarVelocity), CARTESIAN: Record(CartesianVelocity)})),
    ] = None
    acceleration: Annotated[
        Chosen | None,
        Optional(
            Choice({POLAR: Record(PolarAcceleration), CARTESIAN: Record(CartesianAcceleration)})
        ),
    ] = None
    angles: Annotated[ObjectAngles | None, Optional(Record(ObjectAngles))] = None
    angular_velocity: Annotated[AngularVelocity | None, Optional(Record(AngularVelocity))] = None
    correlations: Annotated[
        tuple[CorrelationMatrix, ...] | None,
        Optional(SequenceOf(Record(CorrelationMatrix), 1, 4)),
    ] = None
    height: Annotated[ObjectDimension | None, _DIMENSION] = None
    width: Annotated[ObjectDimension | None, _DIMENSION] = None
    length: Annotated[ObjectDimension | None, _DIMENSION] = None
    age_ms: Annotated[int | None, Optional(Integer(0, 2047))] = None
    """Since it was first detected; 1,500: longer."""
    quality: Annotated[int | None, Optional(Integer(0, 15))] = None
    sensor_ids: Annotated[
        tuple[int, ...] | None, Optional(SequenceOf(Unsigned(8), 1, 128, extensible=True))
    ] = None
    classes: Annotated[
        tuple[ObjectClass, ...] | None, Optional(SequenceOf(Record(ObjectClass), 1, 8))
    ] = None
    map_position: Annotated[MapPosition | None, Optional(Record(MapPosition, extensible=True))] = (
        None
    )

    @property
    def is_vehicle(self) -> bool:
        """Whether it is a vehicle by its most probable class, or has no class."""
        known = [each for each in self.classes or () if each.confidence_percent <= 100]
        if known:
            best = max(known, key=lambda each: each.confidence_percent)
            return best.choice.name == VEHICLE
        return not self.classes or self.classes[0].choice.name == VEHICLE
