"""Traffic of our own on straight lanes: car following, lane changes, traffic lights.

The cars of a lane follow each other by the intelligent driver model; a red light is a car that
stands. Who gains by the lane beside his own, and leaves room there, changes over in some seconds.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pydantic import Field
from typing_extensions import override

from onboard.settings import Settings
from sim_rig.roads.car_following import COMFORTABLE_M_S2, CarFollowing, idm_acceleration
from sim_rig.roads.cars import Array, Cars, Traffic

TICK_S = 0.1
_CHANGE_S = 3.0
"""From one lane to the next."""
_CHANGE_GAIN_M_S2 = 0.3
"""What a change must gain."""
_CHANGE_IMPOSED_M_S2 = 2.0
"""How hard the new follower may have to brake for it."""
_RESTLESS_S = 5.0
"""A driver who has changed stays so long."""


@dataclass(frozen=True, slots=True)
class Lane:
    """A straight lane, from where cars come in to where they go."""

    begin_m: tuple[float, float]
    heading_rad: float
    length_m: float
    arrivals_per_s: float
    road: int
    """Lanes of one road, beside each other in order, can be changed."""
    stop_line_m: float = math.inf
    """From the beginning, if there is a light."""
    green_s: tuple[float, float] = (0.0, 0.0)
    """From and until when in each cycle it is green."""


class DriverSettings(Settings):
    """The drivers, and what they drive."""

    top_speed_m_s: float = Field(14.0, gt=0.0, le=60.0)
    top_speed_sigma_m_s: float = Field(1.5, ge=0.0, le=10.0)
    following: CarFollowing = CarFollowing()
    length_m: tuple[float, float] = (4.0, 5.4)
    """Evenly between these."""
    width_m: float = Field(1.85, gt=0.5, le=3.0)


class LaneTraffic(Traffic):
    """Steps all cars at once, `TICK_S` at a time."""

    def __init__(
        self,
        lanes: Sequence[Lane],
        drivers: DriverSettings,
        rng: np.random.Generator,
        cycle_s: float = 60.0,
    ) -> None:
        """Begin with empty lanes; cars come in at random, as far apart as they drive."""
        self._lanes, self._drivers, self._rng = tuple(lanes), drivers, rng
        self._cycle_s = cycle_s
        self._step = 0
        self._count = 0
        self._names: tuple[str, ...] = ()
        self._lane = np.zeros(0, dtype=np.intp)
        self._left = np.zeros(0, dtype=np.intp)
        """The lane that the car has come from."""
        self._numbers = np.zeros((7, 0))
        """Rows: front, speed, acceleration, top speed, length, width, time of the last change."""
        self._begin = np.array([lane.begin_m for lane in lanes])
        self._heading = np.array([lane.heading_rad for lane in lanes])
        self._road = np.array([lane.road for lane in lanes])
        self._length = np.array([lane.length_m for lane in lanes])
        self._stop_line = np.array([lane.stop_line_m for lane in lanes])
        self._green = np.array([lane.green_s for lane in lanes])
        self._waiting = np.zeros(len(lanes), dtype=np.intp)

    @override
    def cars_at(self, at_s: float) -> Cars:
        """Step up to `at_s`; between steps cars go straight on."""
        while (self._step + 1) * TICK_S <= at_s + 1e-9:
            self._advance()
        return self._cars().moved_on(max(at_s - self._step * TICK_S, 0.0))

    def _cars(self) -> Cars:
        front, speed, acceleration, _, length, width, changed_s = self._numbers
        since = np.clip((self._step * TICK_S - changed_s) / _CHANGE_S, 0.0, 1.0)
        over = since * since * (3.0 - 2.0 * since)
        heading = self._heading[self._lane]
        ahead = np.stack([np.cos(heading), np.sin(heading)], axis=1)
        beginning = self._begin[self._lane] * over[:, None]
        beginning = beginning + self._begin[self._left] * (1.0 - over[:, None])
        aside = np.sum(
            (self._begin[self._lane] - self._begin[self._left])
            * np.stack([-ahead[:, 1], ahead[:, 0]], axis=1),
            axis=1,
        )
        sideways = aside * 6.0 * since * (1.0 - since) / _CHANGE_S
        return Cars(
            self._step * TICK_S,
            self._names,
            beginning + (front - length / 2.0)[:, None] * ahead,
            heading + np.arctan2(sideways, np.maximum(speed, 3.0)),
            speed.copy(),
            acceleration.copy(),
            length.copy(),
            width.copy(),
        )

    def _advance(self) -> None:
        self._change_lanes()
        front, speed, *_ = self._numbers
        acceleration = self._wish(self._lane)
        faster = np.maximum(speed + acceleration * TICK_S, 0.0)
        self._numbers[0] = front + (speed + faster) / 2.0 * TICK_S
        self._numbers[2] = (faster - speed) / TICK_S
        self._numbers[1] = faster
        self._step += 1
        self._leave()
        self._enter()

    def _wish(self, lane: NDArray[np.intp]) -> Array:
        """The acceleration of each car if it were in `lane`, the others where they are."""
        front, speed, _, top, length, _, _ = self._numbers
        same = self._lane[None, :] == lane[:, None]
        # A car that is changing is in the way in both lanes.
        same |= (self._left[None, :] == lane[:, None]) & self._changing()[None, :]
        apart = front[None, :] - length[None, :] - front[:, None]
        before = same & (front[None, :] > front[:, None])
        gaps = np.where(before, np.maximum(apart, 0.1), np.inf)
        gaps = np.concatenate([gaps, np.full((len(front), 1), np.inf)], axis=1)
        leader = gaps.argmin(axis=1)
        closing = speed - np.append(speed, 0.0)[leader]
        gap = gaps[np.arange(len(front)), leader]
        following = self._drivers.following
        wish = idm_acceleration(speed, top, gap, closing, COMFORTABLE_M_S2, following)
        to_line = self._stop_line[lane] - front
        can_stop = speed**2 / 2.0 <= 4.0 * np.maximum(to_line, 0.0)
        stops = self._is_red()[lane] & (to_line > -0.5) & can_stop
        line = np.where(stops, np.maximum(to_line + following.standing_gap_m - 0.5, 0.1), np.inf)
        before_light = idm_acceleration(speed, top, line, speed, COMFORTABLE_M_S2, following)
        result: Array = np.minimum(wish, before_light)
        return result

    def _changing(self) -> NDArray[np.bool_]:
        changing: NDArray[np.bool_] = self._step * TICK_S - self._numbers[6] < _CHANGE_S
        return changing

    def _is_red(self) -> NDArray[np.bool_]:
        phase = (self._step * TICK_S) % self._cycle_s
        red: NDArray[np.bool_] = (phase < self._green[:, 0]) | (phase >= self._green[:, 1])
        return red

    def _change_lanes(self) -> None:
        """One car in a step at most, so that no two go for the same room."""
        if len(np.unique(self._road)) == len(self._lanes) or not len(self._lane):
            return
        front, speed, _, _, _, _, changed_s = self._numbers
        now_s = self._step * TICK_S
        stays = self._wish(self._lane)
        can = (now_s - changed_s > _RESTLESS_S) & (speed > 5.0)
        can &= np.abs(front - self._stop_line[self._lane]) > 40.0
        best, which, where = _CHANGE_GAIN_M_S2, -1, -1
        for side in (-1, 1):
            lane = self._lane + side
            there = (lane >= 0) & (lane < len(self._lanes))
            lane = np.where(there, lane, self._lane)
            there &= self._road[lane] == self._road[self._lane]
            gains = np.where(there & can, self._wish(lane) - stays, -np.inf)
            for car in np.argsort(-gains)[:3].tolist():
                if gains[car] > best and self._has_room(car, int(lane[car])):
                    best, which, where = float(gains[car]), car, int(lane[car])
        if which >= 0:
            self._left[which], self._lane[which] = self._lane[which], where
            self._numbers[6, which] = now_s

    def _has_room(self, car: int, lane: int) -> bool:
        front, speed, _, top, length, _, _ = self._numbers
        beside = (self._lane == lane) | ((self._left == lane) & self._changing())
        if ((np.abs(front - front[car]) < 8.0) & beside).any():
            return False
        behind = np.flatnonzero(beside & (front < front[car]))
        if not len(behind):
            return True
        follower = behind[front[behind].argmax()]
        imposed = idm_acceleration(
            speed[follower],
            top[follower],
            np.maximum(front[car] - length[car] - front[follower], 0.1),
            speed[follower] - speed[car],
            COMFORTABLE_M_S2,
            self._drivers.following,
        )
        return bool(imposed > -_CHANGE_IMPOSED_M_S2)

    def _leave(self) -> None:
        stays = self._numbers[0] - self._numbers[4] < self._length[self._lane]
        if not stays.all():
            self._keep(np.flatnonzero(stays))

    def _keep(self, which: NDArray[np.intp]) -> None:
        self._names = tuple(self._names[i] for i in which)
        self._lane, self._left = self._lane[which], self._left[which]
        self._numbers = self._numbers[:, which]

    def _enter(self) -> None:
        """Who finds no room at the beginning waits before it."""
        rates = np.array([lane.arrivals_per_s for lane in self._lanes])
        self._waiting += self._rng.poisson(rates * TICK_S)
        drivers = self._drivers
        for lane in np.flatnonzero(self._waiting).tolist():
            there = (self._lane == lane) | ((self._left == lane) & self._changing())
            rears = (self._numbers[0] - self._numbers[4])[there]
            room = rears.min(initial=np.inf)
            last_speed = self._numbers[1][there][rears.argmin()] if len(rears) else np.inf
            length = self._rng.uniform(*drivers.length_m)
            spread = np.clip(self._rng.normal(), -2.0, 2.0) * drivers.top_speed_sigma_m_s
            top = max(drivers.top_speed_m_s + spread, 3.0)
            speed = min(top, last_speed)
            following = drivers.following
            if room < length + following.standing_gap_m + speed * following.headway_s:
                continue
            self._waiting[lane] -= 1
            self._count += 1
            self._names += (f"car{self._count}",)
            self._lane, self._left = np.append(self._lane, lane), np.append(self._left, lane)
            new = [length, speed, 0.0, top, length, drivers.width_m, -math.inf]
            self._numbers = np.column_stack([self._numbers, new])
