"""Dangerous events in recorded traffic: sudden braking, and running a red light.

Events are drawn where a collision is possible: a car brakes that is followed closely; the first car
at a red light does not stop, or departs, where others cross. In a recording without lights, the
trajectory of a car that passed a crossing before or after another one is shifted in time.
"""

import math
from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property

import numpy as np

from onboard.errors import UserError
from sim_rig.roads.paths import DrivePath, blocked_at_m
from sim_rig.roads.recording import STEP_S, RecordedTraffic, Trajectory

BRAKING_M_S2 = (4.0, 8.0)
_LEAST_SPEED_M_S = 7.0
_CLOSE_S = 2.5
"""Largest headway of a close follower."""
_FIRST_IN_LINE_M = 12.0
"""The first car in a queue has no car ahead within this distance."""
_BRAKES_BEFORE_S = 8.0
"""Braking for a stop starts at most this long before it."""
_STRAIGHT_RAD = 0.3
_MOST_MOVED_S = 60.0
"""Largest shift in time of a trajectory."""
_BEFORE_STEPS = 70
"""Both cars are present for at least this many steps before they meet."""
_COARSE = 5
"""Paths are first compared at every fifth sample."""
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
_MOST_DRAWS = 4000


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


class NoEventError(UserError):
    """The recording has no situation for an event of this kind."""


class TrafficEvents:
    """Possible events in one recording."""

    def __init__(self, recording: RecordedTraffic, *, has_lights: bool) -> None:
        """Without lights, red-light runners are trajectories shifted in time."""
        self._recording = recording
        self._has_lights = has_lights

    @cached_property
    def _red(self) -> list[tuple[bool, list[tuple[int, float]]]]:
        """Cars and times: of those that do not stop at red, and of those that set off (True)."""
        found = _at_red(self._recording) if self._has_lights else []
        both = [
            (sets_off, [(car, at_s) for car, at_s, sets in found if sets == sets_off])
            for sets_off in (False, True)
        ]
        return [(sets_off, some) for sets_off, some in both if some]

    @cached_property
    def _out_of_turn(self) -> list[tuple[int, float, float]]:
        return [] if self._has_lights else _ways_crossed(self._recording)

    def draw(self, kind: TrafficEventKind, rng: np.random.Generator) -> TrafficEvent:
        """Draw car and time of an event.

        Args:
            kind: kind of the event.
            rng: source of the choice.

        Raises:
            NoEventError: no car is followed closely, or no paths cross.
        """
        if kind is TrafficEventKind.SUDDEN_BRAKE:
            return _sudden_brake(self._recording, rng)
        for _ in range(_MOST_DRAWS if self._out_of_turn else 0):
            car, at_s, sooner_s = self._out_of_turn[rng.integers(len(self._out_of_turn))]
            sooner_s += rng.uniform(-_TIMING_S, _TIMING_S)
            begins_s = round(at_s - sooner_s - _OUT_OF_TURN_S, 1)
            event = TrafficEvent(kind, car, begins_s, sooner_s=sooner_s)
            if _has_room(self._recording, event):
                return event
        for _ in range(_MOST_DRAWS if self._red else 0):
            sets_off, some = self._red[rng.integers(len(self._red))]
            car, at_s = some[rng.integers(len(some))]
            event = TrafficEvent(kind, car, at_s, sets_off=sets_off)
            if _may_hit(self._recording, event):
                return event
        if self._out_of_turn:
            raise NoEventError(
                "paths in this recording cross, but every shifted car would be within"
                f" {_ROOM_M:g} m of another one of its direction"
            )
        raise NoEventError("no paths in this recording cross")


def _sudden_brake(recording: RecordedTraffic, rng: np.random.Generator) -> TrafficEvent:
    deceleration = rng.uniform(*BRAKING_M_S2)
    last_s = recording.end_s - 8.0
    for _ in range(_MOST_DRAWS if last_s > 2.0 else 0):
        at_s = round(float(rng.uniform(2.0, last_s)), 1)
        there = recording.there(at_s)
        if not there:
            continue
        car = there[rng.integers(len(there))]
        if _is_followed(recording, car, at_s):
            return TrafficEvent(TrafficEventKind.SUDDEN_BRAKE, car, at_s, deceleration)
    raise NoEventError("no car in this recording is followed closely")


