"""Where the cars of a run truly were, and which of them a car means by what it says of others.

A car tells positions in a frame of its own, itself among them. What it tells is compared as seen
from itself, so that the error of its own position counts.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from onboard.risk.trajectory import Array
from sim_rig.run_log.run_log import Record, RunLog

MEANT_WITHIN_M = 6.0
"""A car told of farther than this from every true one is none of them."""
TOLD_WITHIN_S = 1.1
"""Of an alarm, the cars are told of by name; a little more than once a second."""


@dataclass(frozen=True, slots=True)
class Known:
    """One car as another one has told it."""

    at_s: float
    name: str
    source: str
    meant: str | None
    """The true car that is nearest, the teller itself not excepted."""
    off_m: float
    """How far it is from there."""


def perceived_objects(
    log: RunLog, car: str, from_s: float, until_s: float
) -> Iterator[list[Known]]:
    """What `car` tells of all others, one list for each time that it does."""
    tellings: dict[float, list[Record]] = {}
    for record in log.of(car, "perceived_object", from_s, until_s):
        tellings.setdefault(record["stamp_s"], []).append(record)
    for records in tellings.values():
        own = next((each for each in records if each["source"] == "host"), None)
        if own is not None:
            yield [_known(log, car, own, each) for each in records if each is not own]


def meant_by(log: RunLog, car: str, name: str, at_s: float) -> Known | None:
    """The car that `car` calls `name` around `at_s`."""
    tellings = perceived_objects(log, car, at_s - TOLD_WITHIN_S, at_s + TOLD_WITHIN_S)
    named = [known for telling in tellings for known in telling if known.name == name]
    return min(named, key=lambda known: abs(known.at_s - at_s), default=None)


def touch_s(log: RunLog, car: str, other: str) -> float | None:
    """When two cars first touch, to a tenth of a second; `None` if they never do."""
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


def _known(log: RunLog, car: str, own: Record, record: Record) -> Known:
    east_m, north_m = (record["state"][axis] - own["state"][axis] for axis in (0, 1))
    truth = _true_places(log, log.at_s(record))
    here = truth[car]
    off_m = {
        name: math.hypot(x - here[0] - east_m, y - here[1] - north_m)
        for name, (x, y) in truth.items()
    }
    nearest = min(off_m, key=off_m.__getitem__)
    meant = nearest if off_m[nearest] <= MEANT_WITHIN_M else None
    return Known(log.at_s(record), record["name"], record["source"], meant, off_m[nearest])


def _true_places(log: RunLog, at_s: float) -> dict[str, tuple[float, float]]:
    """Where every car is at `at_s`, straight on from the state before."""
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
