"""Who runs into whom: the first touch of oriented boxes, found between the steps.

Between two moments a car's middle and heading change evenly. Two boxes are apart by at least the
widest gap on any of their four side directions, and are disjoint exactly if that is positive
(separating axes). No point of them moves faster than a bound; so time can jump by gap over bound
and never past the first touch (conservative advancement). Where that would be less than
`_LEAST_JUMP` of the step it is that much: a touch may be found so much too late, and one that is
over sooner is none.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from sim_rig.roads.cars import Array, Cars

_TOUCH_M = 1e-6
_LEAST_JUMP = 1e-5


@dataclass(frozen=True, slots=True)
class Crash:
    """The first touch of two cars."""

    at_s: float
    names: tuple[str, str]
    speed_m_s: float
    """Of one relative to the other."""


def boxes_overlap(cars: Cars) -> list[tuple[int, int]]:
    """Pairs that overlap at one moment, the lower index first."""
    return [(i, j) for i, j in _near(cars, np.zeros(len(cars))) if _gap_m(cars, i, j) <= 0.0]


def first_crash(
    before: Cars, after: Cars, counts: Callable[[str, str], bool] | None = None
) -> Crash | None:
    """The first touch from one moment to the next of any two cars that are there at both.

    Pairs for which `counts` is false pass through each other.
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
                first = Crash(at_s, pair, float(np.hypot(*(velocity[i] - velocity[j]))))
    return first


def _only(cars: Cars, names: list[str]) -> Cars:
    where = {name: i for i, name in enumerate(cars.names)}
    return cars.only(np.array([where[name] for name in names], dtype=np.intp))


def _near(cars: Cars, moved_m: Array) -> list[tuple[int, int]]:
    """Pairs whose surrounding circles come close."""
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
    """When in the step the two touch, 0 to 1; `None` if they do not."""
    halves, halves_other = _halves(begin, i), _halves(begin, j)
    apart, apart_end = (cars.middle_m[j] - cars.middle_m[i] for cars in (begin, end))
    headings = begin.heading_rad[[i, j]]
    turn = (end.heading_rad[[i, j]] - headings + np.pi) % (2.0 * np.pi) - np.pi
    corner = np.array([np.hypot(*halves), np.hypot(*halves_other)])
    fastest = float(np.hypot(*(apart_end - apart)) + 2.0 * np.abs(turn) @ corner) + 1e-9
    # Side directions turn as well, hence twice the corners; the bound is on the gap's change.
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
    """The widest gap on a side direction of either box; negative if they overlap on all four."""
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
