"""Cars that only send BSMs, so that congestion control (SAE J2945/1) lowers the others' rates.

Each is a `Stack` without sensors but a GNSS receiver, if a source of traffic drives it. Its BSMs
reach all cars at once, whatever the channel model. Its stack is called twice a second only: enough
to count as a vehicle in range, about what SAE J2945/1 grants a hundred, and cheap to receive.
"""

import heapq
import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from onboard.observations import Sensor
from onboard.security.credentials import Credentials
from onboard.settings import parse_settings
from onboard.step import SentWsm
from onboard.vehicle.config import CarConfig
from onboard.vehicle.stack import Stack
from sim_rig.cars.background_positions import BackgroundPositions
from sim_rig.radio.air import Air, CarsAt, Delivery
from sim_rig.scenario.car_config import DIGEST, virtual_radio
from sim_rig.scenario.schema import Scenario

SEND_INTERVAL_S = 0.5
"""Interval of each car's BSMs."""


class BackgroundTraffic:
    """The channel of a scenario, with the BSMs of background traffic added."""

    def __init__(
        self,
        air: Air,
        scenario: Scenario,
        cars_at: CarsAt,
        at_s: Callable[[float], float],
        rng: np.random.Generator,
        *,
        now: float,
        utc_s: float,
        credentials: Mapping[str, Credentials],
    ) -> None:
        """Start the background traffic.

        Args:
            air: the channel between the equipped cars.
            scenario: the scenario of the run.
            cars_at: states of the scenario's cars, by time since its start, s.
            at_s: that time at a `now`; 0 or less before the start.
            rng: source of the random numbers of a source of traffic.
            now: monotonic time, s.
            utc_s: UTC at `now`, s.
            credentials: by name of the car; cars with credentials sign.
        """
        self._air = air
        self._at_s = at_s
        self._units = scenario.equipped
        names = background_names(scenario)
        self._cars = {name: _car(scenario, name, now, utc_s, credentials) for name in names}
        self._due = [
            (now + SEND_INTERVAL_S * (1.0 + index / len(names)), name)
            for index, name in enumerate(names)
        ]
        settings = scenario.traffic
        # Last, since an error of what follows would leave SUMO open.
        self._positions = None if settings is None else BackgroundPositions(settings, cars_at, rng)

    def receive_wsm(self, sender: str, wsm: bytes, user_priority: int, now: float) -> None:
        """Transmit a frame of an equipped car.

        Args:
            sender: name of the car.
            wsm: the frame.
            user_priority: its user priority.
            now: monotonic time, s.
        """
        self._air.receive_wsm(sender, wsm, user_priority, now)

    def wsms_to_deliver(self, now: float) -> list[Delivery]:
        """Return the copies that have arrived by `now`."""
        deliveries = self._air.wsms_to_deliver(now)
        while self._due and self._due[0][0] <= now:
            at_s, name = self._due[0]
            heapq.heapreplace(self._due, (at_s + SEND_INTERVAL_S, name))
            for wsm in self._wsms_of(name, now):
                deliveries += [
                    Delivery(now, 0, name, unit, wsm.user_priority, wsm.data)
                    for unit in self._units
                ]
        return deliveries

    def _wsms_of(self, name: str, now: float) -> Sequence[SentWsm]:
        """What a car sends; one that a source of traffic drives is silent while it is not there."""
        if self._positions is None:
            return self._cars[name].step((), now).wsms
        position = self._positions.position(_number(name), self._at_s(now), now)
        return [] if position is None else self._cars[name].step((position,), now).wsms

    def get_timer(self) -> float:
        """Return when the next frame arrives or is sent; `math.inf` when none is planned."""
        return min(self._due[0][0] if self._due else math.inf, self._air.get_timer())

    def close(self) -> None:
        """End the source of traffic."""
        if self._positions is not None:
            self._positions.close()


def background_names(scenario: Scenario) -> list[str]:
    """Names of the background cars in traces and certificates."""
    return [f"background{number}" for number in range(scenario.background_traffic)]


def _number(name: str) -> int:
    return int(name.removeprefix("background"))


def _car(
    scenario: Scenario,
    name: str,
    now: float,
    utc_s: float,
    credentials: Mapping[str, Credentials],
) -> Stack:
    number = _number(name)
    tree = {
        "car": {"plate": f"BG{number}"},
        "security": {"plate_digest": DIGEST},
        "radio": virtual_radio(scenario),
    }
    return Stack(
        parse_settings(tree, CarConfig, name),
        () if scenario.traffic is None else (Sensor.POSITION,),
        np.random.default_rng(number),
        now=now,
        utc_s=utc_s,
        credentials=credentials.get(name),
    )
