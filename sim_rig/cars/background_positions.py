"""Positions of the background traffic that a source drives around the scenario's cars."""

import math
from collections.abc import Mapping

import numpy as np

from onboard.observations import Position
from sim_rig.radio.air import CarsAt
from sim_rig.roads.earth import ORIGIN_HEIGHT_M, to_degrees
from sim_rig.roads.road import CarState
from sim_rig.roads.sources import open_traffic
from sim_rig.scenario.background_settings import BackgroundSettings
from sim_rig.scenario.sensor_settings import ReceiverSettings

_ERRORS = ReceiverSettings()
"""Of each car's receiver; its slow error stays for the run."""


class BackgroundPositions:
    """The cars of a source of traffic that are nearest to the scenario's cars at the start."""

    def __init__(
        self, settings: BackgroundSettings, cars_at: CarsAt, rng: np.random.Generator
    ) -> None:
        """Open the source, and let it drive until the scenario starts.

        Args:
            settings: the source.
            cars_at: states of the scenario's cars, by time since its start, s.
            rng: source of all random numbers.

        Raises:
            UserError: the source does not exist, or cannot be run.
        """
        self._from_s = settings.from_s
        self._rng = rng

        def guests(at_s: float) -> Mapping[str, CarState]:
            return cars_at(at_s - settings.from_s) if at_s >= settings.from_s else {}

        self._traffic = open_traffic(settings.source, rng, guests)
        cars = self._traffic.cars_at(settings.from_s)
        own = np.array([(state.x_m, state.y_m) for state in cars_at(0.0).values()])
        off_m = np.hypot(*(cars.middle_m[:, None] - own).T).min(axis=0)
        self._names = [cars.names[index] for index in np.argsort(off_m, kind="stable")]
        """By the number of the car."""
        self._bias_m = _ERRORS.bias_sigma_m * rng.standard_normal((len(cars), 2))

    def position(self, number: int, at_s: float, now: float) -> Position | None:
        """Return what a car's receiver tells; `None` while it is not on the road.

        Args:
            number: of the car, 0 for the nearest.
            at_s: time since the start of the scenario, s; not before that of the last call.
            now: the same on the clock of the cores.
        """
        if at_s <= 0.0 or number >= len(self._names):
            return None
        cars = self._traffic.cars_at(self._from_s + at_s)
        index = cars.index(self._names[number])
        if index is None:
            return None
        noise_m = _ERRORS.noise_sigma_m * self._rng.standard_normal(2)
        place = to_degrees(*(cars.middle_m[index] + self._bias_m[number] + noise_m))
        latitude_deg, longitude_deg = map(float, place)
        return Position(
            stamp_s=now,
            latitude_deg=latitude_deg,
            longitude_deg=longitude_deg,
            altitude_m=ORIGIN_HEIGHT_M,
            sigma_m=math.hypot(_ERRORS.bias_sigma_m, _ERRORS.noise_sigma_m),
            speed_m_s=float(cars.speed_m_s[index]),
            course_rad=float((math.pi / 2.0 - cars.heading_rad[index]) % (2.0 * math.pi)),
        )

    def close(self) -> None:
        """End the source."""
        self._traffic.close()
