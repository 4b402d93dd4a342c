"""Recorded traffic with a dangerous event, and drivers that react to it, with or without a warning.

Each driver follows the recording until the event, a warning, or another car on its path that has
left the recording affects it. From then on, `driver.py` drives the car.
"""

import math

import numpy as np
from numpy.typing import NDArray
from typing_extensions import override

from sim_rig.roads.cars import Cars, Traffic
from sim_rig.roads.crashes import Crash, boxes_overlap, first_crash
from sim_rig.roads.driver import SEEN_M, STANDS_M_S, ReactionSettings, SimulatedDriver
from sim_rig.roads.events import TrafficEvent, TrafficEventKind
from sim_rig.roads.recording import STEP_S, RecordedTraffic

_NOTICED_M_S2 = 0.3
"""A driver on its recorded trajectory reacts when the needed deceleration exceeds that of the
recording by this; the low threshold includes brake lights, from which reaction times count."""


class DisturbedTraffic(Traffic):
    """Steps with the recording, `STEP_S` at a time; ends with the first crash."""

    def __init__(
        self,
        recording: RecordedTraffic,
        event: TrafficEvent | None,
        reactions: ReactionSettings,
        seed: int,
    ) -> None:
        """Add an event to a recording.

        Args:
            recording: the traffic.
            event: the event; `None` for none.
            reactions: distribution of the drivers' reactions.
            seed: seed of the drivers.
        """
        self._recording = recording
        self._event = event
        self._reactions = reactions
        self._seed = seed
        self._numbers = {drive.name: i for i, drive in enumerate(recording.drives)}
        self._drivers: dict[str, SimulatedDriver] = {}
        """Affected drivers by car, in the order in which they were affected."""
        self._event_car = None if event is None else recording.drives[event.car].name
        self._sooner_s = 0.0 if event is None else event.sooner_s
        self._moved_in_time = self._event_car if self._sooner_s else None
        """Car with a trajectory shifted in time, until it leaves that as well."""
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
            self._decide(before)
            self._step += 1
            self._cars = self._look(self._step * STEP_S)
            if self.crash is None:
                self.crash = first_crash(before, self._cars, self._counts)
            self._ignored |= self._overlapping(self._cars)
        return self._cars.moved_on(max(at_s - self._step * STEP_S, 0.0))

    def warn(self, name: str, at_s: float) -> None:
        """Warn the driver of a car, which brakes while the warning lasts."""
        self._driver(name).warn(at_s)

    def brake(self, name: str, begin_s: float, until_s: float, deceleration_m_s2: float) -> None:
        """Let a car brake by itself; replaces what earlier calls ask for from `begin_s` on."""
        self._driver(name).request(begin_s, until_s, deceleration_m_s2)

    def is_disturbed(self, name: str) -> bool:
        """Whether a car has left the recording."""
        if self._event is not None and name == self._moved_in_time:
            return self._step is not None and self._step * STEP_S > self._event.at_s
        driver = self._drivers.get(name)
        return driver is not None and driver.is_off

    def has_moved(self, name: str) -> bool:
        """Whether a car is that of the event, and the event has started."""
        return name == self._event_car and self.is_disturbed(name)

    def _driver(self, name: str) -> SimulatedDriver:
        driver = self._drivers.get(name)
        if driver is None:
            number = self._numbers[name]
            driver = self._drivers[name] = SimulatedDriver.drawn(
                self._reactions,
                np.random.default_rng([self._seed, number]),
                self._recording.drives[number],
                self._sooner_s if name == self._event_car else 0.0,
            )
        return driver

    def _look(self, at_s: float) -> Cars:
        """The recorded cars, with simulated states for those that left the recording."""
        cars = self._recording.cars_at(at_s)
        off = {name: driver for name, driver in self._drivers.items() if driver.is_off}
        if self._moved_in_time is not None and self._moved_in_time not in off:
            sooner = self._recording.cars_at(at_s + self._sooner_s)
            own = sooner.index(self._moved_in_time)
            cars = cars.without(self._moved_in_time)
            if own is not None:
                cars = cars.joined(sooner.only(np.array([own])))
        for name, driver in off.items():
            cars = cars.without(name)
            one = driver.car(at_s)
            if one is not None:
                cars = cars.joined(one)
        return cars

    def _decide(self, cars: Cars) -> None:
        """Determine which cars leave the recording, and drive those that have for one step."""
        places = {name: at for at, name in enumerate(cars.names)}
        self._begin_event(cars, places)
        for name, driver in self._drivers.items():
            brakes = driver.brakes_at_s <= cars.at_s or driver.requested_m_s2(cars.at_s) > 0.0
            if not driver.is_off and brakes and name in places:
                driver.leave(cars, places[name])
        disturbing = self._off(places)
        if self._moved_in_time in places and self._moved_in_time not in disturbing:
            disturbing = [self._moved_in_time, *disturbing]
        if disturbing:
            self._notice(np.array([places[name] for name in disturbing], dtype=np.intp), cars)
        off = [(self._drivers[name], places[name]) for name in self._off(places)]
        wishes = [driver.wish_m_s2(cars, at, self.is_disturbed) for driver, at in off]
        for (driver, _), wish_m_s2 in zip(off, wishes, strict=True):
            driver.drive(wish_m_s2)

    def _begin_event(self, cars: Cars, places: dict[str, int]) -> None:
        """Start the event when it is due."""
        event, name = self._event, self._event_car
        if event is None or name not in places or abs(event.at_s - cars.at_s) >= STEP_S / 2:
            return
        driver = self._driver(name)
        driver.event_braking_m_s2 = event.deceleration_m_s2
        driver.runs = event.kind is TrafficEventKind.RED_LIGHT
        driver.sets_off = event.sets_off
        if self._moved_in_time is None:
            driver.leave(cars, places[name])

    def _off(self, places: dict[str, int]) -> list[str]:
        return [name for name, driver in self._drivers.items() if driver.is_off and name in places]

    def _notice(self, disturbing: NDArray[np.intp], cars: Cars) -> None:
        """Let drivers near a disturbed car react to it after their reaction time."""
        apart = cars.middle_m[:, None] - cars.middle_m[disturbing]
        close = (apart * apart).sum(axis=2) < SEEN_M**2
        close[disturbing, np.arange(len(disturbing))] = False
        drives = cars.speed_m_s >= STANDS_M_S
        for at in np.flatnonzero(close.any(axis=1) & drives).tolist():
            driver = self._driver(cars.names[at])
            if not driver.has_seen:
                self._see(driver, cars, at, disturbing[close[at]])

    def _see(self, driver: SimulatedDriver, cars: Cars, at: int, near: NDArray[np.intp]) -> None:
        """Let a driver react to the disturbed cars near it if one is on its path."""
        ahead = driver.ahead(cars, at, near)
        if math.isinf(ahead.gap_m):
            driver.needed_since_s = math.inf
            return
        planned_m_s2 = float(cars.acceleration_m_s2[at])
        wish_m_s2 = driver.follow_m_s2(cars, at, ahead)
        if driver.is_off or cars.names[at] == self._moved_in_time:
            if driver.needs_to_brake(wish_m_s2, planned_m_s2, cars.at_s):
                if not driver.is_off:
                    driver.leave(cars, at)
                driver.noticed = True
            return
        as_ever_m_s2 = self._followed_m_s2(driver, cars, near)
        if wish_m_s2 < min(planned_m_s2, as_ever_m_s2 - _NOTICED_M_S2):
            driver.leave(cars, at)
            driver.reacts_at_s = cars.at_s + driver.unwarned_s

    def _followed_m_s2(
        self, driver: SimulatedDriver, cars: Cars, others: NDArray[np.intp]
    ) -> float:
        """Acceleration of the IDM behind the recorded states of `others`, m/s^2."""
        recorded = self._recording.cars_at(cars.at_s)
        own = recorded.names.index(driver.path.drive.name)
        there = [
            recorded.index(cars.names[i]) for i in others if cars.names[i] != self._moved_in_time
        ]
        which = np.array([i for i in there if i is not None], dtype=np.intp)
        return driver.follow_m_s2(recorded, own, driver.ahead(recorded, own, which))

    def _counts(self, name: str, other: str) -> bool:
        """Whether a contact of two cars is a consequence of the event."""
        disturbed = self.is_disturbed(name) or self.is_disturbed(other)
        return disturbed and frozenset((name, other)) not in self._ignored

    def _overlapping(self, cars: Cars) -> set[frozenset[str]]:
        """Pairs that overlap in the recording itself, which are not crashes."""
        return {
            frozenset((cars.names[i], cars.names[j]))
            for i, j in boxes_overlap(cars)
            if not self.is_disturbed(cars.names[i]) and not self.is_disturbed(cars.names[j])
        }
