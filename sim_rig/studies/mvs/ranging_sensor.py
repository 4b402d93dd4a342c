"""A ranging sensor of the MVS studies: who is in view, and what is measured of them."""

import math
from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from onboard.observations import VehicleDetection
from sim_rig.cars.vehicle_camera import REAR_VIEW_RAD
from sim_rig.roads.cars import Array, Cars
from sim_rig.roads.line_of_sight import Blocked
from sim_rig.studies.mvs.world_settings import WorldSettings


class RangingSensor:
    """Has a range, a field of view, noise and misses; cars and buildings hide what is behind."""

    def __init__(
        self, settings: WorldSettings, blocked: Blocked | None, rng: np.random.Generator
    ) -> None:
        """Sense with these properties.

        Args:
            settings: of all sensors.
            blocked: occlusion by buildings; None for none.
            rng: source of noise and misses.
        """
        self._settings = settings
        self._blocked = blocked
        self._rng = rng

    def detections(
        self, own: int, cars: Cars, number_of: Callable[[str], int], now: float
    ) -> Iterator[tuple[str, VehicleDetection]]:
        """Yield who is detected, by name, and as what; nobody without sensors.

        Args:
            own: index of the car that senses.
            cars: all cars.
            number_of: gives the track ID of a car.
            now: the time.
        """
        for other in self._in_view(own, cars).tolist() if self._settings.senses else ():
            name = cars.names[other]
            yield name, self._measured(own, other, cars, number_of(name), now)

    def _measured(
        self, own: int, other: int, cars: Cars, track_id: int, now: float
    ) -> VehicleDetection:
        settings = self._settings
        course_rad = math.pi / 2.0 - float(cars.heading_rad[own])
        apart_m = cars.middle_m[other] - cars.middle_m[own]
        east_m, north_m = apart_m.tolist()
        range_m = math.hypot(east_m, north_m)
        range_sigma_m = settings.range_sigma_m + settings.range_sigma_per_m * range_m
        bearing_rad = math.atan2(east_m, north_m) - course_rad
        detection = VehicleDetection(
            now,
            track_id,
            max(range_m + range_sigma_m * self._rng.normal(), 0.0),
            range_sigma_m,
            bearing_rad + settings.bearing_sigma_rad * self._rng.normal(),
            settings.bearing_sigma_rad,
        )
        rate_sigma_m_s = settings.range_rate_sigma_m_s
        if rate_sigma_m_s is None:
            return detection
        closing = cars.velocity_m_s[other] - cars.velocity_m_s[own]
        rate_m_s = float(closing @ apart_m) / range_m + rate_sigma_m_s * self._rng.normal()
        return replace(detection, range_rate_m_s=rate_m_s, range_rate_sigma_m_s=rate_sigma_m_s)

    def _in_view(self, own: int, cars: Cars) -> NDArray[np.intp]:
        here = cars.middle_m[own]
        ranges = np.hypot(*(cars.middle_m - here).T)
        near = np.flatnonzero((ranges < self._settings.sensing_range_m) & (ranges > 0.0))
        towards = cars.middle_m[near] - here
        lengths = ranges[near]
        # Of every other near car (axis 1): distance along the line of sight, and beside it.
        along = towards @ towards.T / lengths[:, None]
        beside = (
            np.abs(
                towards[:, None, 0] * towards[None, :, 1]
                - towards[:, None, 1] * towards[None, :, 0]
            )
            / lengths[:, None]
        )
        radius = self._settings.blocker_radius_m
        occluded = (beside < radius) & (along > 0) & (along < lengths[:, None] - 2 * radius)
        visible = ~occluded.any(axis=1)
        if self._blocked is not None:
            visible &= ~self._blocked(here, cars.middle_m[near])
        visible &= self._rng.random(len(near)) < self._settings.detection
        sight_rad = np.arctan2(towards[:, 1], towards[:, 0])
        half_rad = math.radians(self._settings.view_deg) / 2.0
        visible &= _between(sight_rad, cars.heading_rad[own]) <= half_rad
        if self._settings.rear_only:
            visible &= _between(sight_rad, cars.heading_rad[near]) <= REAR_VIEW_RAD
        in_view: NDArray[np.intp] = near[visible]
        return in_view


def _between(angles_rad: Array, others_rad: Array) -> Array:
    """Angles (n,) between directions, from 0 to pi."""
    between_rad: Array = np.abs((angles_rad - others_rad + np.pi) % (2.0 * np.pi) - np.pi)
    return between_rad
