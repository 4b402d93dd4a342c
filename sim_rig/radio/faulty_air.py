"""The radio channel with faulty radios and attackers, for live and virtual runs."""

import math
from collections.abc import Callable, Mapping

from onboard.security.credentials import Credentials
from sim_rig.radio.air import Air, Delivery
from sim_rig.radio.attacker import Attacker
from sim_rig.scenario.faults import Attack
from sim_rig.scenario.schema import Scenario


class FaultyAir:
    """Adds radio faults and attacks to another `Air`."""

    def __init__(
        self,
        air: Air,
        scenario: Scenario,
        at_s: Callable[[float], float],
        utc_offset_s: float,
        credentials: Mapping[str, Credentials],
    ) -> None:
        """Wrap a channel.

        Args:
            air: the channel without faults.
            scenario: the scenario of the run.
            at_s: time since the start of the scenario at a `now`, s.
            utc_offset_s: UTC minus `now`, s.
            credentials: keys of the cars by name, for attackers.
        """
        self._air = air
        self._scenario = scenario
        self._at_s = at_s
        self._attackers = [
            Attacker(fault, at_s, utc_offset_s, credentials.get(fault.car))
            for fault in scenario.faults
            if isinstance(fault, Attack)
        ]

    def receive_wsm(self, sender: str, wsm: bytes, user_priority: int, now: float) -> None:
        """Transmit a frame unless the sender's radio has failed; attackers receive it.

        Args:
            sender: name of the sending car.
            wsm: the frame.
            user_priority: its user priority, 0 to 7.
            now: monotonic time, s.
        """
        if self._has("radio_mute", sender, now) or self._has("radio_gone", sender, now):
            return
        for attacker in self._attackers:
            attacker.overhear(sender, wsm, user_priority, now)
        self._air.receive_wsm(sender, wsm, user_priority, now)

    def wsms_to_deliver(self, now: float) -> list[Delivery]:
        """Return the copies that have arrived by `now`, in order."""
        for attacker in self._attackers:
            for user_priority, wsm in attacker.wsms_to_send(now):
                self._air.receive_wsm(attacker.car, wsm, user_priority, now)
        return [
            delivery
            for delivery in self._air.wsms_to_deliver(now)
            if not self._has("radio_gone", delivery.receiver, now)
        ]

    def get_timer(self) -> float:
        """Return when the next frame arrives or is injected; `math.inf` when none is planned."""
        return min(
            self._air.get_timer(), *(attacker.get_timer() for attacker in self._attackers), math.inf
        )

    def _has(self, what: str, car: str, now: float) -> bool:
        return self._scenario.has_fault(what, car, self._at_s(now))
