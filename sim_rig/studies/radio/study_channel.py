"""A channel with access for studies: it carries Python values, whose encoded length is given."""

from collections.abc import Iterator, Sequence
from typing import Generic, TypeVar

import numpy as np

from sim_rig.propagation.shadowing import VehicleShadowing
from sim_rig.radio.broadcast_channel import broadcast_channel
from sim_rig.roads.cars import Cars
from sim_rig.scenario.radio_settings import ChannelSettings

SECURED_BYTES = 110
"""Octets that WSMP and a 1609.2 signature with a digest add to a message."""
BSM_BYTES = 40
"""Octets of Part I of a BSM in UPER."""
_HEIGHT_M = 1.5
ValueT = TypeVar("ValueT")


class StudyChannel(Generic[ValueT]):
    """Stations are addressed by the names of their cars; absent cars receive nothing."""

    def __init__(
        self, settings: ChannelSettings, names: Sequence[str], rng: np.random.Generator
    ) -> None:
        """Create a station for each car.

        Args:
            settings: of the channel.
            names: cars with a radio.
            rng: source of fading and backoffs.
        """
        self._names = tuple(names)
        self._station = {name: at for at, name in enumerate(names)}
        self._channel = broadcast_channel(settings, len(names), rng)
        self._in_transmission: dict[int, ValueT] = {}

    def place(self, cars: Cars) -> None:
        """Set the positions of all cars; those without a radio shadow the others."""
        positions_m = np.full((len(self._names), 2), np.nan)
        for at, name in enumerate(cars.names):
            if name in self._station:
                positions_m[self._station[name]] = cars.middle_m[at]
        height_m = np.full(len(cars), _HEIGHT_M)
        self._channel.receive_positions(
            positions_m, VehicleShadowing(cars.middle_m, cars.width_m, height_m)
        )

    def send(self, name: str, value: ValueT, octets: int, priority: int, now: float) -> None:
        """Queue a value in a station.

        Args:
            name: car of the station.
            value: what is delivered to the receivers.
            octets: length of the message without WSMP and security.
            priority: user priority (IEEE 802.1D).
            now: time of queueing.
        """
        station = self._station[name]
        number = self._channel.receive_frame(station, octets + SECURED_BYTES, priority, now)
        self._in_transmission[number] = value

    def received(self, now: float) -> Iterator[tuple[ValueT, tuple[str, ...]]]:
        """The values sent until `now`, each with its receivers, which may be none."""
        self._channel.handle_timer(now)
        while (reception := self._channel.next_event()) is not None:
            yield (
                self._in_transmission.pop(reception.number),
                tuple(self._names[at] for at in reception.receivers.tolist()),
            )
