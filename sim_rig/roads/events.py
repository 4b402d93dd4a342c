"""Dangerous events in recorded traffic: sudden braking, and running a red light.

Events are where a collision is possible: a car brakes that is followed closely; the first car at a
red light does not stop, or departs, where others cross. In a recording without lights, the
trajectory of a car that passed a crossing before or after another one is shifted in time.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from enum import StrEnum
from functools import cache
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from onboard.errors import UserError
from sim_rig.roads.cars import Cars
from sim_rig.roads.crashes import angle_between
from sim_rig.roads.paths import DrivePath, blocked_at_m
from sim_rig.roads.recording import STEP_S, RecordedTraffic, Trajectory

BRAKING_M_S2 = (4.0, 8.0)
_LEAST_SPEED_M_S = 7.0
_CLOSE_S = 2.5
"""Largest headway of a close follower."""
_NEAR_M = 60.0
"""Its largest distance."""
_STAYS_S = 6.0
"""Both cars are present for this long after a sudden braking."""
_CROSSES_SINE = 0.5
"""Sine of the least angle at which paths cross: 30 degrees."""
_FIRST_IN_LINE_M = 12.0
"""The first car in a queue has no lead within this distance."""
_BRAKES_BEFORE_S = 8.0
"""Braking for a stop starts at most this long before it."""
_STRAIGHT_RAD = 0.3
_BEFORE_STEPS = 70
"""Both cars are present for at least this many steps before they meet."""
_COARSE = 5
"""Paths are first compared at every fifth sample."""
_COARSE_M = 6.0
"""Above half of what two cars move between these; paths that cross come as near as this."""
_EVERY_S = 2.0
"""Interval at which a waiting car may set off, and any car may brake."""
SETTING_OFF_M_S2, SETTING_OFF_TO_M_S = 2.5, 13.0
"""Acceleration and final speed of a car that departs at a red light."""
_SOONEST_S = 3.0
"""A departure at red is at least this long before the recorded one."""
_AHEAD_S = 7.0
_TIMING_S = 1.0
"""Uniform spread of the timing of a red-light runner."""
_OUT_OF_TURN_S = 4.0
"""A shifted car is checked from this long before the meeting."""
_ROOM_M = 7.0
"""Least distance, middle to middle, of a shifted car to others of its direction."""
_TIMINGS = 3
"""Timings that are drawn for each crossing of two paths."""


Samples = NDArray[np.intp]
"""Indices of samples of a trajectory."""


class TrafficEventKind(StrEnum):
    """Kind of an event."""

    SUDDEN_BRAKE = "sudden_brake"
    RED_LIGHT = "red_light"


@dataclass(frozen=True, slots=True)
class TrafficEvent:
    """A dangerous event of one car."""

    kind: TrafficEventKind
    car: int
    """Index of its trajectory in the recording."""
    at_s: float
    deceleration_m_s2: float = 0.0
    """Deceleration of a sudden braking."""
    sets_off: bool = False
    """Whether a red-light runner departs from standing."""
    sooner_s: float = 0.0
    """Shift in time of the whole trajectory, for red-light runners without lights."""


@dataclass(frozen=True, slots=True)
class EventSituation:
    """A possible event, and the car that its car meets if nobody reacts."""

    event: TrafficEvent
    pair: tuple[str, str]
    """Both cars by name, in order."""
    angle_rad: float
    """Angle between their headings, from 0 to pi."""
    closing_speed_m_s: float
    """Their relative speed; behind a car that brakes, the speed of its follower."""


class NoEventError(UserError):
    """The recording has no situation for an event of this kind."""


class TrafficEvents:
    """Possible events in one recording."""

    def __init__(self, recording: RecordedTraffic, *, has_lights: bool) -> None:
        """Without lights, red-light runners are trajectories shifted in time."""
        self._recording = recording
        self._has_lights = has_lights

    def situations(self, kind: TrafficEventKind, rng: np.random.Generator) -> list[EventSituation]:
        """Find all possible events of one kind, in the order of the recording.

        Args:
            kind: kind of the events.
            rng: source of decelerations and timings.

        Raises:
            NoEventError: no car is followed closely, or no paths cross.
        """
        if kind is TrafficEventKind.SUDDEN_BRAKE:
            return _sudden_brakes(self._recording, rng)
        found = _red_lights(self._recording) if self._has_lights else []
        return found or _out_of_turn(self._recording, rng)


def _sudden_brakes(recording: RecordedTraffic, rng: np.random.Generator) -> list[EventSituation]:
    found = []
    for at_s in np.arange(2.0, recording.end_s - 8.0, _EVERY_S).round(1).tolist():
        cars, there = recording.cars_at(at_s), recording.there(at_s)
        for own, ahead in _following(recording, cars, there):
            deceleration = rng.uniform(*BRAKING_M_S2)
            event = TrafficEvent(TrafficEventKind.SUDDEN_BRAKE, there[ahead], at_s, deceleration)
            names = cars.names[own], cars.names[ahead]
            headings = float(cars.heading_rad[own]), float(cars.heading_rad[ahead])
            found.append(_situation(event, names, headings, (float(cars.speed_m_s[own]), 0.0)))
    if not found:
        raise NoEventError("no car in this recording is followed closely")
    return found


def _following(
    recording: RecordedTraffic, cars: Cars, there: list[int]
) -> Iterator[tuple[int, int]]:
    """Yield close followers and the cars ahead of them, as indices in `cars`."""
    stay = [recording.drives[i].last * STEP_S >= cars.at_s + _STAYS_S for i in there]
    drives = np.array(stay, dtype=bool) & (cars.speed_m_s >= _LEAST_SPEED_M_S)
    for own in np.flatnonzero(drives).tolist():
        near = np.hypot(*(cars.middle_m - cars.middle_m[own]).T) < _NEAR_M
        near[own] = False
        others = np.flatnonzero(near)
        if not len(others):
            continue
        path = DrivePath(recording.drives[there[own]])
        gaps_m = blocked_at_m(path, path.way_m(cars.at_s), cars, own, others)
        ahead = int(others[gaps_m.argmin()])
        if drives[ahead] and 1.0 < gaps_m.min() < _CLOSE_S * cars.speed_m_s[own]:
            yield own, ahead


def _situation(
    event: TrafficEvent,
    names: tuple[str, str],
    headings_rad: tuple[float, float],
    speeds_m_s: tuple[float, float],
) -> EventSituation:
    """Describe the meeting of two cars by their names, headings and speeds."""
    angle_rad = angle_between(*headings_rad)
    one, other = speeds_m_s
    closing2 = one**2 + other**2 - 2.0 * one * other * math.cos(angle_rad)
    first, second = sorted(names)
    return EventSituation(event, (first, second), angle_rad, math.sqrt(max(closing2, 0.0)))


def _red_lights(recording: RecordedTraffic) -> list[EventSituation]:
    cars_at = cache(recording.cars_at)
    events = (
        TrafficEvent(TrafficEventKind.RED_LIGHT, car, at_s, sets_off=sets_off)
        for car, at_s, sets_off in _at_red(recording)
    )
    found = (_met_at_red(recording, event, cars_at) for event in events)
    return [situation for situation in found if situation is not None]


def _out_of_turn(recording: RecordedTraffic, rng: np.random.Generator) -> list[EventSituation]:
    ways, found = _ways_crossed(recording), []
    for (car, mine), (other, others) in ways:
        drive, crossed = recording.drives[car], recording.drives[other]
        later_s = (drive.first + mine - crossed.first - others) * STEP_S
        for sooner_s in (later_s + rng.uniform(-_TIMING_S, _TIMING_S, _TIMINGS)).tolist():
            begins_s = round((drive.first + mine) * STEP_S - sooner_s - _OUT_OF_TURN_S, 1)
            event = TrafficEvent(
                TrafficEventKind.RED_LIGHT, car, begins_s, sooner_s=float(sooner_s)
            )
            if _has_room(recording, event):
                passings = (drive, mine), (crossed, others)
                (a_rad, b_rad), (a_m_s, b_m_s) = (
                    [float(d.heading_rad[at]) for d, at in passings],
                    [float(d.speed_m_s[at]) for d, at in passings],
                )
                names = drive.name, crossed.name
                found.append(_situation(event, names, (a_rad, b_rad), (a_m_s, b_m_s)))
    if ways and not found:
        raise NoEventError(
            "paths in this recording cross, but every shifted car would be within"
            f" {_ROOM_M:g} m of another one of its direction"
        )
    if not found:
        raise NoEventError("no paths in this recording cross")
    return found


def _at_red(recording: RecordedTraffic) -> list[tuple[int, float, bool]]:
    """First cars at red: (car, time, departs), at braking onset, and each `_EVERY_S` of waiting."""
    found = []
    for number, drive in enumerate(recording.drives):
        for stop, go in _stands(drive):
            at_s = (drive.first + stop) * STEP_S
            if not _is_first(recording, number, at_s) or _turns(drive, go):
                continue
            from_step = max(stop - round(_BRAKES_BEFORE_S / STEP_S), 0)
            before = drive.speed_m_s[from_step : stop + 1]
            if before.max() > _LEAST_SPEED_M_S:
                onset = from_step + int(np.flatnonzero(before >= 0.97 * before.max())[-1])
                found.append((number, round((drive.first + onset) * STEP_S, 1), False))
            for step in range(stop + 5, go - round(_SOONEST_S / STEP_S), round(_EVERY_S / STEP_S)):
                found.append((number, round((drive.first + step) * STEP_S, 1), True))  # noqa: PERF401 (reads as the rest)
    return found


def _stands(drive: Trajectory) -> list[tuple[int, int]]:
    """Intervals of samples in which a car stands, if it drives on for a while after."""
    stands = np.concatenate([[False], drive.speed_m_s < 0.2, [False]])
    edges = np.flatnonzero(np.diff(stands.astype(np.int8)))
    both = [(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]
    return [(a, b) for a, b in both if b - a > 20 and b + round(5.0 / STEP_S) < len(drive)]


def _turns(drive: Trajectory, step: int) -> bool:
    later = min(step + round(8.0 / STEP_S), len(drive) - 1)
    return bool(abs(drive.heading_rad[later] - drive.heading_rad[step]) > _STRAIGHT_RAD)


def _met_at_red(
    recording: RecordedTraffic, event: TrafficEvent, cars_at: Callable[[float], Cars]
) -> EventSituation | None:
    """Find the first car that crosses the runner's path within `_TIMING_S` of it."""
    drive = recording.drives[event.car]
    path = DrivePath(drive)
    times_s = np.arange(0.0, _AHEAD_S, 0.2)
    begin_m = path.way_m(event.at_s)
    speeds_m_s = np.full(len(times_s), path.speed_m_s(begin_m))
    ways_m = speeds_m_s * times_s
    if event.sets_off:
        gathering_s = np.minimum(times_s, SETTING_OFF_TO_M_S / SETTING_OFF_M_S2)
        speeds_m_s = SETTING_OFF_M_S2 * gathering_s
        ways_m = speeds_m_s * gathering_s / 2.0 + SETTING_OFF_TO_M_S * (times_s - gathering_s)
    middle, heading = path.places(begin_m + ways_m)
    for late_s in (0.0, -_TIMING_S, _TIMING_S):
        for i, at_s in enumerate((event.at_s + times_s + late_s).round(1).tolist()):
            cars = cars_at(at_s)
            near = np.hypot(*(cars.middle_m - middle[i]).T) < 2.5
            crosses = np.abs(np.sin(cars.heading_rad - heading[i])) > _CROSSES_SINE
            if (near & crosses).any():
                hit = int((near & crosses).argmax())
                return _situation(
                    event,
                    (drive.name, cars.names[hit]),
                    (float(heading[i]), float(cars.heading_rad[hit])),
                    (float(speeds_m_s[i]), float(cars.speed_m_s[hit])),
                )
    return None


