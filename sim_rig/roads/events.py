"""What goes wrong: a car that brakes all of a sudden, or one that runs a red light.

Both are put into a recording, by seed, where somebody may be hit: a car brakes that is followed
closely; the first car at a red light does not stop, or drives off again, where others cross. In a
recording without lights, a car that passed before or after another comes out of its turn.
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
"""A follower at this headway or less is close."""
_FIRST_IN_LINE_M = 12.0
"""Nobody stands ahead so near."""
_BRAKES_BEFORE_S = 8.0
"""Before it stands, a car begins to brake no sooner."""
_STRAIGHT_RAD = 0.3
_MOST_MOVED_S = 60.0
"""By how much a drive may be moved in time to cross another's way out of turn."""
_BEFORE_STEPS = 70
"""Both cars are there so long before they meet."""
_COARSE = 5
"""Ways are first compared by every fifth sample."""
SETTING_OFF_M_S2, SETTING_OFF_TO_M_S = 2.5, 13.0
"""How who waits at a red light drives off, and up to which speed."""
_SOONEST_S = 3.0
"""Before he would have, at the latest."""
_AHEAD_S = 7.0
_TIMING_S = 1.0
"""A red-light runner does not aim: so much sooner or later, evenly."""
_OUT_OF_TURN_S = 4.0
"""Before he meets somebody, who is moved in time is looked at."""
_ROOM_M = 7.0
"""From middle to middle; who is moved in time has nobody so near who drives his way."""
_MOST_DRAWS = 4000


class TrafficEventKind(StrEnum):
    """Of an event."""

    SUDDEN_BRAKE = "sudden_brake"
    RED_LIGHT = "red_light"


@dataclass(frozen=True, slots=True)
class TrafficEvent:
    """One car does one thing."""

    kind: TrafficEventKind
    car: int
    """Number of its drive in the recording."""
    at_s: float
    deceleration_m_s2: float = 0.0
    """Of a sudden brake."""
    sets_off: bool = False
    """At a red light: from standing."""
    sooner_s: float = 0.0
    """The whole drive of the car, of one that runs a red light where nobody stops."""


class NoEventError(UserError):
    """Nothing of the kind can happen in this recording."""


class TrafficEvents:
    """What can go wrong in one recording."""

    def __init__(self, recording: RecordedTraffic, *, has_lights: bool) -> None:
        """Without lights a way is crossed out of turn."""
        self._recording = recording
        self._has_lights = has_lights

    @cached_property
    def _red(self) -> list[tuple[int, float, bool]]:
        return _at_red(self._recording) if self._has_lights else []

    @cached_property
    def _out_of_turn(self) -> list[tuple[int, float, float]]:
        return [] if self._has_lights else _ways_crossed(self._recording)

    def draw(self, kind: TrafficEventKind, rng: np.random.Generator) -> TrafficEvent:
        """Choose who does it, and when.

        Raises:
            NoEventError: nobody is followed, or nobody crosses anybody's way.
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
            car, at_s, sets_off = self._red[rng.integers(len(self._red))]
            event = TrafficEvent(kind, car, at_s, sets_off=sets_off)
            if _may_hit(self._recording, event):
                return event
        if self._out_of_turn:
            raise NoEventError(
                "cars in this recording cross each other's ways, but whoever came out of his turn"
                f" would be within {_ROOM_M:g} m of another who drives his way"
            )
        raise NoEventError("nobody in this recording crosses another's way")


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
    raise NoEventError("nobody in this recording is followed closely")


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
    """Who comes first to a red light, when he began to brake, and each half second he waits."""
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
    """From which sample to which a drive stands, if it goes on for a while then."""
    stands = np.concatenate([[False], drive.speed_m_s < 0.2, [False]])
    edges = np.flatnonzero(np.diff(stands.astype(np.int8)))
    both = [(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]
    return [(a, b) for a, b in both if b - a > 20 and b + round(5.0 / STEP_S) < len(drive)]


def _turns(drive: Trajectory, step: int) -> bool:
    later = min(step + round(8.0 / STEP_S), len(drive) - 1)
    return bool(abs(drive.heading_rad[later] - drive.heading_rad[step]) > _STRAIGHT_RAD)


def _may_hit(recording: RecordedTraffic, event: TrafficEvent) -> bool:
    """Whether somebody crosses the runner's way within `_TIMING_S` of him."""
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
    """Whether who is moved in time drives into nobody ahead of him in his lane, nor is driven into.

    Such a crash would be none of a crossing, and nobody's fault but of moving him.
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
    """Whose way crosses another's: car, when it is there, and by how much sooner it would meet."""
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
                # Moved, too, its drive begins after the recording.
                and drive.first * STEP_S > later_s + _TIMING_S
            ):
                found.append((number, (drive.first + mine) * STEP_S, later_s))
    return found


def _crossing(drive: Trajectory, other: Trajectory) -> tuple[int, int] | None:
    """The samples of two ways that lie nearest to each other where they cross, within 2 m."""
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
