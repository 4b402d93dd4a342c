"""Decentralised environmental notification message: an event on the road (EN 302 637-3 V1.3.1)."""

from dataclasses import dataclass
from enum import Enum
from typing import Annotated, Any, ClassVar

from onboard.messages.fields import (
    Enumerated,
    ExtensibleQuantity,
    Integer,
    OctetString,
    Optional,
    Quantity,
    RestOfMessage,
    SequenceOf,
    Unsigned,
)
from onboard.messages.its_common import (
    CAUSE_CODE,
    DELTA_POSITION,
    PATH,
    POSITION,
    PROTOCOL_VERSION,
    CauseCode,
    DeltaPosition,
    PathPoint,
    ReferencePosition,
    ReportedHeading,
    ReportedSpeed,
    check_header,
)
from onboard.messages.record import Record

MESSAGE_ID = 1
"""Of DENMs in the ItsPduHeader."""
DEFAULT_VALIDITY_S = 600.0
"""Validity of an event that states none."""

DANGEROUS_SITUATION, STATIONARY_VEHICLE = 99, 94
"""Causes (TS 102 894-2, CauseCodeType)."""
EMERGENCY_BRAKE_LIGHTS = 1
"""Subcause of a dangerous situation."""

_TIMESTAMP = Quantity(0, (1 << 42) - 1, 0.001, "s")


class Termination(Enum):
    """Why an event is over."""

    CANCELLATION = 0
    """By who has reported it."""
    NEGATION = 1
    """By somebody else."""


class RelevanceDistance(Enum):
    """Up to which distance an event matters."""

    M_50 = 0
    M_100 = 1
    M_200 = 2
    M_500 = 3
    M_1000 = 4
    M_5000 = 5
    M_10000 = 6
    FARTHER = 7


class TrafficDirection(Enum):
    """To whom an event matters."""

    ALL = 0
    UPSTREAM = 1
    DOWNSTREAM = 2
    OPPOSITE = 3


class RoadType(Enum):
    """Road on which an event is."""

    URBAN = 0
    URBAN_DIVIDED = 1
    RURAL = 2
    RURAL_DIVIDED = 3


@dataclass(frozen=True, slots=True)
class ActionId:
    """Which event: equal in all messages about it."""

    station_id: Annotated[bytes, OctetString(4)]
    """Of who has reported it first."""
    sequence: Annotated[int, Unsigned(16)]


@dataclass(frozen=True, slots=True)
class Management:
    """Which event, when and where; times are TAI since 2004."""

    action: Annotated[ActionId, Record(ActionId)]
    detected_s: Annotated[float, _TIMESTAMP]
    reference_s: Annotated[float, _TIMESTAMP]
    """Time of this report; a repetition has that of the report that it repeats."""
    termination: Annotated[Termination | None, Optional(Enumerated(Termination))]
    position: Annotated[ReferencePosition, POSITION]
    relevance_distance: Annotated[
        RelevanceDistance | None, Optional(Enumerated(RelevanceDistance))
    ] = None
    relevance_direction: Annotated[
        TrafficDirection | None, Optional(Enumerated(TrafficDirection))
    ] = None
    validity_s: Annotated[float | None, Optional(Quantity(0, 86_400, 1.0, "s"))] = None
    """From the detection on; `None` stands for `DEFAULT_VALIDITY_S`."""
    interval_s: Annotated[float | None, Optional(Quantity(1, 10_000, 0.001, "s"))] = None
    """At which the report is sent."""
    station_type: Annotated[int, Unsigned(8)] = 5


@dataclass(frozen=True, slots=True)
class EventPoint:
    """A place of an event that moves or is long."""

    position: Annotated[DeltaPosition, DELTA_POSITION]
    elapsed_s: Annotated[float | None, Optional(ExtensibleQuantity(1, 65_535, 0.01, "s"))]
    quality: Annotated[int, Integer(0, 7)]


@dataclass(frozen=True, slots=True)
class ReportedEvent:
    """What has happened."""

    quality: Annotated[int, Integer(0, 7)]
    """0: not known; 7: certain."""
    event: Annotated[CauseCode, CAUSE_CODE]
    linked: Annotated[CauseCode | None, Optional(CAUSE_CODE)] = None
    history: Annotated[
        tuple[EventPoint, ...] | None, Optional(SequenceOf(Record(EventPoint), 1, 23))
    ] = None


@dataclass(frozen=True, slots=True)
class EventLocation:
    """How the event moves, and the ways to it."""

    speed: Annotated[ReportedSpeed | None, Optional(Record(ReportedSpeed))]
    heading: Annotated[ReportedHeading | None, Optional(Record(ReportedHeading))]
    traces: Annotated[tuple[tuple[PathPoint, ...], ...], SequenceOf(PATH, 1, 7)]
    road_type: Annotated[RoadType | None, Optional(Enumerated(RoadType))] = None


@dataclass(frozen=True, slots=True)
class Notification:
    """An event on the road."""

    management: Annotated[Management, Record(Management, extensible=True)]
    situation: Annotated[ReportedEvent | None, Optional(Record(ReportedEvent, extensible=True))] = (
        None
    )
    location: Annotated[EventLocation | None, Optional(Record(EventLocation, extensible=True))] = (
        None
    )
    a_la_carte: Annotated[tuple[int, int] | None, Optional(RestOfMessage())] = None
    """Container of details, at the end, still encoded."""


@dataclass(frozen=True, slots=True)
class Denm:
    """A message about an event."""

    kind: ClassVar[str] = "denm"
    user_priority: ClassVar[int] = 7
    """That of access category AC_VO, which is DCC profile DP0 (TS 102 636-4-2)."""

    station_id: Annotated[bytes, OctetString(4)]
    notification: Annotated[Notification, Record(Notification)]


DENM = Record(Denm)
_HEAD = bytes((PROTOCOL_VERSION, MESSAGE_ID))
"""Of the ItsPduHeader, before the station ID."""


def encode(message: Denm) -> bytes:
    """Return the message. Raises `ValueError`, naming the field that cannot carry its value."""
    return _HEAD + DENM.encode(message)


def decode(data: bytes) -> Denm:
    """Read a DENM.

    Raises:
        DecodeError: `too_short`, `unknown_version`, `not_a_denm`, `trailing_bytes`, `out_of_range`
            or `too_long`.
    """
    check_header(data, MESSAGE_ID, "denm")
    return DENM.decode(data[len(_HEAD) :])


def as_dict(message: Denm) -> dict[str, Any]:
    """Return the message as it stands in a trace line."""
    return DENM.as_dict(message)
