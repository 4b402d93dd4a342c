"""Input and output values of the warning group."""

from dataclasses import dataclass
from typing import ClassVar

from onboard.lcca.transitions import GroupEvent, GroupState
from onboard.messages.lcca import CarId


@dataclass(frozen=True, slots=True)
class PrecedingVehicle:
    """The vehicle ahead in the own lane, as one camera frame shows it."""

    car_id: CarId | None
    """Communication ID of its plate; `None` while the plate is not known."""
    gap_m: float
    closing_speed_m_s: float | None
    """Positive while the gap shrinks; `None` while not known."""


@dataclass(frozen=True, slots=True)
class Transition:
    """This vehicle's state, leader or number in its group has changed."""

    kind: ClassVar[str] = "transition"
    stamp_s: float
    event: GroupEvent
    state_before: GroupState
    state: GroupState
    """After the event."""
    leader_id: CarId
    """After the event."""
    group_number: int
    """After the event; 1 unless the state is MEMBER."""
    cause: str
    """A stable word: `answered`, `gap`, `not_ahead`, `no_answer`, `update`, ..."""


@dataclass(frozen=True, slots=True)
class WarningRaised:
    """A vehicle ahead in the group brakes hard: the driver is to be warned."""

    kind: ClassVar[str] = "warning"
    stamp_s: float
    origin_id: CarId
    """Of the braking vehicle."""
    sequence: int
    """Identifies the event together with `origin_id`."""
    origin_number: int
    """The braking vehicle's number in the group, smaller than the own one."""
    group_number: int
    """The own number."""
    leader_id: CarId
    deceleration_m_s2: float
    age_s: float
    """From the sample that showed the braking to the sending of the last copy; the time on the air
    is not included, since it is not known without synchronised clocks."""
    hops: int
    """How many transmissions the warning took; 1: from the braking vehicle itself."""
