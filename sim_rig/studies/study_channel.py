"""The 802.11p channel under a study: what is sent are values, of which only the length matters."""

from collections.abc import Iterator, Sequence
from typing import Generic, TypeVar

import numpy as np

from sim_rig.propagation.shadowing import VehicleShadowing
from sim_rig.radio.channel import Channel
from sim_rig.roads.cars import Cars
from sim_rig.scenario.radio_settings import CsmaSettings

SECURED_BYTES = 110
"""What WSMP and a 1609.2 signature with a digest add to a message."""
BSM_BYTES = 40
"""Part I of a BSM in UPER."""
_HEIGHT_M = 1.5
ValueT = TypeVar("ValueT")


class StudyChannel(Generic[ValueT]):
    """Stations are known by the names of their cars; those that are not there hear nothing."""

    def __init__(
        self, settings: CsmaSettings, names: Sequence[str], rng: np.random.Generator
    ) -> None:
        """Give each of `names` a radio."""
        self._names = tuple(names)
        self._station = {name: at for at, name in enumerate(names)}
        self._channel = Channel(settings, len(names), rng)
        self._on_air: dict[int, ValueT] = {}

    def place(self, cars: Cars) -> None:
        """Where everybody is from now on; cars without a radio may stand between."""
        places = np.full((len(self._names), 2), np.nan)
        for at, name in enumerate(cars.names):
            if name in self._station:
                places[self._station[name]] = cars.middle_m[at]
        height_m = np.full(len(cars), _HEIGHT_M)
        self._channel.receive_positions(
            places, VehicleShadowing(cars.middle_m, cars.width_m, height_m)
        )

    def send(self, name: str, value: ValueT, octets: int, priority: int, now: float) -> None:
        """Give a station something to send as soon as the channel lets it."""
        station = self._station[name]
        number = self._channel.receive_frame(station, octets + SECURED_BYTES, priority, now)
        self._on_air[number] = value

    def heard(self, now: float) -> Iterator[tuple[ValueT, tuple[str, ...]]]:
        """What has arrived by now, with those who have it; nobody, if it was lost for all."""
        self._channel.handle_timer(now)
        while (reception := self._channel.next_event()) is not None:
            yield (
                self._on_air.pop(reception.number),
                tuple(self._names[at] for at in reception.receivers.tolist()),
            )
