"""Meetings of two vehicles at a crossing: straight on, pulling out from a stop, and turning left.

In each, the second vehicle has to yield, and some of its drivers do not. Neither reacts to alarms.
Traffic keeps to the right; the first vehicle goes straight on.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from onboard.risk.trajectory import reached_after_s
from sim_rig.studies.joerer.traffic import (
    Approaches,
    ApproachOutcome,
    TrafficSettings,
    draw,
    simulate_approaches,
)

Array = NDArray[np.float64]

TICK_S = 0.02
BEYOND_M = 20.0
"""A meeting ends when the first vehicle is this far beyond the middle of the crossing."""
BEGIN_STEP_S = 0.5
"""A driver who yields decides this often whether to pull out or turn."""
LANE_M = 3.5
"""From the middle of one lane to the middle of the oncoming one."""
PULL_OUT_M_S2 = (1.2, 2.5)
"""Range of the acceleration of a driver who pulls out."""
TURNING_M_S = (4.5, 7.5)
"""Range of the speed in a left turn."""
TURN_RADIUS_M = (8.0, 14.0)
SLOWING_M_S2 = (1.5, 2.5)
"""Range of the deceleration before a turn."""
TURNING_OFF_M_S2 = 1.5
"""Acceleration of a driver who has waited to turn."""


class MeetingKind(StrEnum):
    """What the second vehicle does."""

    STRAIGHT = "straight"
    """It comes from the side, as in section IV of Joerer et al."""
    PULL_OUT = "pull-out"
    """It stands at the stop line, and crosses."""
    LEFT_TURN = "left-turn"
    """It turns left across the path of the first, which is oncoming."""


@dataclass(frozen=True, slots=True)
class Meeting:
    """Two vehicles, in the order of the module; ticks are `TICK_S` apart."""

    position_m: Array
    """(ticks, 2, 2) of each centre, east and north."""
    course_rad: Array
    """(ticks, 2) counterclockwise from east."""
    speed_m_s: Array
    """(ticks, 2)"""
    acceleration_m_s2: Array
    """(ticks, 2)"""
    contact_s: float
    """Infinite without a contact."""
    gap_s: float
    """From when one vehicle has left the place that both cross until the other enters it: 0 or less
    if they are there together, infinite if the other does not enter it."""
    turns_left: bool = False
    """Whether the second vehicle turns."""


@dataclass(frozen=True, slots=True)
class _PullsOut:
    """Stands, then drives east over the crossing."""

    stands_m: float
    """Along its path, in which 0 is the middle of the crossing."""
    acceleration_m_s2: float
    top_m_s: float

    def driven(self, clock_s: Array, begin_s: float) -> Array:
        """(ticks, 2) way along the path, and speed."""
        top_s = begin_s + self.top_m_s / self.acceleration_m_s2
        return _driven(clock_s, [begin_s, top_s], [0.0, self.top_m_s], (begin_s, self.stands_m))

    def path(self, along_m: Array) -> tuple[Array, Array]:
        """(ticks, 2) position, and (ticks) course."""
        return np.stack([along_m, 0.0 * along_m], axis=1), 0.0 * along_m

    @property
    def first_path(self) -> tuple[Array, float]:
        """Where the path of the first vehicle crosses, and its course."""
        return np.zeros(2), math.pi / 2.0


@dataclass(frozen=True, slots=True)
class _TurnsLeft:
    """Drives east, slows down or stops where the turn begins, and turns north."""

    radius_m: float
    arrives_s: float
    """At the begin of the turn, 0 along its path."""
    approach_m_s: float
    turning_m_s: float
    slowing_m_s2: float

    def driven(self, clock_s: Array, begin_s: float) -> Array:
        """(ticks, 2) way along the path, and speed; it stops if it is to begin after it arrives."""
        waits = begin_s > self.arrives_s
        slowest_m_s = 0.0 if waits else self.turning_m_s
        slows_s = self.arrives_s - (self.approach_m_s - slowest_m_s) / self.slowing_m_s2
        times_s, speeds_m_s = [slows_s, self.arrives_s], [self.approach_m_s, slowest_m_s]
        if waits:
            times_s += [begin_s, begin_s + self.turning_m_s / TURNING_OFF_M_S2]
            speeds_m_s += [0.0, self.turning_m_s]
        return _driven(clock_s, times_s, speeds_m_s, (self.arrives_s, 0.0))

    def path(self, along_m: Array) -> tuple[Array, Array]:
        """(ticks, 2) position, and (ticks) course."""
        radius_m = self.radius_m
        turned = np.clip(along_m / radius_m, 0.0, math.pi / 2.0)
        before_m, after_m = np.minimum(along_m, 0.0), along_m - radius_m * turned
        east_m = before_m + radius_m * np.sin(turned)
        north_m = radius_m * (1.0 - np.cos(turned)) + np.maximum(after_m, 0.0)
        return np.stack([east_m, north_m], axis=1), turned

    @property
    def first_path(self) -> tuple[Array, float]:
        """Where the path of the oncoming vehicle crosses, and its course."""
        turned = math.acos(1.0 - LANE_M / self.radius_m)
        return np.array([self.radius_m * math.sin(turned), LANE_M]), math.pi


def meetings(
    kind: MeetingKind, traffic: TrafficSettings, rng: np.random.Generator
) -> Iterator[Meeting]:
    """Yield as many meetings as `traffic` has approaches.

    Args:
        kind: of all of them.
        traffic: speeds, sizes, and the share of drivers who do not yield.
        rng: source of all draws.
    """
    if kind is MeetingKind.STRAIGHT:
        approaches = simulate_approaches(traffic, rng)
        yield from (_straight(approaches, n, traffic) for n in range(traffic.approaches))
    else:
        yield from (_begins(kind, traffic, rng) for _ in range(traffic.approaches))


def _straight(approaches: Approaches, n: int, traffic: TrafficSettings) -> Meeting:
    """Return an approach: the first drives north, the second east."""
    ticks = max(math.ceil(approaches.end_s[n] / approaches.tick_s), 1)
    ahead_m, speed_m_s, acceleration_m_s2 = (
        each[n, :ticks].astype(np.float64)
        for each in (approaches.distance_m, approaches.speed_m_s, approaches.acceleration_m_s2)
    )
    position_m = np.zeros((ticks, 2, 2))
    position_m[:, 0, 1], position_m[:, 1, 0] = -ahead_m[:, 0], -ahead_m[:, 1]
    later = int(np.argmax(ahead_m[-1]))
    gap_s = reached_after_s(
        ahead_m[-1, later] - (traffic.length_m + traffic.width_m) / 2.0,
        np.minimum(acceleration_m_s2[-1, later], 0.0),
        speed_m_s[-1, later],
        np.array(math.inf),
    )
    crashes = approaches.outcome[n] == ApproachOutcome.CRASH
    return Meeting(
        position_m,
        np.broadcast_to([math.pi / 2.0, 0.0], (ticks, 2)),
        speed_m_s,
        acceleration_m_s2,
        float(approaches.end_s[n]) if crashes else math.inf,
        0.0 if crashes else float(gap_s),
    )


def _begins(kind: MeetingKind, traffic: TrafficSettings, rng: np.random.Generator) -> Meeting:
    """Return a meeting in which the second pulls out or turns, and the first keeps its speed."""
    first_m_s, top_m_s = draw(traffic.top_speed_m_s, traffic.most_sigmas, (2,), rng).tolist()
    start_m = rng.uniform(*traffic.start_m)
    until_s = (start_m + BEYOND_M) / first_m_s
    clock_s = np.arange(0.0, until_s, TICK_S)
    ignores = rng.random() < traffic.ignoring
    begin_s = rng.uniform(0.2, 0.9) * until_s
    second: _PullsOut | _TurnsLeft
    if kind is MeetingKind.PULL_OUT:
        stands_m = -traffic.stop_line_m - traffic.length_m / 2.0
        second = _PullsOut(stands_m, rng.uniform(*PULL_OUT_M_S2), top_m_s)
    else:
        turning_m_s = rng.uniform(*TURNING_M_S)
        second = _TurnsLeft(
            rng.uniform(*TURN_RADIUS_M),
            begin_s,
            max(top_m_s, turning_m_s),
            turning_m_s,
            rng.uniform(*SLOWING_M_S2),
        )
    first = np.stack([first_m_s * clock_s - start_m, np.full_like(clock_s, first_m_s)], axis=1)
    meeting = _meeting(first, second.driven(clock_s, begin_s), second, traffic)
    while not ignores and meeting.gap_s <= traffic.margin_s:
        begin_s += BEGIN_STEP_S
        meeting = _meeting(first, second.driven(clock_s, begin_s), second, traffic)
    return meeting


def _driven(
    clock_s: Array, times_s: list[float], speeds_m_s: list[float], at: tuple[float, float]
) -> Array:
    """(ticks, 2) way and speed of a piecewise linear speed.

    Args:
        clock_s: (ticks)
        times_s: of the breakpoints.
        speeds_m_s: at the breakpoints, constant before the first and after the last.
        at: a time, and where the vehicle is then, s and m.
    """
    speed_m_s = np.interp(clock_s, times_s, speeds_m_s)
    along_m = np.cumsum(speed_m_s) * TICK_S
    along_m += at[1] - np.interp(at[0], clock_s, along_m)
    return np.stack([along_m, speed_m_s], axis=1)


def _meeting(
    first: Array, second: Array, driver: _PullsOut | _TurnsLeft, traffic: TrafficSettings
) -> Meeting:
    """Return the meeting of two vehicles, whose ways and speeds are (ticks, 2), until a contact."""
    crossing_m, first_rad = driver.first_path
    ahead = np.array([math.cos(first_rad), math.sin(first_rad)])
    first_m = crossing_m + first[:, :1] * ahead
    second_m, second_rad = driver.path(second[:, 0])
    speed_m_s = np.stack([first[:, 1], second[:, 1]], axis=1)
    apart_m = second_m - crossing_m
    aside_m = apart_m @ np.array([-ahead[1], ahead[0]])
    gap_s, contact_s = _gap_and_contact_s(
        first[:, 0], apart_m @ ahead, aside_m, second_rad - first_rad, traffic
    )
    ticks = len(first) if math.isinf(contact_s) else max(round(contact_s / TICK_S), 1)
    return Meeting(
        np.stack([first_m, second_m], axis=1)[:ticks],
        np.stack([np.full(len(first), first_rad), second_rad], axis=1)[:ticks],
        speed_m_s[:ticks],
        np.gradient(speed_m_s, TICK_S, axis=0)[:ticks],
        contact_s,
        gap_s,
        isinstance(driver, _TurnsLeft),
    )


def _gap_and_contact_s(
    first_m: Array, ahead_m: Array, aside_m: Array, turned_rad: Array, traffic: TrafficSettings
) -> tuple[float, float]:
    """Gap and contact, as in `Meeting`.

    Args:
        first_m: (ticks) way of the first along its straight path.
        ahead_m: (ticks) of the second's centre, along the same path.
        aside_m: (ticks) of the second's centre, to the left of that path.
        turned_rad: (ticks) course of the second less that of the first.
        traffic: sizes of both.
    """
    half_length_m, half_width_m = traffic.length_m / 2.0, traffic.width_m / 2.0
    sine, cosine = np.abs(np.sin(turned_rad)), np.abs(np.cos(turned_rad))
    reach_m = half_length_m * cosine + half_width_m * sine
    across_m = half_length_m * sine + half_width_m * cosine
    is_in_lane = np.abs(aside_m) < across_m + half_width_m
    if not is_in_lane.any():
        return math.inf, math.inf
    begin_m = float((ahead_m - reach_m)[is_in_lane].min()) - half_length_m
    end_m = float((ahead_m + reach_m)[is_in_lane].max()) + half_length_m
    inside = [np.flatnonzero((first_m > begin_m) & (first_m < end_m)), np.flatnonzero(is_in_lane)]
    if not len(inside[0]):
        return math.inf, math.inf
    gap_s = (max(each[0] for each in inside) - min(each[-1] for each in inside)) * TICK_S
    # Along the courses of either vehicle: the separating axis theorem.
    apart_m = ahead_m - first_m
    along_second_m = np.abs(apart_m * np.cos(turned_rad) + aside_m * np.sin(turned_rad))
    across_second_m = np.abs(aside_m * np.cos(turned_rad) - apart_m * np.sin(turned_rad))
    touches = (
        is_in_lane
        & (np.abs(apart_m) < reach_m + half_length_m)
        & (along_second_m < reach_m + half_length_m)
        & (across_second_m < across_m + half_width_m)
    )
    contact_s = float(np.argmax(touches)) * TICK_S if touches.any() else math.inf
    return float(gap_s), contact_s
