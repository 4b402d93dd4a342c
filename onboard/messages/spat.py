"""SAE J2735 SPAT: signal phase and timing, sent by a road-side unit under PSID 0x82.

Field names, ranges and steps are those of SAE J2735 (2016 and 2020 agree here); values are SI.
"""

from dataclasses import dataclass
from enum import Enum, IntFlag
from typing import Annotated, Any, ClassVar

from onboard.messages.fields import (
    BitString,
    Boolean,
    Enumerated,
    ExtensibleEnumerated,
    Integer,
    Optional,
    Quantity,
    SequenceOf,
)
from onboard.messages.lane_nodes import LANE_ID
from onboard.messages.lanes import (
    DESCRIPTIVE_NAME,
    INTERSECTION_ID,
    SIGNAL_GROUP,
    IntersectionReferenceId,
)
from onboard.messages.map_data import MINUTE_OF_THE_YEAR
from onboard.messages.message_frame import (
    FRAME,
    REGIONS,
    MessageFrame,
    RegionalExtension,
    content_of,
)
from onboard.messages.record import Record

MESSAGE_ID = 19
"""DSRCmsgID of signalPhaseAndTimingMessage."""

HOUR_S = 3600.0
"""Period of a TimeMark, which counts from the beginning of an hour of UTC."""


class IntersectionStatus(IntFlag):
    """State of the signal controller."""

    MANUAL_CONTROL_IS_ENABLED = 1 << 0
    STOP_TIME_IS_ACTIVATED = 1 << 1
    FAILURE_FLASH = 1 << 2
    PREEMPT_IS_ACTIVE = 1 << 3
    SIGNAL_PRIORITY_IS_ACTIVE = 1 << 4
    FIXED_TIME_OPERATION = 1 << 5
    TRAFFIC_DEPENDENT_OPERATION = 1 << 6
    STANDBY_OPERATION = 1 << 7
    FAILURE_MODE = 1 << 8
    OFF = 1 << 9
    RECENT_MAP_MESSAGE_UPDATE = 1 << 10
    RECENT_CHANGE_IN_MAP_ASSIGNED_LANES_IDS_USED = 1 << 11
    NO_VALID_MAP_IS_AVAILABLE_AT_THIS_TIME = 1 << 12
    NO_VALID_SPAT_IS_AVAILABLE_AT_THIS_TIME = 1 << 13


class MovementPhaseState(Enum):
    """What a signal shows."""

    UNAVAILABLE = 0
    DARK = 1
    STOP_THEN_PROCEED = 2
    """Flashing red."""
    STOP_AND_REMAIN = 3
    """Red."""
    PRE_MOVEMENT = 4
    """Red and yellow, before green."""
    PERMISSIVE_MOVEMENT_ALLOWED = 5
    """Green, with conflicting traffic."""
    PROTECTED_MOVEMENT_ALLOWED = 6
    """Green, without."""
    PERMISSIVE_CLEARANCE = 7
    """Yellow, with conflicting traffic."""
    PROTECTED_CLEARANCE = 8
    """Yellow, without."""
    CAUTION_CONFLICTING_TRAFFIC = 9
    """Flashing yellow."""


class AdvisorySpeedType(Enum):
    """Purpose of an advised speed."""

    NONE = 0
    GREENWAVE = 1
    ECO_DRIVE = 2
    TRANSIT = 3


_TIME_MARK = Quantity(0, 36_000, 0.1, "s", unavailable=36_001)
"""TimeMark: since the beginning of the hour of UTC; 3,600 s: later than an hour from now."""
_DISTANCE = Optional(Quantity(1, 10_000, 1.0, "m", unavailable=0))


@dataclass(frozen=True, slots=True)
class TimeChangeDetails:
    """When a phase ends, in seconds since the beginning of the hour."""

    start_s: Annotated[float | None, Optional(_TIME_MARK)]
    min_end_s: Annotated[float | None, _TIME_MARK]
    """Earliest time."""
    max_end_s: Annotated[float | None, Optional(_TIME_MARK)] = None
    """Latest time."""
    likely_s: Annotated[float | None, Optional(_TIME_MARK)] = None
    confidence: Annotated[int | None, Optional(Integer(0, 15))] = None
    """Class of the likely time's probability, from 21 % (0) to 100 % (15)."""
    next_s: Annotated[float | None, Optional(_TIME_MARK)] = None
    """When the phase begins the next time."""


@dataclass(frozen=True, slots=True)
class AdvisorySpeed:
    """A speed with which to pass the signal."""

    type: Annotated[AdvisorySpeedType | int, ExtensibleEnumerated(AdvisorySpeedType)]
    speed_m_s: Annotated[float | None, Optional(Quantity(0, 499, 0.1, "m/s", unavailable=500))] = (
        None
    )
    confidence: Annotated[int | None, Optional(Integer(0, 7))] = None
    """Class of accuracy: 0 is unavailable, 1 the worst."""
    distance_m: Annotated[float | None, _DISTANCE] = None
    """Before the stop line, over which it holds."""
    restriction_class: Annotated[int | None, Optional(Integer(0, 255))] = None
    regions: Annotated[tuple[RegionalExtension, ...] | None, Optional(REGIONS)] = None


