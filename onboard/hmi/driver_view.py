"""One moment of the driver's page, as values: what is in here is all that the page knows.

It becomes JSON as trace lines do. Gaps are metres, speeds m/s; the page turns
them into what the driver reads.
"""

from dataclasses import dataclass
from enum import StrEnum
from typing import ClassVar

from onboard.lcca.transitions import GroupState
from onboard.mvs.perceived_object import ObjectSource
from onboard.observations import LeadIdentity, Sensor
from onboard.risk.alarm import Cause, Level


class Direction(StrEnum):
    """Where the driver is to look."""

    AHEAD = "ahead"
    LEFT = "left"
    RIGHT = "right"


@dataclass(frozen=True, slots=True)
class GroupStatus:
    """The own place in the warning group."""

    state: GroupState
    number: int
    """1 is the leader, or a car alone."""
    group: str
    """Of the leader's ID, enough to tell groups apart."""
    followers: int
    """How many cars directly behind have joined."""


@dataclass(frozen=True, slots=True)
class LeadView:
    """The car ahead in the own lane."""

    identity: LeadIdentity
    plate: str | None
    gap_m: float | None
    safe_gap_m: float | None
    """At the own speed; `None` without a speed."""
    closing_speed_m_s: float | None
    """Positive while the gap shrinks."""


@dataclass(frozen=True, slots=True)
class VehicleOnMap:
    """A car on the map; the own car is at (0, 0) and looks up."""

    ahead_m: float
    """From the middle of the own car to the middle of that one; negative behind."""
    right_m: float
    turned_rad: float | None
    """Its heading, clockwise from the own one; `None` if it stands or is not known to move."""
    source: ObjectSource
    in_alarm: bool = False
    """Whether an alarm that holds is about it."""


@dataclass(frozen=True, slots=True)
class AlarmView:
    """One alarm that holds."""

    cause: Cause
    level: Level
    direction: Direction
    cars_ahead: int | None
    """How many places ahead in the group the braking car is; only for `Cause.LCCA`."""
    raised_at_s: float
    """When it came to this level: another one sounds anew."""


@dataclass(frozen=True, slots=True)
class SensorView:
    """A sensor that the car has."""

    sensor: Sensor
    lost: bool
    reason: str | None
    """Why, in a word of the room that lost it."""


@dataclass(frozen=True, slots=True)
class DriverView:
    """Everything on the page."""

    kind: ClassVar[str] = "driver_view"
    stamp_s: float
    place: GroupStatus
    speed_m_s: float | None
    ahead: LeadView | None
    """`None` while the camera does not tell."""
    cars: tuple[VehicleOnMap, ...]
    """The nearest first."""
    alarms: tuple[AlarmView, ...]
    """The most urgent first."""
    sensors: tuple[SensorView, ...]
    not_recording: str | None
    """Why the black box does not record; `None` while it does, or without one."""
    brake_button: bool
