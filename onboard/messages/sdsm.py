"""SAE J3224 SensorDataSharingMessage (SDSM) in a MessageFrame: what its sender detects.

It is sent under PSID 0x90. Field names, ranges and steps are those of SAE J3224 (2022); values are
SI. Of the optional data of an object only what the class and size of a vehicle need is read.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Annotated, Any, ClassVar

from typing_extensions import override

from onboard.errors import DecodeError
from onboard.messages.bsm_core import (
    HEADING,
    POSITIONAL_ACCURACY,
    SPEED,
    AccelerationSet,
    PositionalAccuracy,
    VehicleSize,
)
from onboard.messages.bsm_safety import ExteriorLights
from onboard.messages.date_time import DateTime
from onboard.messages.fields import (
    Choice,
    Chosen,
    ExtensibleEnumerated,
    FixedField,
    Integer,
    NotRead,
    OctetString,
    OpenBitString,
    Optional,
    Quantity,
    SequenceOf,
)
from onboard.messages.map_data import POSITION_3D, ReferencePoint
from onboard.messages.message_frame import FRAME, MessageFrame, content_of
from onboard.messages.record import Record

MESSAGE_ID = 41
"""DSRCmsgID of sensorDataSharingMessage."""
USER_PRIORITY = 5
"""As that of a BSM without event flags."""
MAX_OBJECTS = 256
MAX_OFFSET_M = 3276.7
MAX_AGE_MS = 1500
"""Limits of what an object's offsets from reference point and time can carry."""


class EquipmentType(Enum):
    """What has sent the message."""

    UNKNOWN = 0
    RSU = 1
    OBU = 2
    VRU = 3


class ObjectType(Enum):
    """What was detected."""

    UNKNOWN = 0
    VEHICLE = 1
    VRU = 2
    ANIMAL = 3


class Confidence(FixedField):
    """Bound of an error at 95 % confidence, as the least bound of a list that is not below it.

    Larger errors, and `None`, are sent as unavailable (code 0).
    """

    def __init__(self, bounds: Sequence[float], unit: str) -> None:
        """Declare the field.

        Args:
            bounds: of the codes from 1 on, in `unit`.
            unit: for the documentation.
        """
        self.unit = unit
        self._bounds = (None, *bounds)
        self._by_bound = sorted((bound, code) for code, bound in enumerate(bounds, start=1))
        self.bits = len(bounds).bit_length()

    @override
    def to_raw(self, value: float | None) -> int:
        if value is None:
            return 0
        return next((code for bound, code in self._by_bound if bound >= value), 0)

    @override
    def from_raw(self, raw: int) -> float | None:
        if raw >= len(self._bounds):
            raise DecodeError("out_of_range", f"no confidence has number {raw}")
        return self._bounds[raw]

    @override
    def row(self) -> tuple[str, str, str]:
        (least, _), (largest, _) = self._by_bound[0], self._by_bound[-1]
        return self.unit, f"one of {len(self._by_bound)} from {least:g} to {largest:g}", "0"


_DECADES = (5.0, 2.0, 1.0)
_POSITION = Confidence([5e2, 2e2, 1e2, 50, 20, 10, 5, 2, 1, 0.5, 0.2, 0.1, 0.05, 0.02, 0.01], "m")
_SPEED = Confidence([100.0, 10.0, 5.0, 1.0, 0.1, 0.05, 0.01], "m/s")
_HEADING = Confidence([10.0, 5.0, 1.0, 0.1, 0.05, 0.01, 0.0125], "deg")
_ACCELERATION = Confidence([100.0, 10.0, 5.0, 1.0, 0.1, 0.05, 0.01], "m/s2")
_YAW_RATE = Confidence([100.0, 10.0, 5.0, 1.0, 0.1, 0.05, 0.01], "deg/s")
_TIME = Confidence(
    [100.0, 50.0, 20.0, 10.0, 2.0, 1.0]
    + [step * 10.0**exponent for exponent in range(-1, -12, -1) for step in _DECADES],
    "s",
)
_OFFSET = Quantity(-32767, 32767, 0.1, "m")


@dataclass(frozen=True, slots=True)
class PositionOffset:
    """PositionOffsetXYZ: from the reference point."""

    east_m: Annotated[float, _OFFSET]
    north_m: Annotated[float, _OFFSET]
    up_m: Annotated[float | None, Optional(_OFFSET)] = None


@dataclass(frozen=True, slots=True)
class PositionConfidenceSet:
    """Errors of a position at 95 % confidence."""

    position_m: Annotated[float | None, _POSITION] = None
    elevation_m: Annotated[float | None, _POSITION] = None


