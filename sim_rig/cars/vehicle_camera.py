"""A camera with a vehicle detector, of virtual runs: cars from every side, and their errors.

A car is found by the point of its outline that is nearest to the camera, `FACE_TO_CENTRE_M` before
its middle in the mean; nearer cars hide it, some pictures miss it, and now and then there is a car
in one picture where there is none.
"""

import math
from collections.abc import Callable, Mapping

import numpy as np

from onboard.observations import VehicleDetection
from sim_rig.roads.road import CarState
from sim_rig.scenario.sensor_settings import VehicleCameraSettings

FPS = 10.0
STEADY_SHARE = 0.2
"""Of the range's variance: a car's size is not what the detector takes it for, and stays so."""
_FALSE_IDS = 1_000_000
_Span = tuple[float, float]
"""Bearings from the leftmost to the rightmost, rad."""


class VehicleCamera:
    """What the camera of one car says of all others in a picture."""

    def __init__(
        self,
        settings: VehicleCameraSettings,
        car: str,
        cars_at: Callable[[float], Mapping[str, CarState]],
        rng: np.random.Generator,
    ) -> None:
        """Look out of `car`; `cars_at` says where all cars are."""
        self._settings = settings
        self._car = car
        self._cars_at = cars_at
        self._rng = rng
        self._steady: dict[str, float] = {}
        """The share of each car's range error that stays, in standard deviations."""
        self._ids: dict[str, int] = {}
        self._false_ids = _FALSE_IDS

    def look(self, picture_at: float) -> list[VehicleDetection]:
        """One picture."""
        seen: list[VehicleDetection] = []
        hidden: list[_Span] = []
        cars = self._cars_at(picture_at)
        own = cars[self._car]
        others = sorted(
            ((_outline(own, state), name) for name, state in cars.items() if name != self._car),
            key=lambda each: each[0][0],
        )
        for (range_m, bearing_rad, span), name in others:
            # Always the same number of draws: settings change fates, not the fates of others.
            missed = self._rng.random()
            range_error, bearing_error = self._rng.standard_normal(2)
            if name not in self._steady:
                self._steady[name] = float(self._rng.standard_normal())
                self._ids[name] = len(self._ids)
            if (
                self._is_in_view(range_m, span)
                and _hidden_share(span, hidden) < self._settings.hidden_share
                and missed >= self._settings.misses
            ):
                steady = math.sqrt(STEADY_SHARE) * self._steady[name]
                error = steady + math.sqrt(1.0 - STEADY_SHARE) * float(range_error)
                sigma_m = self._settings.range_sigma * range_m
                sensed = self._sensed(
                    self._ids[name],
                    range_m + sigma_m * error,
                    bearing_rad + self._settings.bearing_sigma_rad * float(bearing_error),
                    picture_at,
                )
                seen.append(sensed)
            hidden.append(span)
        return seen + self._false_detections(picture_at)

    def _is_in_view(self, range_m: float, span: _Span) -> bool:
        half_rad = math.radians(self._settings.view_deg) / 2.0
        return range_m <= self._settings.sight_m and -half_rad <= span[0] and span[1] <= half_rad

    def _false_detections(self, stamp_s: float) -> list[VehicleDetection]:
        settings = self._settings
        found = []
        for _ in range(self._rng.poisson(settings.false_detections_per_s / FPS)):
            self._false_ids += 1
            half_rad = math.radians(settings.view_deg) / 2.0
            range_m = float(self._rng.uniform(5.0, settings.sight_m))
            bearing_rad = float(self._rng.uniform(-half_rad, half_rad))
            found.append(self._sensed(self._false_ids, range_m, bearing_rad, stamp_s))
        return found

    def _sensed(
        self, track_id: int, range_m: float, bearing_rad: float, stamp_s: float
    ) -> VehicleDetection:
        return VehicleDetection(
            stamp_s=stamp_s,
            track_id=track_id,
            range_m=max(range_m, 0.5),
            range_sigma_m=self._settings.range_sigma * range_m,
            bearing_rad=bearing_rad,
            bearing_sigma_rad=self._settings.bearing_sigma_rad,
        )


def _outline(own: CarState, other: CarState) -> tuple[float, float, _Span]:
    """Range and bearing of the middle of what shows of a car, and where it begins and ends.

    The range is what a detector makes of it: that of the middle, less half of what the car's
    extent is along the line of sight.
    """
    ahead_m, right_m = own.seen_from_front(other.x_m, other.y_m)
    bearing_rad = math.atan2(right_m, ahead_m)
    turned = other.heading_rad - own.heading_rad - bearing_rad
    depth_m = abs(other.length_m * math.cos(turned)) + abs(other.width_m * math.sin(turned))
    corners = [
        own.seen_from_front(*other.point(along * other.length_m / 2, across * other.width_m / 2))
        for along in (-1, 1)
        for across in (-1, 1)
    ]
    off = [_turn(math.atan2(right, ahead) - bearing_rad) for ahead, right in corners]
    span = bearing_rad + min(off), bearing_rad + max(off)
    return math.hypot(ahead_m, right_m) - depth_m / 2.0, bearing_rad, span


def _turn(angle_rad: float) -> float:
    return (angle_rad + math.pi) % math.tau - math.pi


def _hidden_share(span: _Span, nearer: list[_Span]) -> float:
    """How much of `span` nearer cars cover."""
    covered, reached = 0.0, span[0]
    for left, right in sorted(nearer):
        begin, end = max(left, reached), min(right, span[1])
        if end > begin:
            covered += end - begin
            reached = end
    return covered / (span[1] - span[0])
