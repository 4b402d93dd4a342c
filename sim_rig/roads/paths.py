"""Paths of recorded trajectories, independent of speed, and obstacles on them."""

import math

import numpy as np
from numpy.typing import NDArray

from sim_rig.roads.cars import Array, Cars
from sim_rig.roads.recording import STEP_S, Trajectory

LOOK_M = 70.0
"""Distance ahead within which obstacles are searched."""
_EVERY_M = 1.0
_STANDS_M_S = 0.2
_BEHIND_M = 0.5
"""A car this far beyond a recorded stop has passed it."""
_SAME_WAY = 0.87
"""Cosine of the least angle between paths of different directions, 30 degrees."""
_MARGIN_M = 0.3
"""Safety margin to crossing cars."""
_SHARE_OF_WIDTH = 0.9
"""Share of the car's width that must be free."""


class DrivePath:
    """Positions of a car's middle along its path, by distance from the start of its trajectory."""

    def __init__(self, drive: Trajectory) -> None:
        """Follow the path of `drive`, and straight on beyond its end."""
        self.drive = drive
        self._ways = drive.ways_m()
        self._steps = np.arange(len(drive), dtype=np.float64)
        self.length_m = float(self._ways[-1])
        stands = np.concatenate([[False], drive.speed_m_s < _STANDS_M_S, [False]])
        edges = np.flatnonzero(np.diff(stands.astype(np.int8)))
        self.waits = [
            (float(self._ways[begin]), (drive.first + end) * STEP_S)
            for begin, end in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True)
        ]
        """Place and end of each recorded stop, in m from the start and s of the recording."""

    def acceleration_m_s2(self, at_s: float) -> float:
        """Recorded acceleration at `at_s`, m/s^2; 0 after the end."""
        step = min(max(math.floor(at_s / STEP_S + 1e-6) - self.drive.first, 0), len(self.drive) - 1)
        after = self.drive.speed_m_s[step : step + 2]
        return float(after[-1] - after[0]) / STEP_S

    def waits_m(self, way_m: float, at_s: float) -> float:
        """Distance to the next recorded stop that lasts beyond `at_s`, m; infinite if none."""
        ahead = (stood_m - way_m for stood_m, until_s in self.waits if at_s < until_s)
        return min((gap_m for gap_m in ahead if gap_m > -_BEHIND_M), default=np.inf)

    def way_m(self, at_s: float) -> float:
        """Recorded distance from the start at `at_s`, m."""
        return float(np.interp(at_s / STEP_S - self.drive.first, self._steps, self._ways))

    def places(self, ways_m: Array) -> tuple[Array, Array]:
        """Middle (n, 2), m, and heading (n,), rad, at distances (n,), m."""
        steps = np.interp(ways_m, self._ways, self._steps)
        heading = np.interp(steps, self._steps, self.drive.heading_rad)
        x, y = (np.interp(steps, self._steps, line) for line in self.drive.middle_m.T)
        beyond = np.maximum(ways_m - self.length_m, 0.0)
        middle = np.stack([x + beyond * np.cos(heading), y + beyond * np.sin(heading)], axis=1)
        return middle, heading

    def speed_m_s(self, way_m: float) -> float:
        """Recorded speed at a distance from the start, m/s."""
        step = np.interp(way_m, self._ways, self._steps)
        return float(np.interp(step, self._steps, self.drive.speed_m_s))


def blocked_at_m(
    path: DrivePath, way_m: float, cars: Cars, own: int, others: NDArray[np.intp]
) -> Array:
    """Gap from the front bumper to each of `others` on the path ahead, m; infinite if off it.

    Args:
        path: path of the car `own`.
        way_m: its distance from the start of the path.
        cars: all cars.
        own: index of the car in `cars`.
        others: (n,) indices in `cars`.
    """
    if not len(others):
        return np.zeros(0)
    ahead_m = np.arange(0.0, LOOK_M, _EVERY_M)
    middle, heading = path.places(way_m + cars.length_m[own] / 2.0 + ahead_m)
    cosine, sine = np.cos(cars.heading_rad[others]), np.sin(cars.heading_rad[others])
    apart = middle[None] - cars.middle_m[others][:, None]
    along = apart[..., 0] * cosine[:, None] + apart[..., 1] * sine[:, None]
    aside = apart[..., 1] * cosine[:, None] - apart[..., 0] * sine[:, None]
    room = _SHARE_OF_WIDTH * cars.width_m[own] / 2.0
    turn = heading - cars.heading_rad[others][:, None]
    cosine, sine = np.abs(np.cos(turn)), np.abs(np.sin(turn))
    room_along, room_aside = (
        room * mine + _EVERY_M / 2.0 * other for mine, other in ((sine, cosine), (cosine, sine))
    )
    inside = (np.abs(along) <= cars.length_m[others][:, None] / 2.0 + room_along) & (
        np.abs(aside) <= cars.width_m[others][:, None] / 2.0 + room_aside
    )
    gaps: Array = np.where(inside.any(axis=1), ahead_m[inside.argmax(axis=1)], np.inf)
    return gaps


def would_collide(  # noqa: PLR0917 (as above, with predicted times)
    path: DrivePath, ways_m: Array, after_s: Array, cars: Cars, own: int, others: NDArray[np.intp]
) -> bool:
    """Whether the car `own` would touch any of `others` with another direction.

    Args:
        path: path of the car `own`.
        ways_m: (n,) its predicted distances from the start of the path.
        after_s: (n,) times of these, s from now; the others keep speed and course.
        cars: all cars now.
        own: index of the car in `cars`.
        others: indices in `cars`.
    """
    otherwise = np.cos(cars.heading_rad[others] - cars.heading_rad[own]) < _SAME_WAY
    others = others[otherwise & (cars.speed_m_s[others] > _STANDS_M_S)]
    middle, heading = path.places(ways_m)
    driven = cars.velocity_m_s[others][:, None] * after_s[:, None]
    apart = cars.middle_m[others][:, None] + driven - middle
    along = np.abs(apart[..., 0] * np.cos(heading) + apart[..., 1] * np.sin(heading))
    aside = np.abs(apart[..., 1] * np.cos(heading) - apart[..., 0] * np.sin(heading))
    turn = cars.heading_rad[others][:, None] - heading
    cosine, sine = np.abs(np.cos(turn)), np.abs(np.sin(turn))
    length, width = (size[others][:, None] / 2.0 for size in (cars.length_m, cars.width_m))
    touched = (along < cars.length_m[own] / 2.0 + length * cosine + width * sine + _MARGIN_M) & (
        aside < cars.width_m[own] / 2.0 + length * sine + width * cosine + _MARGIN_M
    )
    return bool(touched.any())