@dataclass(frozen=True, slots=True)
class DetectedObject:
    """DetectedObjectCommonData: one object."""

    type: Annotated[ObjectType | int, ExtensibleEnumerated(ObjectType)]
    type_confidence_percent: Annotated[int, Integer(0, 101)]
    """101: unavailable."""
    object_id: Annotated[int, Integer(0, 65535)]
    """The sender's number for it, the same in all its messages."""
    measurement_time_ms: Annotated[int, Integer(-MAX_AGE_MS, MAX_AGE_MS)]
    """Positive after the time stamp of the message."""
    time_confidence_s: Annotated[float | None, _TIME]
    offset: Annotated[PositionOffset, Record(PositionOffset)]
    confidence: Annotated[PositionConfidenceSet, Record(PositionConfidenceSet)]
    speed_m_s: Annotated[float | None, SPEED] = None
    speed_confidence_m_s: Annotated[float | None, _SPEED] = None
    speed_up_m_s: Annotated[float | None, Optional(SPEED)] = None
    speed_up_confidence_m_s: Annotated[float | None, Optional(_SPEED)] = None
    heading_rad: Annotated[float | None, HEADING] = None
    heading_confidence_deg: Annotated[float | None, _HEADING] = None
    acceleration: Annotated[AccelerationSet | None, Optional(Record(AccelerationSet))] = None
    longitudinal_confidence_m_s2: Annotated[float | None, Optional(_ACCELERATION)] = None
    lateral_confidence_m_s2: Annotated[float | None, Optional(_ACCELERATION)] = None
    vertical_confidence_m_s2: Annotated[float | None, Optional(_ACCELERATION)] = None
    yaw_rate_confidence_deg_s: Annotated[float | None, Optional(_YAW_RATE)] = None


_NOT_READ = NotRead("unknown_object_data", "beyond lights, size and class of a vehicle")


@dataclass(frozen=True, slots=True)
class DetectedVehicle:
    """DetectedVehicleData, without what is not read."""

    lights: Annotated[ExteriorLights | None, Optional(OpenBitString(ExteriorLights, 9))] = None
    attitude: Annotated[None, Optional(_NOT_READ)] = None
    attitude_confidence: Annotated[None, Optional(_NOT_READ)] = None
    angular_velocity: Annotated[None, Optional(_NOT_READ)] = None
    angular_velocity_confidence: Annotated[None, Optional(_NOT_READ)] = None
    size: Annotated[VehicleSize | None, Optional(Record(VehicleSize))] = None
    height_m: Annotated[float | None, Optional(Quantity(0, 127, 0.05, "m"))] = None
    size_confidence: Annotated[None, Optional(_NOT_READ)] = None
    vehicle_class: Annotated[int | None, Optional(Integer(0, 255))] = None
    """BasicVehicleClass."""
    class_confidence_percent: Annotated[int | None, Optional(Integer(0, 101))] = None


_OBJECT_DATA = Choice(
    {
        "vehicle": Record(DetectedVehicle, extensible=True),
        "vru": _NOT_READ,
        "obstacle": _NOT_READ,
    }
)


@dataclass(frozen=True, slots=True)
class DetectedObjectData:
    """One object, with what more is known of one of its type."""

    common: Annotated[DetectedObject, Record(DetectedObject, extensible=True)]
    optional: Annotated[Chosen | None, Optional(_OBJECT_DATA)] = None


@dataclass(frozen=True, slots=True)
class SensorDataSharingMessage:
    """What its sender detects."""

    kind: ClassVar[str] = "sdsm"
    user_priority: ClassVar[int] = USER_PRIORITY
    msg_cnt: Annotated[int, Integer(0, 127)]
    source_id: Annotated[bytes, OctetString(4)]
    """The temporary ID of the sender's BSMs."""
    equipment: Annotated[EquipmentType | int, ExtensibleEnumerated(EquipmentType)]
    time: Annotated[DateTime, Record(DateTime)]
    reference: Annotated[ReferencePoint, POSITION_3D]
    """Where the sender is."""
    reference_accuracy: Annotated[PositionalAccuracy, POSITIONAL_ACCURACY]
    elevation_confidence_m: Annotated[float | None, Optional(_POSITION)]
    objects: Annotated[
        tuple[DetectedObjectData, ...],
        SequenceOf(Record(DetectedObjectData), 1, MAX_OBJECTS),
    ]


SDSM = Record(SensorDataSharingMessage)


def encode(message: SensorDataSharingMessage) -> bytes:
    """Return the MessageFrame. Raises `ValueError`, naming the field."""
    return FRAME.encode(MessageFrame(MESSAGE_ID, SDSM.encode(message)))


def decode(frame: bytes) -> SensorDataSharingMessage:
    """Read a MessageFrame.

    Raises:
        DecodeError: `not_a_sdsm`, `too_short`, `trailing_bytes`, `out_of_range`, or
            `unknown_object_data`.
    """
    return SDSM.decode(content_of(frame, MESSAGE_ID, "sdsm"))


def as_dict(message: SensorDataSharingMessage) -> dict[str, Any]:
    """Return the message as it stands in a trace line."""
    return SDSM.as_dict(message)
