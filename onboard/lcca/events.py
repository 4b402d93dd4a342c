"""What the warning group is told of the road, and what it says."""

from dataclasses import dataclass
from typing import ClassVar

from onboard.lcca.transitions import GroupEvent, GroupState
from onboard.messages.lcca import CarId


@dataclass(frozen=True, slots=True)
class PrecedingVehicle:
    """The car ahead in the own lane, as the camera sees it."""

    car_id: CarId | None
    """`None` while its plate is not known."""
    gap_m: float
    closing_speed_m_s: float | None
    """Positive while the gap shrinks; `None` if not known yet."""


@dataclass(frozen=True, slots=True)
class Transition:
    """Something happened to this car's place in its group."""

    kind: ClassVar[str] = "transition"
    stamp_s: float
    event: GroupEvent
    state_before: GroupState
    state: GroupState
    """The place after the event; `number` is 1 unless it is MEMBER."""
    leader_id: CarId
    group_number: int
    cause: str
    """A short stable word: `answered`, `gap`, `not_ahead`, `no_answer`, `update`, ..."""


@dataclass(frozen=True, slots=True)
class WarningRaised:
    """A car ahead in the group brakes hard: tell the driver."""

    kind: ClassVar[str] = "warning"
    stamp_s: float
    origin_id: CarId
    """Of the braking car."""
    sequence: int
    """With `origin_id` the name of the event."""
    origin_number: int
    """The braking car's number in the group, smaller than ours."""
    group_number: int
    """Ours."""
    leader_id: CarId
    deceleration_m_s2: float
    age_s: float
    """From the sample that showed the braking to the last car's sending; the time on the air
    is not known without synchronised clocks and not in it."""
    hops: int
    """How many times it was sent to get here; 1: by the braking car itself."""
