"""Cars around that only send BSMs: what makes a car that keeps to SAE J2945/1 talk less often.

Each is a `Stack` without sensors, and is heard by everybody at once, whatever the air is like. It
is asked only twice a second: that is enough to count as near, and cheap for whoever must listen.
"""

import heapq
import math
from collections.abc import Mapping

import numpy as np

from onboard.config import CarConfig
from onboard.security.credentials import Credentials
from onboard.settings import parse_settings
from onboard.stack import Stack
from sim_rig.radio.air import Air, Delivery
from sim_rig.scenario.car_config import DIGEST
from sim_rig.scenario.schema import Scenario

SENDS_EVERY_S = 0.5


class BackgroundTraffic:
    """The air of a scenario with a crowd's BSMs on top."""

    def __init__(
        self,
        air: Air,
        scenario: Scenario,
        *,
        now: float,
        utc_s: float,
        credentials: Mapping[str, Credentials],
    ) -> None:
        """Begin at `now`, which is `utc_s`; vehicles with `credentials` sign."""
        self._air = air
        self._units = scenario.equipped
        names = background_names(scenario)
        self._cars = {name: _car(name, now, utc_s, credentials) for name in names}
        self._due = [
            (now + SENDS_EVERY_S * (1.0 + index / len(names)), name)
            for index, name in enumerate(names)
        ]

    def receive_wsm(self, sender: str, wsm: bytes, user_priority: int, now: float) -> None:
        """The unit of `sender` is given a frame to transmit."""
        self._air.receive_wsm(sender, wsm, user_priority, now)

    def wsms_to_deliver(self, now: float) -> list[Delivery]:
        """The copies that have arrived by now."""
        deliveries = self._air.wsms_to_deliver(now)
        while self._due and self._due[0][0] <= now:
            at_s, name = self._due[0]
            heapq.heapreplace(self._due, (at_s + SENDS_EVERY_S, name))
            car = self._cars[name]
            car.handle_timer(now)
            for user_priority, wsm in car.wsms_to_send(now):
                deliveries += [
                    Delivery(now, 0, name, unit, user_priority, wsm) for unit in self._units
                ]
            while car.next_event() is not None:
                pass  # nobody reads its trace
        return deliveries

    def get_timer(self) -> float:
        """Return when the next frame arrives or is sent; `math.inf` when none is planned."""
        return min(self._due[0][0] if self._due else math.inf, self._air.get_timer())


def background_names(scenario: Scenario) -> list[str]:
    """What its cars are called, in logs and by the authority."""
    return [f"background{number}" for number in range(scenario.background_traffic)]


def _car(name: str, now: float, utc_s: float, credentials: Mapping[str, Credentials]) -> Stack:
    number = int(name.removeprefix("background"))
    tree = {"car": {"plate": f"BG{number}"}, "security": {"plate_digest": DIGEST}}
    return Stack(
        parse_settings(tree, CarConfig, name),
        (),
        np.random.default_rng(number),
        now=now,
        utc_s=utc_s,
        credentials=credentials.get(name),
    )
