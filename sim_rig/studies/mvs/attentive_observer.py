"""When an attentive observer of the true states could first know that two cars will crash.

It sees where both cars are, their speeds, how these change, and how they turn; not what drivers
mean to do. It expects both to go on turning and changing speed as they do, down to a standstill,
and knows of the crash once they would touch. A driver who must yield may still stop, so it also
waits until he could do so only by braking harder than drivers do; one who sets off at a red light
does not stop.
"""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from sim_rig.roads.cars import Array, Cars
from sim_rig.roads.crashes import first_crash
from sim_rig.roads.driver import STANDS_M_S
from sim_rig.roads.retimed import BRAKING_M_S2

_HORIZON_S = 6.0
_EVERY_S = 0.25


@dataclass(slots=True)
class AttentiveObserver:
    """Watches two cars step by step."""

    pair: tuple[str, str]
    yields: str | None = None
    """Which of them must yield; `None` if one brakes before the other."""
    sets_off: bool = False
    """Whether it sets off at a red light."""
    known_at_s: float | None = None
    """When it first knew of the crash."""
    _before: Cars | None = None

    def receive_cars(self, cars: Cars) -> None:
        """Take the true states of all cars, in order of time."""
        there = [cars.index(name) for name in self.pair]
        both = cars.only(np.array([at for at in there if at is not None], dtype=np.intp))
        before, self._before = self._before, both
        if self.known_at_s is None and before is not None and len(both) == len(before) == 2:
            turns_rad_s = (both.heading_rad - before.heading_rad) / (both.at_s - before.at_s)
            if self._knows(both, turns_rad_s):
                self.known_at_s = both.at_s

    def _knows(self, both: Cars, turns_rad_s: Array) -> bool:
        after_s = np.arange(0.0, _HORIZON_S, _EVERY_S).tolist()
        expected = [_expected(both, turns_rad_s, each_s) for each_s in after_s]
        for sooner, later in pairwise(expected):
            crash = first_crash(sooner, later)
            if crash is not None:
                return self._cannot_stop(both, crash.at_s - both.at_s)
        return False

    def _cannot_stop(self, both: Cars, within_s: float) -> bool:
        """Whether who must yield can no longer stop on the way that is left to the contact."""
        if self.yields is None:
            return True
        at = both.names.index(self.yields)
        speed_m_s = float(both.speed_m_s[at])
        if self.sets_off:
            return speed_m_s > STANDS_M_S
        way_m = float(_ways_m(both, within_s)[at])
        return speed_m_s**2 > 2.0 * BRAKING_M_S2 * way_m


def _ways_m(cars: Cars, after_s: float) -> Array:
    """How far each car drives if its speed goes on changing as it does, (n,)."""
    braking = cars.acceleration_m_s2 < 0.0
    stops_s = np.full(len(cars), np.inf)
    stops_s[braking] = -cars.speed_m_s[braking] / cars.acceleration_m_s2[braking]
    drives_s = np.minimum(after_s, stops_s)
    ways_m: Array = (cars.speed_m_s + cars.acceleration_m_s2 * drives_s / 2.0) * drives_s
    return ways_m


def _expected(cars: Cars, turns_rad_s: Array, after_s: float) -> Cars:
    """The cars after some time, each on the circle on which it drives now."""
    ways_m = _ways_m(cars, after_s)
    turned_rad = turns_rad_s * ways_m / np.maximum(cars.speed_m_s, STANDS_M_S)
    chord_m = ways_m * np.sinc(turned_rad / (2.0 * np.pi))
    along_rad = cars.heading_rad + turned_rad / 2.0
    moved_m = chord_m[:, None] * np.stack([np.cos(along_rad), np.sin(along_rad)], axis=1)
    return replace(
        cars,
        at_s=cars.at_s + after_s,
        middle_m=cars.middle_m + moved_m,
        heading_rad=cars.heading_rad + turned_rad,
    )
