"""Cars whose paths cross or join: who comes later waits in front of the place that both use."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sim_rig.roads.cars import Array
from sim_rig.roads.paced_drive import EVERY_M, PacedDrive

AHEAD_M = 60.0
"""Places this far ahead are watched."""
_MARGIN_M = 0.4
"""Safety margin between cars that pass each other."""
_APART_S = 1.0
"""The one enters at least this long after the other has left: the last gap of a nuisance."""


@dataclass(frozen=True, slots=True)
class _Use:
    """What one car does at a place that two use."""

    gap_m: float
    """From its front bumper to the place; negative once it has entered."""
    enters_s: float
    """From now, as its recording goes on."""
    leaves_s: float


@dataclass(frozen=True, slots=True)
class PlacesAhead:
    """The path of a car from its rear bumper on, every `EVERY_M`."""

    car: PacedDrive
    middle_m: Array
    """(n, 2)"""
    heading_rad: Array
    """(n,)"""

    @property
    def box_m(self) -> Array:
        """West, south, east and north end (4,) of what the car drives over."""
        half_m = self.car.drive.width_m / 2.0 + _MARGIN_M
        low_m, high_m = self.middle_m.min(axis=0), self.middle_m.max(axis=0)
        return np.concatenate([low_m - half_m, high_m + half_m])


def places_ahead(car: PacedDrive) -> PlacesAhead:
    """Return the next `AHEAD_M` of a car's path."""
    at = max(math.floor((car.way_m - car.drive.length_m / 2.0) / EVERY_M), 0)
    until = at + math.ceil((AHEAD_M + car.drive.length_m) / EVERY_M)
    return PlacesAhead(car, car.middle_m[at:until], car.heading_rad[at:until])


def stops_m(cars: Sequence[PacedDrive], same_way: float) -> Array:
    """How far each car (n,) may drive from its front bumper because it gives way; else infinite.

    Args:
        cars: all cars.
        same_way: cosine of the greatest angle between paths that join.
    """
    may_drive_m = np.full(len(cars), np.inf)
    ahead = [places_ahead(car) for car in cars]
    boxes_m = np.array([each.box_m for each in ahead]).reshape(-1, 4)
    low_m, high_m = boxes_m[:, None, :2], boxes_m[None, :, 2:]
    meet = (low_m <= high_m).all(axis=2)
    for one, other in np.argwhere(np.triu(meet & meet.T, 1)).tolist():
        both = [one, other]
        may_drive_m[both] = np.minimum(
            may_drive_m[both], _gives_way_m(ahead[one], ahead[other], same_way)
        )
    return may_drive_m


def _gives_way_m(one: PlacesAhead, other: PlacesAhead, same_way: float) -> tuple[float, float]:
    """How far each of two cars may drive because it gives way to the other.

    Where two paths join, who has entered is followed, and nobody gives way to it any more.
    """
    reach_m = (one.car.drive.width_m + other.car.drive.width_m) / 2.0 + _MARGIN_M
    apart_m = one.middle_m[:, None] - other.middle_m[None]
    touch = np.einsum("ijk,ijk->ij", apart_m, apart_m) < reach_m * reach_m
    nobody = np.inf, np.inf
    if not touch.any():
        return nobody
    rows = _first_run(touch.any(axis=1))
    columns = _first_run(touch[rows].any(axis=0))
    turn_rad = one.heading_rad[rows.start] - other.heading_rad[columns.start]
    joins = math.cos(turn_rad) > same_way
    mine, theirs = _use(one.car, rows, joins=joins), _use(other.car, columns, joins=joins)
    has_entered = [use.gap_m <= 0.0 for use in (mine, theirs)]
    if all(has_entered) or (joins and any(has_entered)):
        return nobody
    goes_first = (has_entered[0], -mine.enters_s, one.car.drive.name) > (
        has_entered[1],
        -theirs.enters_s,
        other.car.drive.name,
    )
    first, second = (mine, theirs) if goes_first else (theirs, mine)
    if second.enters_s > first.leaves_s + _APART_S:
        return nobody
    return (np.inf, second.gap_m) if goes_first else (second.gap_m, np.inf)


def _first_run(which: Sequence[bool] | Array) -> slice:
    """The first run of true values."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], np.asarray(which, np.int8), [0]])))
    return slice(int(edges[0]), int(edges[1]))


def _use(car: PacedDrive, place: slice, *, joins: bool) -> _Use:
    """What a car does at a place, by indices of its `PlacesAhead`."""
    length_m, rear_m = car.drive.length_m, car.way_m - car.drive.length_m / 2.0
    begin_m, end_m = place.start * EVERY_M, place.stop * EVERY_M
    if joins:  # what follows is driven one behind the other
        end_m = begin_m
    middle_m = rear_m + length_m / 2.0
    ways_m = np.array([middle_m + begin_m - length_m, middle_m + end_m])
    enters_s, leaves_s = car.reaches_in_s(ways_m).tolist()
    return _Use(begin_m - length_m, enters_s, leaves_s)
