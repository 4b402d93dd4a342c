"""A recording in which something goes wrong, and drivers who notice, late or warned.

Everybody keeps to the recording until something touches him: the event itself, a warning, or
another car that stands or slows on his way and was not there. A driver who sees that stops
accelerating, brakes after his own reaction time, and follows the intelligent driver model from then
on; a warned one brakes, and not only until the warning ends if he would still meet somebody who
crosses his way. Where the recording waits at a light, he waits too. Ways are kept; only speeds
change.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pydantic import Field
from typing_extensions import override

from onboard.settings import Settings
from sim_rig.roads.car_following import CarFollowing, idm_acceleration
from sim_rig.roads.cars import Cars, Traffic
from sim_rig.roads.crashes import Crash, boxes_overlap, first_crash
from sim_rig.roads.events import SETTING_OFF_M_S2, SETTING_OFF_TO_M_S, Event, Kind
from sim_rig.roads.paths import DrivePath, blocked_at_m, would_meet
from sim_rig.roads.recording import STEP_S, Recording
from sim_rig.setting_types import NotNegative, Positive, Span

COMFORTABLE_M_S2 = 3.0
_WARNING_HELD_S = 0.5
"""After the last word of a warning a driver lets go of the brake."""
_NEEDED_M_S2 = 1.0
"""Who is not on his own way by the recording reacts to what asks for so much more braking."""
_NOTICED_M_S2 = 0.3
"""Others, to so much more than the same cars asked for in the recording: what asks for it may be
brake lights, from which reaction times are counted."""
_STANDS_M_S = 0.5
_SEEN_M = 75.0
"""Who is farther away is nothing to react to."""
_AHEAD_S = np.arange(0.2, 5.1, 0.2)
"""A driver who looks out for others looks so far ahead."""


class ReactionSettings(Settings):
    """How drivers react; of each driver drawn once. Times are log-normal."""

    unwarned_median_s: float = Field(1.3, gt=0.0, le=5.0)
    """To a car ahead that unexpectedly brakes (Green, Transportation Human Factors 2, 2000)."""
    unwarned_sigma: float = Field(0.4, ge=0.0, le=1.5)
    """Of the logarithm."""
    distracted: float = Field(0.25, ge=0.0, le=1.0)
    """Part of the drivers who look elsewhere at first."""
    distracted_s: Span[NotNegative] = (0.5, 2.5)
    """For how long, evenly."""
    warned_median_s: float = Field(0.9, gt=0.0, le=5.0)
    """From the warning to the brake."""
    warned_sigma: float = Field(0.3, ge=0.0, le=1.5)
    braking_m_s2: Span[Positive] = (4.0, 8.0)
    """Of a warned driver, evenly between these."""
    following: CarFollowing = CarFollowing()


@dataclass(slots=True)
class _Driver:
    """One who has left the recording, or is about to."""

    unwarned_s: float
    warned_s: float
    braking_m_s2: float
    path: DrivePath
    way_m: float = 0.0
    speed_m_s: float = 0.0
    acceleration_m_s2: float = 0.0
    is_off: bool = False
    """The recording."""
    runs: bool = False
    """A red light: keeps his speed until he notices."""
    sets_off: bool = False
    """At a red light: drives on from standing."""
    noticed: bool = False
    """That he runs a light, or what he was warned of: looks out for who crosses his way."""
    reacts_at_s: float = -math.inf
    """To what made him leave the recording; until then he does not accelerate, and brakes only
    where the recording does."""
    event_braking_m_s2: float = 0.0
    needed_since_s: float = math.inf
    brakes_at_s: float = math.inf
    """When he brakes because he was warned."""
    brakes_until_s: float = -math.inf


class DisturbedTraffic(Traffic):
    """Steps with the recording, `STEP_S` at a time; ends with the first crash."""

    def __init__(
        self, recording: Recording, event: Event | None, reactions: ReactionSettings, seed: int
    ) -> None:
        """Let `event` happen to drivers who are drawn by `seed`."""
        self._recording, self._event, self._reactions, self._seed = (
            recording,
            event,
            reactions,
            seed,
        )
        self._numbers = {drive.name: i for i, drive in enumerate(recording.drives)}
        self._drivers: dict[int, _Driver] = {}
        # What two situations ask for is compared beyond what brakes can do.
        self._unbounded = reactions.following.model_copy(
            update={"hardest_deceleration_m_s2": math.inf}
        )
        self._moved_in_time = event.car if event is not None and event.sooner_s else None
        self._step: int | None = None
        self._cars: Cars | None = None
        self._ignored: set[frozenset[str]] = set()
        self.crash: Crash | None = None

    @override
    def cars_at(self, at_s: float) -> Cars:
        step = math.floor(at_s / STEP_S + 1e-6)
        if self._cars is None or self._step is None:
            self._step = step
            self._cars = self._look(step * STEP_S)
            self._ignored |= self._overlapping(self._cars)
        while self._step < step:
            before = self._cars
            self._decide(self._step * STEP_S, before)
            self._step += 1
            self._cars = self._look(self._step * STEP_S)
            if self.crash is None:
                self.crash = first_crash(before, self._cars, self._counts)
            self._ignored |= self._overlapping(self._cars)
        return self._cars.moved_on(max(at_s - self._step * STEP_S, 0.0))

    def warn(self, name: str, at_s: float) -> None:
        """The driver of a car is warned at this moment; he brakes for as long as that lasts."""
        driver = self._driver(self._numbers[name])
        reacts_s = at_s + driver.warned_s
        if at_s > driver.brakes_until_s:
            driver.brakes_at_s = reacts_s
        driver.brakes_until_s = reacts_s + _WARNING_HELD_S

    def is_disturbed(self, name: str) -> bool:
        """Whether a car no longer keeps to the recording."""
        driver, event = self._drivers.get(self._numbers[name]), self._event
        if event is not None and event.sooner_s and self._numbers[name] == event.car:
            return self._step is not None and self._step * STEP_S > event.at_s
        return driver is not None and driver.is_off

    def has_moved(self, name: str) -> bool:
        """Whether a car is the event's, and the event has begun."""
        event = self._event
        return event is not None and self._numbers[name] == event.car and self.is_disturbed(name)

    def _driver(self, number: int) -> _Driver:
        driver = self._drivers.get(number)
        if driver is None:
            settings, rng = self._reactions, np.random.default_rng([self._seed, number])
            distracted = rng.random() < settings.distracted
            away_s = rng.uniform(*settings.distracted_s)
            unwarned = settings.unwarned_median_s * math.exp(settings.unwarned_sigma * rng.normal())
            warned = settings.warned_median_s * math.exp(settings.warned_sigma * rng.normal())
            driver = self._drivers[number] = _Driver(
                unwarned + (away_s if distracted else 0.0),
                warned,
                rng.uniform(*settings.braking_m_s2),
                DrivePath(self._recording.drives[number]),
            )
        return driver

    def _look(self, at_s: float) -> Cars:
        """The recording, with those who left it where they are."""
        cars = self._recording.cars_at(at_s)
        moved = [number for number, driver in self._drivers.items() if driver.is_off]
        event = self._event
        if event is not None and event.sooner_s and event.car not in moved:
            sooner = self._recording.cars_at(at_s + event.sooner_s)
            own = sooner.index(self._name(event.car))
            cars = cars.without(self._name(event.car))
            if own is not None:
                cars = cars.joined(sooner.only(np.array([own])))
        for number in moved:
            driver = self._drivers[number]
            cars = cars.without(self._name(number))
            if driver.way_m <= driver.path.length_m:
                middle, heading = driver.path.places(np.array([driver.way_m]))
                drive = driver.path.drive
                one = Cars(
                    at_s, (drive.name,), middle, heading, np.array([driver.speed_m_s]),
                    np.array([driver.acceleration_m_s2]),
                    np.array([drive.length_m]), np.array([drive.width_m]),
                )  # fmt: skip
                cars = cars.joined(one)
        return cars

    def _name(self, number: int) -> str:
        return self._recording.drives[number].name

    def _decide(self, now: float, cars: Cars) -> None:
        """Who leaves the recording now, and what those who have left it do in the next step."""
        index = {self._numbers[name]: i for i, name in enumerate(cars.names)}
        event = self._event
        if event is not None and event.car in index and abs(event.at_s - now) < STEP_S / 2:
            driver = self._driver(event.car)
            driver.event_braking_m_s2 = event.deceleration_m_s2
            driver.runs = event.kind is Kind.RED_LIGHT
            driver.sets_off = event.sets_off
            if not event.sooner_s:
                self._leave(event.car, now, cars, index)
        for number, driver in self._drivers.items():
            if not driver.is_off and driver.brakes_at_s <= now and number in index:
                self._leave(number, now, cars, index)
        off = self._off(index)
        if event is not None and event.sooner_s and event.car in index and event.car not in off:
            self._notice([event.car, *off], now, cars, index)
        elif off:
            self._notice(off, now, cars, index)
        wishes = [(self._drivers[n], self._wish(n, now, cars, index[n])) for n in self._off(index)]
        for driver, acceleration in wishes:
            faster = max(driver.speed_m_s + acceleration * STEP_S, 0.0)
            driver.way_m += (driver.speed_m_s + faster) / 2.0 * STEP_S
            driver.acceleration_m_s2 = (faster - driver.speed_m_s) / STEP_S
            driver.speed_m_s = faster

    def _off(self, index: dict[int, int]) -> list[int]:
        return [n for n, driver in self._drivers.items() if driver.is_off and n in index]

    def _leave(self, number: int, now: float, cars: Cars, index: dict[int, int]) -> None:
        driver = self._driver(number)
        driver.way_m = self._way_m(number, now)
        driver.is_off = True
        driver.speed_m_s = float(cars.speed_m_s[index[number]])

    def _notice(self, off: list[int], now: float, cars: Cars, index: dict[int, int]) -> None:
        """Drivers with a disturbed car on their way react to it in their time."""
        obstacles = np.array([index[number] for number in off], dtype=np.intp)
        apart = cars.middle_m[:, None] - cars.middle_m[obstacles]
        close = (apart * apart).sum(axis=2) < _SEEN_M**2
        close[obstacles, np.arange(len(obstacles))] = False
        drives = cars.speed_m_s >= _STANDS_M_S
        numbers = list(index)
        for at in np.flatnonzero(close.any(axis=1) & drives).tolist():
            number, near = numbers[at], obstacles[close[at]]
            driver = self._drivers.get(number)
            if driver is not None and driver.is_off and (driver.noticed or not driver.runs):
                continue
            driver = self._driver(number)
            ahead = self._ahead(number, now, cars, at, near)
            if math.isinf(ahead[0]):
                driver.needed_since_s = math.inf
                continue
            planned = float(cars.acceleration_m_s2[at])
            wish = self._follow(number, now, cars, at, ahead)
            if not driver.is_off and number != self._moved_in_time:
                as_ever = self._followed(number, now, cars, near)
                if wish < min(planned, as_ever - _NOTICED_M_S2):
                    self._leave(number, now, cars, index)
                    driver.reacts_at_s = now + driver.unwarned_s
                continue
            if wish > min(planned, 0.0) - _NEEDED_M_S2:
                driver.needed_since_s = math.inf
                continue
            driver.needed_since_s = min(driver.needed_since_s, now)
            if now - driver.needed_since_s >= driver.unwarned_s - 1e-9:
                if not driver.is_off:
                    self._leave(number, now, cars, index)
                driver.noticed = True

    def _followed(self, number: int, now: float, cars: Cars, others: NDArray[np.intp]) -> float:
        """What the intelligent driver does behind `others` where the recording has them."""
        recorded = self._recording.cars_at(now)
        own = recorded.names.index(self._name(number))
        there = [
            recorded.index(cars.names[i])
            for i in others
            if self._numbers[cars.names[i]] != self._moved_in_time
        ]
        which = np.array([i for i in there if i is not None], dtype=np.intp)
        ahead = self._ahead(number, now, recorded, own, which)
        return self._follow(number, now, recorded, own, ahead)

    def _way_m(self, number: int, now: float) -> float:
        driver = self._driver(number)
        recorded_s = self._recorded_s(number, now)
        return driver.way_m if driver.is_off else driver.path.way_m(recorded_s)

    def _recorded_s(self, number: int, now: float) -> float:
        """The moment of a drive that would be now: another for one that is moved in time."""
        event = self._event
        return now + (event.sooner_s if event is not None and event.car == number else 0.0)

    def _ahead(
        self, number: int, now: float, cars: Cars, at: int, others: NDArray[np.intp]
    ) -> tuple[float, float]:
        """Gap to whoever of `others` is nearest on his way, and how fast it shrinks."""
        driver, way_m = self._driver(number), self._way_m(number, now)
        gaps = blocked_at_m(driver.path, way_m, cars, at, others)
        if not np.isfinite(gaps).any():
            return math.inf, 0.0
        nearest = int(others[gaps.argmin()])
        along = math.cos(cars.heading_rad[nearest] - cars.heading_rad[at])
        closing = float(cars.speed_m_s[at]) - float(cars.speed_m_s[nearest]) * max(along, 0.0)
        return max(float(gaps.min()), 0.1), closing

    def _follow(
        self, number: int, now: float, cars: Cars, at: int, ahead: tuple[float, float]
    ) -> float:
        """What the gap ahead asks for of the intelligent driver, be it more than brakes can do."""
        speed = float(cars.speed_m_s[at])
        wished = max(self._driver(number).path.speed_m_s(self._way_m(number, now)), 2.0)
        gap, closing = ahead
        return float(
            idm_acceleration(
                np.array(speed), np.array(max(wished, speed)), np.array(gap), np.array(closing),
                COMFORTABLE_M_S2, self._unbounded,
            )
        )  # fmt: skip

    def _wish(self, number: int, now: float, cars: Cars, at: int) -> float:
        driver = self._drivers[number]
        if driver.event_braking_m_s2 > 0.0:
            return -driver.event_braking_m_s2
        is_warned = driver.brakes_at_s <= now <= driver.brakes_until_s
        warned = -driver.braking_m_s2 if is_warned else math.inf
        driver.noticed |= is_warned
        if driver.runs and not driver.noticed:
            gathers = driver.sets_off and driver.speed_m_s < SETTING_OFF_TO_M_S
            return min(warned, SETTING_OFF_M_S2 if gathers else 0.0)
        recorded_s = self._recorded_s(number, now)
        if now < driver.reacts_at_s - 1e-9 and not driver.noticed:
            return min(warned, driver.path.acceleration_m_s2(recorded_s), 0.0)
        near = np.hypot(*(cars.middle_m - cars.middle_m[at]).T) < _SEEN_M
        near[at] = False
        others = np.flatnonzero(near)
        ahead = self._ahead(number, now, cars, at, others)
        waits_m = driver.path.waits_m(driver.way_m, recorded_s)
        waits_m = max(waits_m + self._reactions.following.standing_gap_m, 0.1)
        if waits_m < ahead[0]:
            ahead = waits_m, driver.speed_m_s
        follows = self._follow(number, now, cars, at, ahead)
        wish = min(warned, max(follows, -self._reactions.following.hardest_deceleration_m_s2))
        if driver.speed_m_s >= _STANDS_M_S and not driver.runs:
            if not driver.noticed:
                return wish
            others = np.array([i for i in others if self.is_disturbed(cars.names[i])], np.intp)
        ways_m = driver.way_m + driver.speed_m_s * _AHEAD_S + max(wish, 0.0) * _AHEAD_S**2 / 2.0
        meets = would_meet(driver.path, ways_m, _AHEAD_S, cars, at, others)
        return min(wish, -driver.braking_m_s2) if meets else wish

    def _counts(self, name: str, other: str) -> bool:
        """Whether a touch of these two has to do with the event."""
        disturbed = self.is_disturbed(name) or self.is_disturbed(other)
        return disturbed and frozenset((name, other)) not in self._ignored

    def _overlapping(self, cars: Cars) -> set[frozenset[str]]:
        """Pairs that overlap in the recording itself, and are no crash of ours."""
        return {
            frozenset((cars.names[i], cars.names[j]))
            for i, j in boxes_overlap(cars)
            if not self.is_disturbed(cars.names[i]) and not self.is_disturbed(cars.names[j])
        }