def _has_room(recording: RecordedTraffic, event: TrafficEvent) -> bool:
    """Whether a shifted car keeps its distance to cars of its direction.

    Rear-end crashes would be artefacts of the shift, not crashes at a crossing.
    """
    path = DrivePath(recording.drives[event.car])
    for at_s in event.at_s + np.arange(-1.6, _OUT_OF_TURN_S + 1.0, 0.2):
        middle, heading = path.places(np.array([path.way_m(at_s + event.sooner_s)]))
        cars = recording.cars_at(at_s).without(path.drive.name)
        near = np.hypot(*(cars.middle_m - middle).T) < _ROOM_M
        if (near & (np.cos(cars.heading_rad - heading) > math.cos(_STRAIGHT_RAD))).any():
            return False
    return True


def _is_first(recording: RecordedTraffic, number: int, at_s: float) -> bool:
    cars = recording.cars_at(at_s)
    own = recording.there(at_s).index(number)
    path = DrivePath(recording.drives[number])
    others = np.array([i for i in range(len(cars)) if i != own], dtype=np.intp)
    gaps = blocked_at_m(path, path.way_m(at_s), cars, own, others)
    return bool(gaps.min(initial=np.inf) > _FIRST_IN_LINE_M)


_Passing = tuple[int, int]
"""A car, and its sample at a crossing."""


