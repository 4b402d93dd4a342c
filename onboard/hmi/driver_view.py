"""One view of the driver's page, as values: all that the page receives.

It is sent as JSON like the lines of a trace. Distances are in m, speeds in m/s; the page converts
them to the driver's units.
"""

from dataclasses import dataclass
from enum import StrEnum
from typing import ClassVar

from onboard.lcca.transitions import GroupState
from onboard.observations import Impairment, LeadIdentity, Sensor
from onboard.risk.alarm import Cause, Level
from onboard.risk.alarm_table import Headline, Sign
from onboard.trace.file_failure import FileFailure
from onboard.tracking.perceived_object import ObjectSource

_SHORT_ID_DIGITS = 4


def short_id(car_id: str) -> str:
    """Return the first digits of a communication ID in hexadecimal, as the page names vehicles."""
    return car_id[:_SHORT_ID_DIGITS]


class Direction(StrEnum):
    """Where the driver has to look."""

    AHEAD = "ahead"
    LEFT = "left"
    RIGHT = "right"


@dataclass(frozen=True, slots=True)
class GroupStatus:
    """The host vehicle in the warning group."""

    state: GroupState
    group_number: int
    """1 for the leader, and without a group."""
    leader_id: str
    """The leader's short ID."""
    follower_count: int
    """Number of followers."""


class Relation(StrEnum):
    """What a member is to the host vehicle."""

    HOST = "host"
    PREDECESSOR = "predecessor"
    """The host vehicle follows it."""
    FOLLOWER = "follower"
    """It is a follower."""
    OTHER = "other"


@dataclass(frozen=True, slots=True)
class MemberView:
    """One vehicle of the own group."""

    car: str | None
    """Its short ID; `None` for the host vehicle before it has sent a message."""
    number: int
    state: GroupState
    """REGULAR: a follower that has not told the own leader yet."""
    relation: Relation
    received_at_s: float
    """Time of its last message, or of the last warning about it."""
    brakes: bool
    """Whether it brakes hard, as heard."""


@dataclass(frozen=True, slots=True)
class MessageView:
    """One group message of a remote vehicle. Vehicles are named by their short IDs."""

    received_at_s: float
    """Time of its last repetition."""
    message: str
    """Type: `join`, `warn`, ..."""
    sender: str
    receiver: str | None
    """`None` if it names no receiver."""
    is_to_host: bool
    leader: str | None
    """The sender's leader, as it tells; `None` if the type has none, as `number`."""
    number: int | None
    content: dict[str, object]
    """The other fields, as in a trace."""


@dataclass(frozen=True, slots=True)
class LeadView:
    """The lead vehicle."""

    identity: LeadIdentity
    plate: str | None
    """As its car answered, or as the camera is certain of it; `None` also where only its motion
    identifies it."""
    names_asked: int | None
    """Texts in the last inquiry about it; `None` without one."""
    is_answered: bool
    """Whether its car is identified by radio."""
    gap_m: float | None
    safe_gap_m: float | None
    """Safety distance at the host vehicle's speed; `None` without a speed."""
    closing_speed_m_s: float | None
    """Positive while the gap shrinks."""


@dataclass(frozen=True, slots=True)
class VehicleOnMap:
    """A vehicle on the map, whose origin is the centre of the host vehicle."""

    ahead_m: float
    """From centre to centre; negative behind."""
    right_m: float
    relative_heading_rad: float | None
    """Clockwise from the host vehicle's heading; `None` if it stands or its speed is unknown."""
    source: ObjectSource
    in_alarm: bool = False
    """Whether a present alarm is about it."""


@dataclass(frozen=True, slots=True)
class AlarmView:
    """One present alarm."""

    cause: Cause
    level: Level
    direction: Direction
    vehicles_ahead: int | None
    """Position of the braking vehicle in the group, counted from the host vehicle; only for an LCCA
    warning."""
    raised_at_s: float
    """When it rose to this level; another value sounds anew."""
    headline: Headline
    sign: Sign
    sentence: str
    """In English."""
    is_test: bool = False
    """Whether nothing brakes: somebody has pressed the button."""


@dataclass(frozen=True, slots=True)
class BrakeRequestView:
    """The present request to brake, to the vehicle's controller."""

    deceleration_m_s2: float
    certainty: float
    """0 to 1."""


@dataclass(frozen=True, slots=True)
class SensorView:
    """One configured sensor."""

    sensor: Sensor
    is_lost: bool
    reason: str | None
    """Reason of the loss, as the sensor's component names it."""
    impairments: tuple[Impairment, ...] = ()
    """What makes its measurements worse."""


@dataclass(frozen=True, slots=True)
class DriverView:
    """Everything on the page."""

    kind: ClassVar[str] = "driver_view"
    stamp_s: float
    group: GroupStatus
    members: tuple[MemberView, ...]
    """In the order of their numbers."""
    messages: tuple[MessageView, ...]
    """The one that came up last first."""
    speed_m_s: float | None
    lead: LeadView | None
    """`None` without a recent camera frame."""
    vehicles: tuple[VehicleOnMap, ...]
    """Nearest first."""
    alarms: tuple[AlarmView, ...]
    """Most urgent first."""
    brake_request: BrakeRequestView | None
    sensors: tuple[SensorView, ...]
    recorder_failure: str | None
    """Why the black box does not record; `None` while it records, or without one."""
    failed_files: tuple[FileFailure, ...]
    """Files that are to be written and cannot be, each use once."""
    brake_button: bool
