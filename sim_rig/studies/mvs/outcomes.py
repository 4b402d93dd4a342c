"""Outcome of a crash when cars have radios: it is avoided, or the reason why it still happens."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from sim_rig.roads.cars import Array, Cars
from sim_rig.roads.crashes import Crash
from sim_rig.studies.mvs.events import SampledEvent

SAME_POSITION_M = 4.0
"""A perceived object is the car whose true position is no farther than this from its estimate."""


class CrashOutcome(StrEnum):
    """What radios change about a crash of two cars, one or both of which could act to avoid it."""

    NO_RADIO = "no_radio"
    """It happens: no car that could act has a radio."""
    UNKNOWN = "unknown"
    """It happens: no car with a radio that could act perceived the other car."""
    UNWARNED = "unwarned"
    """It happens: the other car was perceived, but no driver was warned of it."""
    TOO_LATE = "too_late"
    """It happens in spite of a warning."""
    ANOTHER = "another"
    """These two cars do not crash, but others do."""
    AVOIDED = "avoided"


@dataclass(slots=True)
class EncounterOutcome:
    """Result of one run."""

    of: SampledEvent
    crash: Crash | None = None
    crash_outcome: CrashOutcome | None = None
    """What radios change about the crash without radios; None if there is no such crash."""
    known_before_s: float | None = None
    """Time to that crash when a car that could act first perceived the other."""
    warned_before_s: float | None = None
    """Time to that crash when such a car was first warned."""
    first_warning_s: float | None = None
    """Time from the event to the first warning of a car that the event affected."""
    warned: int = 0
    """Warnings of cars that the event affected, and of those that crash without radios."""
    false_warnings: int = 0
    """Warnings of other cars, or of no car."""
    paper_alarm_crash: Crash | None = None
    """The crash of the same event if drivers reacted to the paper's true alarms."""
    paper_alarm_same_pair: bool = False
    """Whether the same two cars crash then as without radios."""
    paper_alarm_before_s: float | None = None
    """Time from the paper's first alarm to the crash without radios."""
    paper_alarm_false: int = 0
    """As `false_warnings`, of the paper's alarm."""
    driven_s: float = 0.0
    """Driving time of all cars with a radio, summed."""
    messages: int = 0


class CrashPair:
    """The two cars of a crash: when those that can act perceived the other, and were warned."""

    def __init__(self, crash: Crash, can_act: Sequence[str]) -> None:
        """`can_act` names those of the two cars whose drivers can avoid the crash."""
        self._crash, self._able = crash, can_act
        self._known_at: float | None = None
        self._warned_at: float | None = None
        self.paper_alarm_at: dict[str, float] = {}
        """When the paper's alarm would first have warned each of them."""

    def can_act(self, name: str) -> bool:
        """Whether this car is one of the two and can avoid the crash."""
        return name in self._able

    def are(self, *names: str) -> bool:
        """Whether these are the two cars."""
        return set(names) == set(self._crash.names)

    def is_same_pair(self, crash: Crash) -> bool:
        """Whether the same two cars collide in `crash`."""
        return self.are(*crash.names)

    def receive_perceived(self, name: str, positions_m: Array, cars: Cars) -> None:
        """Process the perceived objects of one car of the pair.

        Args:
            name: the car that perceives.
            positions_m: (n, 2) positions of its perceived objects.
            cars: true states of all cars.
        """
        if self._known_at is not None:
            return
        one, other = self._crash.names
        at = cars.index(other if name == one else one)
        if at is not None and len(positions_m):
            away_m = np.hypot(*(positions_m - cars.middle_m[at]).T)
            if away_m.min() < SAME_POSITION_M:
                self._known_at = cars.at_s

    def receive_warning(self, name: str, at_s: float) -> None:
        """Process a right warning."""
        if name in self._able and self._warned_at is None:
            self._warned_at = at_s

    def receive_paper_alarm(self, name: str, at_s: float) -> None:
        """Process an alarm of the paper that would warn rightly."""
        if name in self._able:
            self.paper_alarm_at.setdefault(name, at_s)

    def paper_alarm_lead_s(self) -> float | None:
        """Time from the paper's first alarm to the crash; None without an alarm."""
        first_s = min(self.paper_alarm_at.values(), default=None)
        return None if first_s is None else round(self._crash.at_s - first_s, 3)

    def lead_times_s(self) -> tuple[float | None, float | None]:
        """Times to the crash from when one first perceived the other, and was first warned."""
        known, warned = (
            None if at_s is None else round(self._crash.at_s - at_s, 3)
            for at_s in (self._known_at, self._warned_at)
        )
        return known, warned

    def outcome(self, crash: Crash | None, equipped: set[str]) -> CrashOutcome:
        """Classify the run in which the cars `equipped` have radios and `crash` happened."""
        if crash is None:
            return CrashOutcome.AVOIDED
        if not self.is_same_pair(crash):
            return CrashOutcome.ANOTHER
        if equipped.isdisjoint(self._able):
            return CrashOutcome.NO_RADIO
        if self._warned_at is not None:
            return CrashOutcome.TOO_LATE
        return CrashOutcome.UNWARNED if self._known_at is not None else CrashOutcome.UNKNOWN
