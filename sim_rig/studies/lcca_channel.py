"""What is between the radios of a platoon: air that loses messages, or the 802.11p channel."""

import heapq
from collections.abc import Collection, Iterator, Sequence
from itertools import count

import numpy as np

from onboard.messages.lcca import LccaMessage, encode
from sim_rig.roads.cars import Array, Cars
from sim_rig.scenario.radio_settings import CsmaSettings
from sim_rig.studies.study_channel import BSM_BYTES, StudyChannel

CHANNEL_STEP_S = 0.002
"""Of a study with a channel: shorter than the slots in which a warning is passed on."""
_AIR_S = 0.002
"""What a message takes, where the channel is not computed."""
_BSM_INTERVAL_S = 0.1
_BSM_PRIORITY = 5
_AROUND_M = 500.0
_BESIDE_M = 4.0


class LossyAir:
    """Whoever is in reach hears a message, unless this copy of it is lost."""

    def __init__(
        self,
        places_m: Array,
        radios: Sequence[int],
        *,
        reach_m: float,
        loss: float,
        rng: np.random.Generator,
    ) -> None:
        """`places_m` of the platoon's cars, by number; `radios` are the numbers with a radio."""
        self._loss = loss
        self._rng = rng
        self._near = {
            car: [
                other
                for other in radios
                if other != car and abs(places_m[other] - places_m[car]) <= reach_m
            ]
            for car in radios
        }
        self._on_air: list[tuple[float, int, int, LccaMessage]] = []
        self._order = count()

    def send(self, car: int, message: LccaMessage, now: float) -> None:
        """A car says something."""
        for other in self._reached(car):
            heapq.heappush(self._on_air, (now + _AIR_S, next(self._order), other, message))

    def heard(self, now: float) -> Iterator[tuple[LccaMessage, list[int]]]:
        """The messages that have arrived by now, and who has them."""
        while self._on_air and self._on_air[0][0] <= now:
            _, _, car, message = heapq.heappop(self._on_air)
            yield message, [car]

    def reached_by_flooding(self, car: int) -> int:
        """Everybody who hears it repeats it once: as many messages as cars that it reaches."""
        reached, fresh = {car}, [car]
        while fresh:
            heard = self._reached(fresh.pop(), but=reached)
            reached.update(heard)
            fresh += heard
        return len(reached)

    def _reached(self, car: int, but: Collection[int] = ()) -> list[int]:
        return [
            other
            for other in self._near[car]
            if other not in but and self._rng.random() >= self._loss
        ]


class PlatoonChannel:
    """Around the platoon others drive with a radio, who only send BSMs.

    Every radio sends one ten times a second, at its own phase; nobody reads them here.
    """

    def __init__(
        self,
        settings: CsmaSettings,
        places_m: Array,
        radios: Sequence[int],
        around: int,
        rng: np.random.Generator,
        *,
        begin_s: float,
    ) -> None:
        """`places_m` of the platoon's cars, by number; `radios` are the numbers with a radio.

        The channel is used from `begin_s` on, which may be negative.
        """
        self._begin_s = begin_s
        self._numbers = {str(car): car for car in radios}
        others = [f"around{number}" for number in range(around)]
        names_with_radio = [*self._numbers, *others]
        low, high = places_m.min() - _AROUND_M, places_m.max() + _AROUND_M
        x = np.concatenate([places_m, rng.uniform(low, high, around)])
        y = np.concatenate([np.zeros(len(places_m)), np.full(around, _BESIDE_M)])
        n = len(x)
        names = tuple(map(str, range(len(places_m)))) + tuple(others)
        # Platoon and others drive alike, so nobody moves against anybody.
        cars = Cars(0.0, names, np.stack([x, y], axis=1), *np.zeros((3, n)), *np.full((2, n), 2.0))
        self._channel: StudyChannel[LccaMessage | None] = StudyChannel(
            settings, names_with_radio, rng
        )
        self._channel.place(cars)
        self._waiting: list[tuple[float, int, str, LccaMessage | None]] = []
        self._order = count()
        for name in names_with_radio:
            self._wait(float(rng.uniform(0.0, _BSM_INTERVAL_S)), name, None)
        # Cars act in steps that they have in common here, which no two real ones have.
        self._late_s = {name: float(rng.uniform(0.0, CHANNEL_STEP_S)) for name in names_with_radio}

    def send(self, car: int, message: LccaMessage, now: float) -> None:
        """Give a car's radio a message of LCCA."""
        self._wait(now - self._begin_s + self._late_s[str(car)], str(car), message)

    def heard(self, now: float) -> Iterator[tuple[LccaMessage, list[int]]]:
        """The messages of LCCA that have arrived by now, and who in the platoon has them."""
        since_s = now - self._begin_s
        while self._waiting and self._waiting[0][0] <= since_s:
            at_s, _, name, message = heapq.heappop(self._waiting)
            if message is None:
                self._channel.send(name, None, BSM_BYTES, _BSM_PRIORITY, at_s)
                self._wait(at_s + _BSM_INTERVAL_S, name, None)
            else:
                octets = len(encode(message))
                self._channel.send(name, message, octets, message.user_priority, at_s)
        for message, receivers in self._channel.heard(since_s):
            if message is not None:
                yield message, [self._numbers[name] for name in receivers if name in self._numbers]

    def _wait(self, at_s: float, name: str, message: LccaMessage | None) -> None:
        heapq.heappush(self._waiting, (at_s, next(self._order), name, message))
