"""A car that drives its recorded path in time, or later."""

import numpy as np

from sim_rig.roads.cars import Array
from sim_rig.roads.paths import DrivePath
from sim_rig.roads.recording import STEP_S, Trajectory
from sim_rig.roads.retimed import GAINING_M_S2, driven_along

EVERY_M = 1.0
"""Distance of the places of a path."""
_STANDS_M = 1e-4
"""Way in a step below which a car stands."""


class PacedDrive:
    """A car, and where it is in its recording."""

    def __init__(self, drive: Trajectory) -> None:
        """Start off the road, at the first step of `drive`."""
        self.drive = drive
        self.path = DrivePath(drive)
        self.middle_m, self.heading_rad = self.path.places(
            np.arange(0.0, self.path.length_m + drive.length_m / 2.0, EVERY_M)
        )
        """Middle (n, 2), m, and heading (n,), rad, of its path every `EVERY_M`."""
        self.is_on_road = False
        self.ways_m: list[float] = []
        """The way at each step since it entered."""
        self.speed_m_s = float(drive.speed_m_s[0])
        self._entered = drive.first
        self._at = 0.0
        """The step of its recording, counted from the first one."""
        self._ways_m = drive.ways_m()
        goes = np.flatnonzero(np.diff(self._ways_m) > _STANDS_M)
        after = np.searchsorted(goes, np.arange(len(drive)))
        self._goes_at = np.concatenate([goes, [len(drive) - 1]])[after]
        """The step from which on it moves next, for each step."""

    def is_due(self, step: int) -> bool:
        """Whether it is yet to enter."""
        return not self.is_on_road and not self.ways_m and self.drive.first <= step

    def enter(self, step: int) -> None:
        """Begin to drive."""
        self.is_on_road, self._entered = True, step
        self.ways_m.append(0.0)

    @property
    def way_m(self) -> float:
        """Distance from the start of its path."""
        return self.ways_m[-1] if self.ways_m else 0.0

    @property
    def place(self) -> tuple[Array, float]:
        """Middle (2,), m, and heading, rad."""
        heading_rad = _between(self.drive.heading_rad, self._at)
        return _between(self.drive.middle_m, self._at), float(heading_rad)

    def reaches_in_s(self, ways_m: Array) -> Array:
        """Times (n,) from now at which it is at distances (n,) of its path, if not held up."""
        steps = np.interp(ways_m, self._ways_m, np.arange(len(self._ways_m)))
        times_s: Array = (steps - self._at) * STEP_S
        return times_s

    def go_on(self, step: int, bound_m_s2: float) -> None:
        """Drive to the next step as recorded, or with this acceleration if that is less."""
        late = step - self.drive.first - self._at
        at = self._at + 1.0
        if late > 0.0:
            bound_m_s2 = min(bound_m_s2, GAINING_M_S2)
            at = max(at, min(self._at + 1.0 + late, float(self._goes_at[int(self._at)])))
        way_m = float(_between(self._ways_m, at))
        most_m = self.way_m + max(self.speed_m_s + bound_m_s2 * STEP_S, 0.0) * STEP_S
        if way_m > most_m + _STANDS_M:
            way_m = most_m
            at = float(np.interp(way_m, self._ways_m, np.arange(len(self._ways_m))))
        self.is_on_road = at <= len(self.drive) - 1
        if self.is_on_road:
            self.speed_m_s = (way_m - self.way_m) / STEP_S
            self._at = at
            self.ways_m.append(way_m)

    def driven(self) -> Trajectory:
        """Its drive, which is the recorded one if nothing held it up."""
        if len(self.ways_m) == len(self.drive) and self._entered == self.drive.first:
            return self.drive
        return driven_along(self.path, np.array(self.ways_m), self._entered)


def _between(samples: Array, at: float) -> Array:
    """The value at a step that need not be whole; the last one from there on."""
    low = min(int(at), len(samples) - 1)
    high = min(low + 1, len(samples) - 1)
    value: Array = samples[low] + (at - int(at)) * (samples[high] - samples[low])
    return value
