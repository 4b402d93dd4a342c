"""The channel between the radios of a platoon: random losses, or a channel with access."""

import heapq
import math
from collections.abc import Collection, Iterator, Sequence
from itertools import compress, count

import numpy as np

from onboard.messages.lcca import LccaMessage, encode
from sim_rig.roads.cars import Array, Cars
from sim_rig.scenario.radio_settings import ChannelSettings
from sim_rig.studies.radio.lossy_reach import LossyReach
from sim_rig.studies.radio.study_channel import BSM_BYTES, StudyChannel

CHANNEL_STEP_S = 0.002
"""Step of a study with the 802.11p channel: shorter than the slots of LCCA's forwarding."""
_TRANSMISSION_S = 0.002
"""Duration of a transmission where the channel is not simulated."""
_BSM_INTERVAL_S = 0.1
_BSM_PRIORITY = 5
_BACKGROUND_RANGE_M = 500.0
_BACKGROUND_LATERAL_M = 4.0


class LossyChannel:
    """Every radio in range receives a message, unless it loses its copy."""

    def __init__(self, positions_m: Array, radios: Sequence[int], reach: LossyReach) -> None:
        """Connect the radios of a platoon.

        Args:
            positions_m: (cars,) positions along the road.
            radios: numbers of the cars with a radio.
            reach: decides who receives.
        """
        self._reach = reach
        self._radios = radios
        self._apart_m = {car: np.abs(positions_m - positions_m[car]) for car in radios}
        self._bsms_at = -math.inf
        self._in_transmission: list[tuple[float, int, int, LccaMessage]] = []
        self._order = count()

    def send(self, car: int, message: LccaMessage, now: float) -> None:
        """Broadcast a message.

        Args:
            car: number of the sender.
            message: of LCCA.
            now: time of sending.
        """
        for other in self._reached(car):
            heapq.heappush(
                self._in_transmission, (now + _TRANSMISSION_S, next(self._order), other, message)
            )

    def received(self, now: float) -> Iterator[tuple[LccaMessage, list[int]]]:
        """The messages received until `now`, each with its receivers."""
        while self._in_transmission and self._in_transmission[0][0] <= now:
            _, _, car, message = heapq.heappop(self._in_transmission)
            yield message, [car]

    def bsms_received(self, now: float) -> Iterator[tuple[int, list[int]]]:
        """The senders of the BSMs received until `now`, each with its receivers."""
        if now >= self._bsms_at:
            self._bsms_at = now + _BSM_INTERVAL_S
            yield from ((car, self._reached(car)) for car in self._radios)

    def reached_by_flooding(self, car: int) -> int:
        """Number of messages if every receiver repeats a message once."""
        reached, fresh = {car}, [car]
        while fresh:
            receivers = self._reached(fresh.pop(), but=reached)
            reached.update(receivers)
            fresh += receivers
        return len(reached)

    def _reached(self, car: int, but: Collection[int] = ()) -> list[int]:
        others = [other for other in self._radios if other != car and other not in but]
        return list(compress(others, self._reach.received(self._apart_m[car][others])))


class PlatoonChannel:
    """A channel with access, with background traffic around the platoon.

    Every radio sends BSMs ten times a second at its own phase.
    """

    def __init__(
        self,
        settings: ChannelSettings,
        positions_m: Array,
        radios: Sequence[int],
        background_traffic: int,
        rng: np.random.Generator,
        *,
        begin_s: float,
    ) -> None:
        """Place platoon and background traffic.

        Args:
            settings: of the channel.
            positions_m: (cars,) positions of the platoon along the road.
            radios: numbers of the platoon's cars with a radio.
            background_traffic: number of other cars with a radio.
            rng: source of positions, phases and backoffs.
            begin_s: time at which the channel begins; may be negative.
        """
        self._begin_s = begin_s
        self._numbers = {str(car): car for car in radios}
        others = [f"background{number}" for number in range(background_traffic)]
        names_with_radio = [*self._numbers, *others]
        low, high = positions_m.min() - _BACKGROUND_RANGE_M, positions_m.max() + _BACKGROUND_RANGE_M
        x = np.concatenate([positions_m, rng.uniform(low, high, background_traffic)])
        y = np.concatenate(
            [np.zeros(len(positions_m)), np.full(background_traffic, _BACKGROUND_LATERAL_M)]
        )
        n = len(x)
        names = tuple(map(str, range(len(positions_m)))) + tuple(others)
        # All cars have the same speed, so their relative positions are constant.
        cars = Cars(0.0, names, np.stack([x, y], axis=1), *np.zeros((3, n)), *np.full((2, n), 2.0))
        self._bsms: list[tuple[int, list[int]]] = []
        self._channel: StudyChannel[LccaMessage | str] = StudyChannel(
            settings, names_with_radio, rng
        )
        self._channel.place(cars)
        self._waiting: list[tuple[float, int, str, LccaMessage | str]] = []
        """Time, order, sender, and an LCCA message or, for a BSM, the sender."""
        self._order = count()
        for name in names_with_radio:
            self._wait(float(rng.uniform(0.0, _BSM_INTERVAL_S)), name, name)
        # Real cars are not synchronised; delay each car's messages by its own part of a step.
        self._phase_s = {name: float(rng.uniform(0.0, CHANNEL_STEP_S)) for name in names_with_radio}

    def send(self, car: int, message: LccaMessage, now: float) -> None:
        """Queue a message in a radio.

        Args:
            car: number of the sender.
            message: of LCCA.
            now: time of queueing.
        """
        self._wait(now - self._begin_s + self._phase_s[str(car)], str(car), message)

    def received(self, now: float) -> Iterator[tuple[LccaMessage, list[int]]]:
        """The LCCA messages received until `now`, each with its receivers in the platoon."""
        since_s = now - self._begin_s
        while self._waiting and self._waiting[0][0] <= since_s:
            at_s, _, name, message = heapq.heappop(self._waiting)
            if isinstance(message, str):
                self._channel.send(name, message, BSM_BYTES, _BSM_PRIORITY, at_s)
                self._wait(at_s + _BSM_INTERVAL_S, name, message)
            else:
                octets = len(encode(message))
                self._channel.send(name, message, octets, message.user_priority, at_s)
        for message, receivers in self._channel.received(since_s):
            cars = [self._numbers[name] for name in receivers if name in self._numbers]
            if not isinstance(message, str):
                yield message, cars
            elif message in self._numbers:
                self._bsms.append((self._numbers[message], cars))

    def bsms_received(self, _now: float) -> Iterator[tuple[int, list[int]]]:
        """The senders in the platoon of the BSMs received since the last call, with receivers."""
        bsms, self._bsms = self._bsms, []
        yield from bsms

    def _wait(self, at_s: float, name: str, message: LccaMessage | str) -> None:
        heapq.heappush(self._waiting, (at_s, next(self._order), name, message))