@dataclass(frozen=True, slots=True)
class MovementEvent:
    """What a signal shows now, or will show after the events before it in the list."""

    event_state: Annotated[MovementPhaseState, Enumerated(MovementPhaseState)]
    timing: Annotated[TimeChangeDetails | None, Optional(Record(TimeChangeDetails))] = None
    speeds: Annotated[
        tuple[AdvisorySpeed, ...] | None,
        Optional(SequenceOf(Record(AdvisorySpeed, extensible=True), 1, 16)),
    ] = None
    regions: Annotated[tuple[RegionalExtension, ...] | None, Optional(REGIONS)] = None


@dataclass(frozen=True, slots=True)
class ConnectionManeuverAssist:
    """What waits on a connection."""

    connection_id: Annotated[int, Integer(0, 255)]
    queue_length_m: Annotated[float | None, _DISTANCE] = None
    available_storage_length_m: Annotated[float | None, _DISTANCE] = None
    wait_on_stop: Annotated[bool | None, Optional(Boolean())] = None
    pedestrian_bicycle_detect: Annotated[bool | None, Optional(Boolean())] = None
    regions: Annotated[tuple[RegionalExtension, ...] | None, Optional(REGIONS)] = None


_ASSISTS = Optional(SequenceOf(Record(ConnectionManeuverAssist, extensible=True), 1, 16))


@dataclass(frozen=True, slots=True)
class MovementState:
    """A signal group, to which the connections of a MAP message refer."""

    movement_name: Annotated[str | None, Optional(DESCRIPTIVE_NAME)]
    signal_group: Annotated[int, SIGNAL_GROUP]
    events: Annotated[
        tuple[MovementEvent, ...], SequenceOf(Record(MovementEvent, extensible=True), 1, 16)
    ]
    """The present one first (J2735: state-time-speed)."""
    maneuver_assists: Annotated[tuple[ConnectionManeuverAssist, ...] | None, _ASSISTS] = None
    regions: Annotated[tuple[RegionalExtension, ...] | None, Optional(REGIONS)] = None


@dataclass(frozen=True, slots=True)
class IntersectionState:
    """All signals of one intersection."""

    name: Annotated[str | None, Optional(DESCRIPTIVE_NAME)]
    id: Annotated[IntersectionReferenceId, INTERSECTION_ID]
    revision: Annotated[int, Integer(0, 127)]
    """Of the MAP message with the lanes."""
    status: Annotated[IntersectionStatus, BitString(IntersectionStatus, 16)]
    moy_s: Annotated[float | None, MINUTE_OF_THE_YEAR]
    """Minute of the message, since the beginning of the year in UTC."""
    time_stamp_s: Annotated[
        float | None, Optional(Quantity(0, 65534, 0.001, "s", unavailable=65535))
    ]
    """Time of the message, within the minute."""
    enabled_lanes: Annotated[tuple[int, ...] | None, Optional(SequenceOf(LANE_ID, 1, 16))]
    """Revocable lanes that are in use."""
    states: Annotated[
        tuple[MovementState, ...], SequenceOf(Record(MovementState, extensible=True), 1, 255)
    ]
    maneuver_assists: Annotated[tuple[ConnectionManeuverAssist, ...] | None, _ASSISTS] = None
    regions: Annotated[tuple[RegionalExtension, ...] | None, Optional(REGIONS)] = None


@dataclass(frozen=True, slots=True)
class Spat:
    """A SPAT message."""

    kind: ClassVar[str] = "spat"
    time_stamp_s: Annotated[float | None, MINUTE_OF_THE_YEAR]
    name: Annotated[str | None, Optional(DESCRIPTIVE_NAME)]
    intersections: Annotated[
        tuple[IntersectionState, ...],
        SequenceOf(Record(IntersectionState, extensible=True), 1, 32),
    ]
    regions: Annotated[tuple[RegionalExtension, ...] | None, Optional(REGIONS)] = None


SPAT = Record(Spat, extensible=True)


def encode(message: Spat) -> bytes:
    """Return the MessageFrame. Raises `ValueError`, naming the field."""
    return FRAME.encode(MessageFrame(MESSAGE_ID, SPAT.encode(message)))


def decode(frame: bytes) -> Spat:
    """Read a MessageFrame.

    Raises:
        DecodeError: `not_a_spat`, `too_short`, `trailing_bytes`, `out_of_range` or `too_long`.
    """
    return SPAT.decode(content_of(frame, MESSAGE_ID, "spat"))


def as_dict(message: Spat) -> dict[str, Any]:
    """Return the message as it stands in a trace line."""
    return SPAT.as_dict(message)
