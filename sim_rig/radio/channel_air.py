"""A channel with access between the radio units: maps names and bytes to stations and sizes."""

import heapq
import math
from itertools import count

import numpy as np

from sim_rig.propagation.shadowing import VehicleShadowing
from sim_rig.radio.air import POSITION_INTERVAL_S, CarsAt, Delivery
from sim_rig.radio.broadcast_channel import broadcast_channel
from sim_rig.roads.road import CarState
from sim_rig.scenario.radio_settings import ChannelSettings


class ChannelAir:
    """Delivers each frame to the units that receive it."""

    def __init__(
        self, settings: ChannelSettings, cars_at: CarsAt, units: list[str], rng: np.random.Generator
    ) -> None:
        """Open the channel.

        Args:
            settings: parameters of the channel.
            cars_at: states of all cars at a `now`.
            units: names of the cars with a radio.
            rng: source of backoffs, fading and losses.
        """
        self._cars_at = cars_at
        self._units = units
        self._index = {unit: index for index, unit in enumerate(units)}
        self._channel = broadcast_channel(settings, len(units), rng)
        self._updated = -1
        self._carried: dict[int, tuple[int, bytes]] = {}
        self._order = count()
        self._in_flight: list[Delivery] = []

    def receive_wsm(self, sender: str, wsm: bytes, user_priority: int, now: float) -> None:
        """Queue a frame at its sender.

        Args:
            sender: name of the sending car.
            wsm: the frame.
            user_priority: its user priority, 0 to 7.
            now: monotonic time, s.
        """
        self._update_positions(now)
        number = self._channel.receive_frame(self._index[sender], len(wsm), user_priority, now)
        self._carried[number] = user_priority, wsm

    def wsms_to_deliver(self, now: float) -> list[Delivery]:
        """Return the copies that have arrived by `now`, in order."""
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

    def _update_positions(self, now: float) -> None:
        """Update the positions of the stations, once per `POSITION_INTERVAL_S`."""
        moment = math.floor(now / POSITION_INTERVAL_S)
        if moment != self._updated:
            self._updated = moment
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
