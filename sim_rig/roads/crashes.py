"""Detection of the first contact of cars, as oriented boxes, between two steps.

Within a step, position and heading change linearly. The distance of two boxes is at least the
largest gap along their four side directions, and the boxes are disjoint exactly if that gap is
positive (separating axes). The speed of all points has a bound; so time can advance by gap divided
by bound without passing the first contact (conservative advancement). Time advances by at least
`_LEAST_JUMP` of the step: a contact may be found that much late, and a shorter one is missed.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from sim_rig.roads.cars import Array, Cars

_TOUCH_M = 1e-6
_LEAST_JUMP = 1e-5


@dataclass(frozen=True, slots=True)
class Crash:
    """The first contact of two cars."""

    at_s: float
    names: tuple[str, str]
    speed_m_s: float
    """Relative speed of the two cars."""
    angle_rad: float
    """Angle between their headings, from 0 to pi; near 0 in a rear-end crash."""


def boxes_overlap(cars: Cars) -> list[tuple[int, int]]:
    """Index pairs of overlapping cars, the lower index first."""
    return [(i, j) for i, j in _near(cars, np.zeros(len(cars))) if _gap_m(cars, i, j) <= 0.0]


def first_crash(
    before: Cars, after: Cars, counts: Callable[[str, str], bool] | None = None
) -> Crash | None:
    """Return the first contact in a step; `None` if there is none.

    Args:
        before: cars at the start of the step.
        after: cars at its end; only cars present at both times are checked.
        counts: whether contacts of two cars, by name, count; all do by default.
    """
    common = [name for name in before.names if name in set(after.names)]
    begin, end = _only(before, common), _only(after, common)
    moved_m = np.hypot(*(end.middle_m - begin.middle_m).T)
    first: Crash | None = None
    for i, j in _near(begin, moved_m):
        pair = (common[i], common[j])
        if counts is not None and not counts(*pair):
            continue
        share = _first_touch(begin, end, i, j)
        if share is not None:
            at_s = before.at_s + share * (after.at_s - before.at_s)
            if first is None or at_s < first.at_s:
                velocity = end.velocity_m_s
                speed_m_s = float(np.hypot(*(velocity[i] - velocity[j])))
                angle_rad = angle_between(end.heading_rad[i], end.heading_rad[j])
                first = Crash(at_s, pair, speed_m_s, angle_rad)
    return first


def angle_between(heading_rad: float, other_rad: float) -> float:
    """Angle between two headings, from 0 to pi."""
    return abs(math.remainder(float(heading_rad) - float(other_rad), math.tau))


def _only(cars: Cars, names: list[str]) -> Cars:
    where = {name: i for i, name in enumerate(cars.names)}
    return cars.only(np.array([where[name] for name in names], dtype=np.intp))


def _near(cars: Cars, moved_m: Array) -> list[tuple[int, int]]:
    """Index pairs whose bounding circles touch within the step."""
    reach = np.hypot(cars.length_m, cars.width_m) / 2.0 + moved_m
    east_m, north_m = (line[:, None] - line for line in cars.middle_m.T)
    near = east_m * east_m + north_m * north_m <= (reach[:, None] + reach) ** 2
    return [(i, j) for i, j in np.argwhere(near).tolist() if i < j]


def _gap_m(cars: Cars, i: int, j: int) -> float:
    return _widest_gap_m(
        cars.middle_m[j] - cars.middle_m[i],
        (float(cars.heading_rad[i]), float(cars.heading_rad[j])),
        _halves(cars, i),
        _halves(cars, j),
    )


def _halves(cars: Cars, i: int) -> Array:
    return np.array([cars.length_m[i], cars.width_m[i]]) / 2.0


def _first_touch(begin: Cars, end: Cars, i: int, j: int) -> float | None:
    """Time of the first contact as a share of the step; `None` without contact."""
    halves, halves_other = _halves(begin, i), _halves(begin, j)
    apart, apart_end = (cars.middle_m[j] - cars.middle_m[i] for cars in (begin, end))
    headings = begin.heading_rad[[i, j]]
    turn = (end.heading_rad[[i, j]] - headings + np.pi) % (2.0 * np.pi) - np.pi
    corner = np.array([np.hypot(*halves), np.hypot(*halves_other)])
    fastest = float(np.hypot(*(apart_end - apart)) + 2.0 * np.abs(turn) @ corner) + 1e-9
    # Side directions rotate too, hence twice the corners: the bound is on the change of the gap.
    fastest += float(np.abs(turn).max() * max(np.hypot(*apart), np.hypot(*apart_end)))
    share = 0.0
    while share <= 1.0:
        now = headings + share * turn
        gap_m = _widest_gap_m(
            apart + share * (apart_end - apart),
            (float(now[0]), float(now[1])),
            halves,
            halves_other,
        )
        if gap_m <= _TOUCH_M:
            return share
        share += max(gap_m / fastest, _LEAST_JUMP)
    return None


def _widest_gap_m(
    apart: Array, headings: tuple[float, float], halves: Array, halves_other: Array
) -> float:
    """Largest gap along the side directions of both boxes; negative if they overlap on all."""
    sides = []
    for heading in headings:
        cosine, sine = np.cos(heading), np.sin(heading)
        sides.append(np.array([[cosine, sine], [-sine, cosine]]))
    mine, others = sides
    gaps = [
        np.abs(axes @ apart)
        - np.abs(axes @ mine.T) @ halves
        - np.abs(axes @ others.T) @ halves_other
        for axes in (mine, others)
    ]
    return float(np.max(gaps))
