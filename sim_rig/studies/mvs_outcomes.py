"""What becomes of a crash when cars have radios: it is avoided, or why it happens all the same."""

from collections.abc import Sequence
from enum import StrEnum

import numpy as np

from sim_rig.roads.cars import Array, Cars
from sim_rig.roads.crashes import Crash

SAME_PLACE_M = 4.0
"""A car is the one that another knows of, if it is no farther from where that one is believed."""


class CrashOutcome(StrEnum):
    """Of a crash of two cars, of whom one or both could act to avoid it."""

    NO_RADIO = "no_radio"
    """It happened again: nobody who could act has a radio."""
    UNKNOWN = "unknown"
    """It happened again: nobody who could act and has a radio knew of the other car."""
    UNWARNED = "unwarned"
    """It happened again: the other car was known, but nobody was warned of it."""
    TOO_LATE = "too_late"
    """It happened again in spite of a warning."""
    ANOTHER = "another"
    """These two did not crash, but others did."""
    AVOIDED = "avoided"


class Concerned:
    """The two cars of a crash: when those that can act knew of the other, and were warned."""

    def __init__(self, crash: Crash, can_act: Sequence[str]) -> None:
        """Watch those of the two who can act."""
        self._crash, self._can_act = crash, can_act
        self._known_at: float | None = None
        self._warned_at: float | None = None
        self.straight_on_at: dict[str, float] = {}
        """When the paper's alarm would first have warned each of them."""

    def is_one(self, name: str) -> bool:
        """Whether a car is one of these."""
        return name in self._can_act

    def are_both(self, crash: Crash) -> bool:
        """Whether a crash is one of the same two."""
        return set(crash.names) == set(self._crash.names)

    def receive_known(self, name: str, places_m: Array, cars: Cars) -> None:
        """Where one of these believes others, (n, 2), and where all are."""
        if self._known_at is not None:
            return
        one, other = self._crash.names
        at = cars.index(other if name == one else one)
        if at is not None and len(places_m):
            away_m = np.hypot(*(places_m - cars.middle_m[at]).T)
            if away_m.min() < SAME_PLACE_M:
                self._known_at = cars.at_s

    def receive_warning(self, name: str, at_s: float) -> None:
        """A driver was warned of what the event has moved."""
        if name in self._can_act and self._warned_at is None:
            self._warned_at = at_s

    def receive_straight_on(self, name: str, at_s: float) -> None:
        """The paper's alarm would warn a driver of what the event has moved."""
        if name in self._can_act:
            self.straight_on_at.setdefault(name, at_s)

    def straight_on_before_s(self) -> float | None:
        """How long before the crash the paper's alarm would first have warned one of the two."""
        first_s = min(self.straight_on_at.values(), default=None)
        return None if first_s is None else round(self._crash.at_s - first_s, 3)

    def before_s(self) -> tuple[float | None, float | None]:
        """How long before the crash one first knew of the other, and was first warned."""
        known, warned = (
            None if at_s is None else round(self._crash.at_s - at_s, 3)
            for at_s in (self._known_at, self._warned_at)
        )
        return known, warned

    def fate(self, crash: Crash | None, equipped: set[str]) -> CrashOutcome:
        """Given the crash that there was with radios, and who has one."""
        if crash is None:
            return CrashOutcome.AVOIDED
        if not self.are_both(crash):
            return CrashOutcome.ANOTHER
        if equipped.isdisjoint(self._can_act):
            return CrashOutcome.NO_RADIO
        if self._warned_at is not None:
            return CrashOutcome.TOO_LATE
        return CrashOutcome.UNWARNED if self._known_at is not None else CrashOutcome.UNKNOWN
