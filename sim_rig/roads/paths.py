"""The way that a drive takes, whatever its speed, and what stands on it."""

import numpy as np
from numpy.typing import NDArray

from sim_rig.roads.cars import Array, Cars
from sim_rig.roads.recording import STEP_S, Drive

LOOK_M = 70.0
"""How far ahead a driver looks."""
_EVERY_M = 1.0
_SHARE_OF_WIDTH = 0.9
"""Of the own width, what must be free."""


class DrivePath:
    """Places of the middle of a car along its way, in metres from the beginning of the drive."""

    def __init__(self, drive: Drive) -> None:
        """Take the way of `drive`; beyond its end the way goes straight on."""
        self.drive = drive
        moved = np.hypot(*np.diff(drive.middle_m, axis=0).T)
        # Those that stand move by a hair, so that every place has one moment.
        self._ways = np.concatenate([[0.0], np.cumsum(np.maximum(moved, 1e-9))])
        self._steps = np.arange(len(drive), dtype=np.float64)
        self.length_m = float(self._ways[-1])

    def way_m(self, at_s: float) -> float:
        """How far the drive has come by then."""
        return float(np.interp(at_s / STEP_S - self.drive.first, self._steps, self._ways))

    def places(self, ways_m: Array) -> tuple[Array, Array]:
        """Middle (n, 2) and heading (n) at ways (n)."""
        steps = np.interp(ways_m, self._ways, self._steps)
        heading = np.interp(steps, self._steps, self.drive.heading_rad)
        x, y = (np.interp(steps, self._steps, line) for line in self.drive.middle_m.T)
        beyond = np.maximum(ways_m - self.length_m, 0.0)
        middle = np.stack([x + beyond * np.cos(heading), y + beyond * np.sin(heading)], axis=1)
        return middle, heading

    def speed_m_s(self, way_m: float) -> float:
        """How fast the drive was there."""
        step = np.interp(way_m, self._ways, self._steps)
        return float(np.interp(step, self._steps, self.drive.speed_m_s))


def blocked_at_m(
    path: DrivePath, way_m: float, cars: Cars, own: int, others: NDArray[np.intp]
) -> Array:
    """How far from the own bumper each of `others` stands on the way ahead; infinite if not.

    `own` and `others` are indices in `cars`.
    """
    if not len(others):
        return np.zeros(0)
    ahead_m = np.arange(0.0, LOOK_M, _EVERY_M)
    middle, _ = path.places(way_m + cars.length_m[own] / 2.0 + ahead_m)
    cosine, sine = np.cos(cars.heading_rad[others]), np.sin(cars.heading_rad[others])
    apart = middle[None] - cars.middle_m[others][:, None]
    along = apart[..., 0] * cosine[:, None] + apart[..., 1] * sine[:, None]
    aside = apart[..., 1] * cosine[:, None] - apart[..., 0] * sine[:, None]
    room = _SHARE_OF_WIDTH * cars.width_m[own] / 2.0
    inside = (np.abs(along) <= cars.length_m[others][:, None] / 2.0 + _EVERY_M / 2.0) & (
        np.abs(aside) <= cars.width_m[others][:, None] / 2.0 + room
    )
    gaps: Array = np.where(inside.any(axis=1), ahead_m[inside.argmax(axis=1)], np.inf)
    return gaps
