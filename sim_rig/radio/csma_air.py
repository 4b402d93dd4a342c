"""The 802.11p channel under the radio units, without I/O: names and bytes around `Channel`."""

import heapq
import math
from itertools import count

import numpy as np

from sim_rig.propagation.shadowing import VehicleShadowing
from sim_rig.radio.air import LOOK_EVERY_S, CarsAt, Delivery
from sim_rig.radio.channel import Channel
from sim_rig.roads.road import CarState
from sim_rig.scenario.radio_settings import CsmaSettings


class CsmaAir:
    """Carries each frame to everybody who hears it, when the channel is free for its sender."""

    def __init__(
        self, settings: CsmaSettings, cars_at: CarsAt, units: list[str], rng: np.random.Generator
    ) -> None:
        """Join `units`, the cars that have a radio; `cars_at(now)` says where they are."""
        self._cars_at = cars_at
        self._units = units
        self._index = {unit: index for index, unit in enumerate(units)}
        self._channel = Channel(settings, len(units), rng)
        self._looked = -1
        self._carried: dict[int, tuple[int, bytes]] = {}
        self._order = count()
        self._in_flight: list[Delivery] = []

    def receive_wsm(self, sender: str, wsm: bytes, user_priority: int, now: float) -> None:
        """The unit of `sender` is given a frame to transmit."""
        self._look(now)
        number = self._channel.receive_frame(self._index[sender], len(wsm), user_priority, now)
        self._carried[number] = user_priority, wsm

    def wsms_to_deliver(self, now: float) -> list[Delivery]:
        """The copies that have arrived by now, in order."""
        self._channel.handle_timer(now)
        while (reception := self._channel.next_event()) is not None:
            user_priority, wsm = self._carried.pop(reception.number)
            sender = self._units[reception.sender]
            for receiver, at_s in zip(reception.receivers, reception.at_s, strict=True):
                delivery = Delivery(
                    float(at_s),
                    next(self._order),
                    sender,
                    self._units[receiver],
                    user_priority,
                    wsm,
                )
                heapq.heappush(self._in_flight, delivery)
        arrived: list[Delivery] = []
        while self._in_flight and self._in_flight[0].at_s <= now:
            arrived.append(heapq.heappop(self._in_flight))
        return arrived

    def get_timer(self) -> float:
        """Return when the channel has an event or the next copy arrives; `math.inf` for neither."""
        arrives_at = self._in_flight[0].at_s if self._in_flight else math.inf
        return min(self._channel.get_timer(), arrives_at)

    def _look(self, now: float) -> None:
        """See where the cars are, if they were not looked at just now."""
        moment = math.floor(now / LOOK_EVERY_S)
        if moment != self._looked:
            self._looked = moment
            cars = self._cars_at(now)
            self._channel.receive_positions(
                np.array([_middle_m(cars[unit]) for unit in self._units]),
                VehicleShadowing(
                    np.array([_middle_m(car) for car in cars.values()]),
                    np.array([car.width_m for car in cars.values()]),
                    np.array([car.height_m for car in cars.values()]),
                ),
            )


def _middle_m(car: CarState) -> tuple[float, float]:
    return car.x_m, car.y_m
