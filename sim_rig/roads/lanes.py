"""Synthetic traffic on straight lanes: car following, lane changes, traffic lights.

Cars follow each other by the intelligent driver model (IDM); a red light counts as a standing car.
A car changes to a neighbouring lane if it gains acceleration and has room there.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from pydantic import Field
from typing_extensions import override

from onboard.settings import Settings
from sim_rig.roads.car_following import COMFORTABLE_M_S2, CarFollowing, idm_acceleration
from sim_rig.roads.cars import Array, Cars, Traffic

TICK_S = 0.1
_CHANGE_S = 3.0
"""Duration of a lane change."""
_CHANGE_GAIN_M_S2 = 0.3
"""Least gain of acceleration for a lane change."""
_CHANGE_IMPOSED_M_S2 = 2.0
"""Largest deceleration that a lane change may impose on the new follower."""
_CHANGE_INTERVAL_S = 5.0
"""Least time between two lane changes of a car."""


@dataclass(frozen=True, slots=True)
class Lane:
    """A straight lane."""

    begin_m: tuple[float, float]
    heading_rad: float
    length_m: float
    arrivals_per_s: float
    road: int
    """Number of the road; lane changes are between consecutive lanes of one road."""
    stop_line_m: float = math.inf
    """Distance of the stop line from the start of the lane; infinite without a light."""
    green_s: tuple[float, float] = (0.0, 0.0)
    """Start and end of green in each cycle."""


class DriverSettings(Settings):
    """Drivers and sizes of their cars."""

    top_speed_m_s: float = Field(14.0, gt=0.0, le=60.0)
    top_speed_sigma_m_s: float = Field(1.5, ge=0.0, le=10.0)
    following: CarFollowing = CarFollowing()
    length_m: tuple[float, float] = (4.0, 5.4)
    """Uniform between these."""
    width_m: float = Field(1.85, gt=0.5, le=3.0)


def _empty() -> Array:
    return np.zeros(0)


def _no_lane() -> NDArray[np.intp]:
    return np.zeros(0, dtype=np.intp)


@dataclass(slots=True, eq=False)
class _Driven:
    """The N cars present, as arrays (N,)."""

    names: tuple[str, ...] = ()
    lane: NDArray[np.intp] = field(default_factory=_no_lane)
    left: NDArray[np.intp] = field(default_factory=_no_lane)
    """The lane before the last change."""
    front_m: Array = field(default_factory=_empty)
    """Front bumper from the start of the lane."""
    speed_m_s: Array = field(default_factory=_empty)
    acceleration_m_s2: Array = field(default_factory=_empty)
    top_speed_m_s: Array = field(default_factory=_empty)
    length_m: Array = field(default_factory=_empty)
    width_m: Array = field(default_factory=_empty)
    changed_s: Array = field(default_factory=_empty)
    """Time of the last lane change."""

    @property
    def rear_m(self) -> Array:
        """Rear bumper from the start of the lane, m."""
        return self.front_m - self.length_m

    def only(self, which: NDArray[np.intp]) -> "_Driven":
        """Select cars by index."""
        return _Driven(
            tuple(self.names[i] for i in which.tolist()),
            self.lane[which],
            self.left[which],
            self.front_m[which],
            self.speed_m_s[which],
            self.acceleration_m_s2[which],
            self.top_speed_m_s[which],
            self.length_m[which],
            self.width_m[which],
            self.changed_s[which],
        )

    def joined(self, name: str, lane: int, newcomer: "_Newcomer") -> "_Driven":
        """Add a car with its rear at the start of a lane."""
        return _Driven(
            (*self.names, name),
            np.append(self.lane, lane),
            np.append(self.left, lane),
            np.append(self.front_m, newcomer.length_m),
            np.append(self.speed_m_s, newcomer.speed_m_s),
            np.append(self.acceleration_m_s2, 0.0),
            np.append(self.top_speed_m_s, newcomer.top_speed_m_s),
            np.append(self.length_m, newcomer.length_m),
            np.append(self.width_m, newcomer.width_m),
            np.append(self.changed_s, -math.inf),
        )


@dataclass(frozen=True, slots=True)
class _Newcomer:
    """A car that enters."""

    length_m: float
    width_m: float
    speed_m_s: float
    top_speed_m_s: float


class LaneTraffic(Traffic):
    """Steps all cars at once, `TICK_S` at a time."""

    def __init__(
        self,
        lanes: Sequence[Lane],
        drivers: DriverSettings,
        rng: np.random.Generator,
        cycle_s: float = 60.0,
    ) -> None:
        """Start with empty lanes; cars arrive as a Poisson process.

        Args:
            lanes: all lanes; lanes of one road are consecutive.
            drivers: drivers and sizes of cars.
            rng: source of arrivals and drivers.
            cycle_s: cycle of the traffic lights.
        """
        self._lanes, self._drivers, self._rng = tuple(lanes), drivers, rng
        self._cycle_s = cycle_s
        self._step = 0
        self._count = 0
        self._driven = _Driven()
        self._begin_m = np.array([lane.begin_m for lane in lanes])
        self._heading_rad = np.array([lane.heading_rad for lane in lanes])
        self._road = np.array([lane.road for lane in lanes])
        self._length_m = np.array([lane.length_m for lane in lanes])
        self._stop_line_m = np.array([lane.stop_line_m for lane in lanes])
        self._green_s = np.array([lane.green_s for lane in lanes])
        self._waiting = np.zeros(len(lanes), dtype=np.intp)

    @override
    def cars_at(self, at_s: float) -> Cars:
        """Step to `at_s`; between steps, cars go straight on."""
        while (self._step + 1) * TICK_S <= at_s + 1e-9:
            self._advance()
        return self._cars().moved_on(max(at_s - self._step * TICK_S, 0.0))

    def _cars(self) -> Cars:
        driven = self._driven
        since = np.clip((self._step * TICK_S - driven.changed_s) / _CHANGE_S, 0.0, 1.0)
        over = since * since * (3.0 - 2.0 * since)
        heading = self._heading_rad[driven.lane]
        ahead = np.stack([np.cos(heading), np.sin(heading)], axis=1)
        beginning = self._begin_m[driven.lane] * over[:, None]
        beginning = beginning + self._begin_m[driven.left] * (1.0 - over[:, None])
        aside = np.sum(
            (self._begin_m[driven.lane] - self._begin_m[driven.left])
            * np.stack([-ahead[:, 1], ahead[:, 0]], axis=1),
            axis=1,
        )
        sideways = aside * 6.0 * since * (1.0 - since) / _CHANGE_S
        return Cars(
            self._step * TICK_S,
            driven.names,
            beginning + (driven.front_m - driven.length_m / 2.0)[:, None] * ahead,
            heading + np.arctan2(sideways, np.maximum(driven.speed_m_s, 3.0)),
            driven.speed_m_s,
            driven.acceleration_m_s2,
            driven.length_m,
            driven.width_m,
        )

    def _advance(self) -> None:
        self._change_lanes()
        driven = self._driven
        speed = driven.speed_m_s
        faster = np.maximum(speed + self._wish(driven.lane) * TICK_S, 0.0)
        driven.front_m = driven.front_m + (speed + faster) / 2.0 * TICK_S
        driven.acceleration_m_s2 = (faster - speed) / TICK_S
        driven.speed_m_s = faster
        self._step += 1
        self._leave()
        self._enter()

    def _wish(self, lane: NDArray[np.intp]) -> Array:
        """Acceleration of each car if it were in `lane` and the others stayed, m/s^2."""
        driven = self._driven
        front, speed, top = driven.front_m, driven.speed_m_s, driven.top_speed_m_s
        same = driven.lane[None, :] == lane[:, None]
        # During a lane change, a car occupies both lanes.
        same |= (driven.left[None, :] == lane[:, None]) & self._changing()[None, :]
        apart = driven.rear_m[None, :] - front[:, None]
        before = same & (front[None, :] > front[:, None])
        gaps = np.where(before, np.maximum(apart, 0.1), np.inf)
        gaps = np.concatenate([gaps, np.full((len(front), 1), np.inf)], axis=1)
        leader = gaps.argmin(axis=1)
        closing = speed - np.append(speed, 0.0)[leader]
        gap = gaps[np.arange(len(front)), leader]
        following = self._drivers.following
        wish = idm_acceleration(speed, top, gap, closing, COMFORTABLE_M_S2, following)
        to_line = self._stop_line_m[lane] - front
        can_stop = speed**2 / 2.0 <= 4.0 * np.maximum(to_line, 0.0)
        stops = self._is_red()[lane] & (to_line > -0.5) & can_stop
        line = np.where(stops, np.maximum(to_line + following.standing_gap_m - 0.5, 0.1), np.inf)
        before_light = idm_acceleration(speed, top, line, speed, COMFORTABLE_M_S2, following)
        result: Array = np.minimum(wish, before_light)
        return result

    def _changing(self) -> NDArray[np.bool_]:
        changing: NDArray[np.bool_] = self._step * TICK_S - self._driven.changed_s < _CHANGE_S
        return changing

    def _is_red(self) -> NDArray[np.bool_]:
        phase = (self._step * TICK_S) % self._cycle_s
        red: NDArray[np.bool_] = (phase < self._green_s[:, 0]) | (phase >= self._green_s[:, 1])
        return red

    def _change_lanes(self) -> None:
        """Start at most one lane change per step, so that no two cars use the same gap."""
        driven = self._driven
        if len(np.unique(self._road)) == len(self._lanes) or not driven.names:
            return
        now_s = self._step * TICK_S
        stays = self._wish(driven.lane)
        can = (now_s - driven.changed_s > _CHANGE_INTERVAL_S) & (driven.speed_m_s > 5.0)
        can &= np.abs(driven.front_m - self._stop_line_m[driven.lane]) > 40.0
        best, which, where = _CHANGE_GAIN_M_S2, -1, -1
        for side in (-1, 1):
            lane = driven.lane + side
            there = (lane >= 0) & (lane < len(self._lanes))
            lane = np.where(there, lane, driven.lane)
            there &= self._road[lane] == self._road[driven.lane]
            gains = np.where(there & can, self._wish(lane) - stays, -np.inf)
            for car in np.argsort(-gains)[:3].tolist():
                if gains[car] > best and self._has_room(car, int(lane[car])):
                    best, which, where = float(gains[car]), car, int(lane[car])
        if which >= 0:
            driven.left[which], driven.lane[which] = driven.lane[which], where
            driven.changed_s[which] = now_s

    def _has_room(self, car: int, lane: int) -> bool:
        driven = self._driven
        front, speed = driven.front_m, driven.speed_m_s
        beside = self._is_in(lane)
        if ((np.abs(front - front[car]) < 8.0) & beside).any():
            return False
        behind = np.flatnonzero(beside & (front < front[car]))
        if not len(behind):
            return True
        follower = behind[front[behind].argmax()]
        imposed = idm_acceleration(
            speed[follower],
            driven.top_speed_m_s[follower],
            np.maximum(driven.rear_m[car] - front[follower], 0.1),
            speed[follower] - speed[car],
            COMFORTABLE_M_S2,
            self._drivers.following,
        )
        return bool(imposed > -_CHANGE_IMPOSED_M_S2)

    def _is_in(self, lane: int) -> NDArray[np.bool_]:
        """Whether each car is in a lane, or still leaving it."""
        driven = self._driven
        there: NDArray[np.bool_] = (driven.lane == lane) | (
            (driven.left == lane) & self._changing()
        )
        return there

    def _leave(self) -> None:
        stays = self._driven.rear_m < self._length_m[self._driven.lane]
        if not stays.all():
            self._driven = self._driven.only(np.flatnonzero(stays))

    def _enter(self) -> None:
        """Insert arrived cars; without room at the start of their lane they wait."""
        rates = np.array([lane.arrivals_per_s for lane in self._lanes])
        self._waiting += self._rng.poisson(rates * TICK_S)
        following = self._drivers.following
        for lane in np.flatnonzero(self._waiting).tolist():
            there = self._is_in(lane)
            rears_m = self._driven.rear_m[there]
            room_m = rears_m.min(initial=np.inf)
            ahead_m_s = self._driven.speed_m_s[there][rears_m.argmin()] if len(rears_m) else np.inf
            newcomer = self._newcomer(ahead_m_s)
            needed_m = newcomer.length_m + following.standing_gap_m
            needed_m += newcomer.speed_m_s * following.headway_s
            if room_m < needed_m:
                continue
            self._waiting[lane] -= 1
            self._count += 1
            self._driven = self._driven.joined(f"car{self._count}", lane, newcomer)

    def _newcomer(self, ahead_m_s: float) -> _Newcomer:
        """Draw a car, no faster than its lead."""
        drivers = self._drivers
        length_m = self._rng.uniform(*drivers.length_m)
        spread = np.clip(self._rng.normal(), -2.0, 2.0) * drivers.top_speed_sigma_m_s
        top_m_s = max(drivers.top_speed_m_s + spread, 3.0)
        return _Newcomer(length_m, drivers.width_m, min(top_m_s, ahead_m_s), top_m_s)
