"""Compares the perceived objects of a run with the true positions of the cars.

Each car has a local frame of its own, in which it also reports itself. Positions are compared
relative to the host, so that the host's own position error counts.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from onboard.kinematics.arrays import Array
from sim_rig.run_log.run_log import Record, RunLog

MATCH_WITHIN_M = 6.0
"""An object farther than this from every true position matches no car."""
MATCH_WITHIN_S = 1.1
"""Object lists this close to an alarm are searched for its object; lists are traced each second."""


@dataclass(frozen=True, slots=True)
class MatchedObject:
    """One perceived object, with the car that it is."""

    at_s: float
    name: str
    source: str
    true_car: str | None
    """The nearest car, which may be the host; `None` if none is near."""
    error_m: float
    """Distance from the true position of the nearest car."""


def perceived_objects(
    log: RunLog, car: str, from_s: float, until_s: float
) -> Iterator[list[MatchedObject]]:
    """Yield each traced list of perceived objects, without the host.

    Args:
        log: the run log.
        car: name of the host.
        from_s: start of the interval since the start of the scenario, s.
        until_s: end of the interval, s.
    """
    snapshots: dict[float, list[Record]] = {}
    for record in log.of(car, "perceived_object", from_s, until_s):
        snapshots.setdefault(record["stamp_s"], []).append(record)
    for records in snapshots.values():
        own = next((each for each in records if each["source"] == "host"), None)
        if own is not None:
            yield [_match(log, car, own, each) for each in records if each is not own]


def match_object(log: RunLog, car: str, name: str, at_s: float) -> MatchedObject | None:
    """Return the perceived object of one name; `None` if it is in no list near `at_s`.

    Args:
        log: the run log.
        car: name of the host.
        name: name of the perceived object.
        at_s: time since the start of the scenario, s.
    """
    snapshots = perceived_objects(log, car, at_s - MATCH_WITHIN_S, at_s + MATCH_WITHIN_S)
    named = [matched for snapshot in snapshots for matched in snapshot if matched.name == name]
    return min(named, key=lambda matched: abs(matched.at_s - at_s), default=None)


def touch_s(log: RunLog, car: str, other: str) -> float | None:
    """Time of the first contact of two cars, s, to 0.1 s; `None` without contact.

    Args:
        log: the run log.
        car: name of one car.
        other: name of the other car.
    """
    states: dict[float, list[Record]] = {}
    for record in log.rig:
        if record["kind"] == "car_state" and record["car"] in (car, other):
            states.setdefault(record["stamp_s"], []).append(record)
    touching = (stamp_s for stamp_s, (one, two) in states.items() if overlap(one, two))
    first = next(touching, None)
    return None if first is None else first - log.start_s


def overlap(one: Record, other: Record) -> bool:
    """Whether two cars' rectangles have a point in common (separating axis theorem)."""
    if abs(one["elevation_m"] - other["elevation_m"]) > 2.0:
        return False
    boxes = [_corners(one), _corners(other)]
    for record in (one, other):
        sine, cosine = math.sin(record["heading_rad"]), math.cos(record["heading_rad"])
        for axis in ((sine, cosine), (cosine, -sine)):
            a, b = (box @ axis for box in boxes)
            if a.max() < b.min() or b.max() < a.min():
                return False
    return True


def _corners(record: Record) -> Array:
    sine, cosine = math.sin(record["heading_rad"]), math.cos(record["heading_rad"])
    along = np.array([sine, cosine]) * record["length_m"] / 2
    across = np.array([cosine, -sine]) * record["width_m"] / 2
    middle = np.array([record["x_m"], record["y_m"]])
    return np.array([middle + i * along + j * across for i in (-1, 1) for j in (-1, 1)])


def _match(log: RunLog, car: str, own: Record, record: Record) -> MatchedObject:
    east_m, north_m = (record["state"][axis] - own["state"][axis] for axis in (0, 1))
    truth = _true_places(log, log.at_s(record))
    here = truth[car]
    error_m = {
        name: math.hypot(x - here[0] - east_m, y - here[1] - north_m)
        for name, (x, y) in truth.items()
    }
    nearest = min(error_m, key=error_m.__getitem__)
    true_car = nearest if error_m[nearest] <= MATCH_WITHIN_M else None
    return MatchedObject(
        log.at_s(record), record["name"], record["source"], true_car, error_m[nearest]
    )


def _true_places(log: RunLog, at_s: float) -> dict[str, tuple[float, float]]:
    """Position of every car at `at_s`, at constant velocity since its last state."""
    places: dict[str, tuple[float, float]] = {}
    for record in log.rig:
        since_s = at_s - log.at_s(record)
        if record["kind"] == "car_state" and (since_s >= 0.0 or record["car"] not in places):
            way_m = record["speed_m_s"] * since_s
            places[record["car"]] = (
                record["x_m"] + way_m * math.sin(record["heading_rad"]),
                record["y_m"] + way_m * math.cos(record["heading_rad"]),
            )
    return places
