"""The air, with the radios that fail and the cars that lie; live and virtual runs share it."""

import math
from collections.abc import Callable, Mapping

from onboard.security.credentials import Credentials
from sim_rig.radio.air import Air, Delivery
from sim_rig.radio.attacker import Attacker
from sim_rig.scenario.faults import Attack
from sim_rig.scenario.schema import Scenario


class FaultyAir:
    """An `Air` around another one."""

    def __init__(
        self,
        air: Air,
        scenario: Scenario,
        at_s: Callable[[float], float],
        utc_offset_s: float,
        credentials: Mapping[str, Credentials],
    ) -> None:
        """Take the true air, the scenario's time and UTC at a `now`, and what cars sign with."""
        self._air = air
        self._scenario = scenario
        self._at_s = at_s
        self._liars = [
            Attacker(fault, at_s, utc_offset_s, credentials.get(fault.car))
            for fault in scenario.faults
            if isinstance(fault, Attack)
        ]

    def receive_wsm(self, sender: str, wsm: bytes, user_priority: int, now: float) -> None:
        """The unit of `sender` is given a frame to transmit."""
        if self._has("radio_mute", sender, now) or self._has("radio_gone", sender, now):
            return
        for liar in self._liars:
            liar.overhear(sender, wsm, user_priority, now)
        self._air.receive_wsm(sender, wsm, user_priority, now)

    def wsms_to_deliver(self, now: float) -> list[Delivery]:
        """The copies that have arrived by now, in order."""
        for liar in self._liars:
            for user_priority, wsm in liar.wsms_to_send(now):
                self._air.receive_wsm(liar.car, wsm, user_priority, now)
        return [
            delivery
            for delivery in self._air.wsms_to_deliver(now)
            if not self._has("radio_gone", delivery.receiver, now)
        ]

    def get_timer(self) -> float:
        """Return when the next frame arrives or is injected; `math.inf` when none is planned."""
        return min(self._air.get_timer(), *(liar.get_timer() for liar in self._liars), math.inf)

    def _has(self, what: str, car: str, now: float) -> bool:
        return self._scenario.has_fault(what, car, self._at_s(now))