def _ways_crossed(recording: RecordedTraffic) -> list[tuple[_Passing, _Passing]]:
    """Crossing paths of two cars in motion, in both orders."""
    moving = [np.flatnonzero(d.speed_m_s > _LEAST_SPEED_M_S)[::_COARSE] for d in recording.drives]
    found = []
    for (number, drive), (i, other) in combinations(enumerate(recording.drives), 2):
        met = _crossing(drive, other, moving[number], moving[i])
        # Both cars must be there for a while before.
        if met is not None and min(met) > _BEFORE_STEPS:
            mine, others = (number, met[0]), (i, met[1])
            found += [(mine, others), (others, mine)]
    return found


def _crossing(
    drive: Trajectory, other: Trajectory, some: Samples, others: Samples
) -> tuple[int, int] | None:
    """Samples of two paths at their crossing, within 2 m; `None` if they do not cross there.

    Args:
        drive: one path.
        other: the other path.
        some: (n,) samples of `drive`, `_COARSE` apart, near which they may cross.
        others: (k,) those of `other`.
    """
    if not len(some) or not len(others):
        return None
    mine_m, theirs_m = drive.middle_m[some], other.middle_m[others]
    low = np.maximum(mine_m.min(axis=0), theirs_m.min(axis=0)) - _COARSE_M
    high = np.minimum(mine_m.max(axis=0), theirs_m.max(axis=0)) + _COARSE_M
    some = some[((mine_m >= low) & (mine_m <= high)).all(axis=1)]
    others = others[((theirs_m >= low) & (theirs_m <= high)).all(axis=1)]
    if not len(some) or not len(others):
        return None
    i, j, apart_m = _nearest_across(drive, other, some, others)
    if apart_m > _COARSE_M:
        return None
    about = np.arange(-_COARSE, _COARSE + 1)
    some, others = (np.clip(at + about, 0, len(d) - 1) for at, d in ((i, drive), (j, other)))
    i, j, apart_m = _nearest_across(drive, other, some, others)
    return (i, j) if apart_m < 2.0 else None


def _nearest_across(
    drive: Trajectory, other: Trajectory, some: Samples, others: Samples
) -> tuple[int, int, float]:
    apart = np.hypot(
        *(drive.middle_m[some, None] - other.middle_m[None, others]).transpose(2, 0, 1)
    )
    turn = drive.heading_rad[some, None] - other.heading_rad[None, others]
    apart = np.where(np.abs(np.sin(turn)) > _CROSSES_SINE, apart, np.inf)
    i, j = np.unravel_index(apart.argmin(), apart.shape)
    return int(some[i]), int(others[j]), float(apart[i, j])