def _is_followed(recording: RecordedTraffic, car: int, at_s: float) -> bool:
    cars, there = recording.cars_at(at_s), recording.there(at_s)
    ahead = there.index(car)
    if cars.speed_m_s[ahead] < _LEAST_SPEED_M_S or recording.drives[car].last * STEP_S < at_s + 6.0:
        return False
    near = np.hypot(*(cars.middle_m - cars.middle_m[ahead]).T) < 60.0
    for other in np.flatnonzero(near).tolist():
        if other == ahead or cars.speed_m_s[other] < _LEAST_SPEED_M_S:
            continue
        path = DrivePath(recording.drives[there[other]])
        where_m = path.way_m(at_s)
        gap_m = blocked_at_m(path, where_m, cars, other, np.array([ahead]))[0]
        if 1.0 < gap_m < _CLOSE_S * cars.speed_m_s[other]:
            return True
    return False


def _at_red(recording: RecordedTraffic) -> list[tuple[int, float, bool]]:
    """First cars at red: (car, time, departs), at braking onset and each 0.5 s of waiting."""
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
            for step in range(stop + 5, go - round(_SOONEST_S / STEP_S), 5):
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


def _may_hit(recording: RecordedTraffic, event: TrafficEvent) -> bool:
    """Whether another car crosses the runner's path within `_TIMING_S` of it."""
    path = DrivePath(recording.drives[event.car])
    times_s = np.arange(0.0, _AHEAD_S, 0.2)
    begin_m = path.way_m(event.at_s)
    if event.sets_off:
        gathering_s = np.minimum(times_s, SETTING_OFF_TO_M_S / SETTING_OFF_M_S2)
        ways_m = SETTING_OFF_M_S2 * gathering_s**2 / 2.0
        ways_m += SETTING_OFF_TO_M_S * (times_s - gathering_s)
    else:
        ways_m = path.speed_m_s(begin_m) * times_s
    middle, heading = path.places(begin_m + ways_m)
    for late_s in (-_TIMING_S, 0.0, _TIMING_S):
        for i, at_s in enumerate(event.at_s + times_s + late_s):
            cars = recording.cars_at(at_s)
            near = np.hypot(*(cars.middle_m - middle[i]).T) < 2.5
            if (near & (np.abs(np.sin(cars.heading_rad - heading[i])) > 0.5)).any():
                return True
    return False


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


def _ways_crossed(recording: RecordedTraffic) -> list[tuple[int, float, float]]:
    """Crossing paths: (car, time at the crossing, shift in time that makes it meet the other)."""
    found = []
    for number, drive in enumerate(recording.drives):
        for other in recording.drives:
            met = None if other is drive else _crossing(drive, other)
            if met is None:
                continue
            mine, others = met
            later_s = (drive.first + mine - other.first - others) * STEP_S
            if (
                abs(later_s) < _MOST_MOVED_S
                and min(drive.speed_m_s[mine], other.speed_m_s[others]) > _LEAST_SPEED_M_S
                and min(mine, others) > _BEFORE_STEPS
                # The shifted trajectory must start after the recording does.
                and drive.first * STEP_S > later_s + _TIMING_S
            ):
                found.append((number, (drive.first + mine) * STEP_S, later_s))
    return found


def _crossing(drive: Trajectory, other: Trajectory) -> tuple[int, int] | None:
    """Samples of two paths at their crossing, within 2 m; `None` if they do not cross."""
    low = np.maximum(drive.middle_m.min(axis=0), other.middle_m.min(axis=0)) - 2.0
    high = np.minimum(drive.middle_m.max(axis=0), other.middle_m.max(axis=0)) + 2.0
    if (low > high).any():
        return None
    every = slice(None, None, _COARSE)
    i, j, _ = _nearest_across(drive, other, every, every)
    i, j = i * _COARSE, j * _COARSE
    some = slice(max(i - _COARSE, 0), i + _COARSE)
    others = slice(max(j - _COARSE, 0), j + _COARSE)
    i, j, apart_m = _nearest_across(drive, other, some, others)
    return (some.start + i, others.start + j) if apart_m < 2.0 else None


def _nearest_across(
    drive: Trajectory, other: Trajectory, some: slice, others: slice
) -> tuple[int, int, float]:
    apart = np.hypot(
        *(drive.middle_m[some, None] - other.middle_m[None, others]).transpose(2, 0, 1)
    )
    turn = drive.heading_rad[some, None] - other.heading_rad[None, others]
    apart = np.where(np.abs(np.sin(turn)) > 0.5, apart, np.inf)
    i, j = np.unravel_index(apart.argmin(), apart.shape)
    return int(i), int(j), float(apart[i, j])
