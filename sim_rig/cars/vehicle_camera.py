"""Model of a camera or radar with a vehicle detector, with its errors.

Detections are of the visible side of a car, at any aspect angle. Nearer cars occlude it, some
images miss it, and some images have false detections.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from onboard.observations import VehicleDetection
from sim_rig.roads.road import CarState
from sim_rig.scenario.sensor_settings import VehicleCameraSettings

STEADY_SHARE = 0.2
"""Share of the range variance that is constant per car: the error of the assumed car size."""
REAR_VIEW_RAD = math.radians(60.0)
"""A rear plate is read at smaller angles to the line of sight."""
_FALSE_IDS = 1_000_000
_Span = tuple[float, float]
"""Leftmost and rightmost bearing, rad."""


class VehicleCamera:
    """The vehicle camera of one car."""

    def __init__(
        self,
        settings: VehicleCameraSettings,
        car: str,
        cars_at: Callable[[float], Mapping[str, CarState]],
        rng: np.random.Generator,
    ) -> None:
        """Mount the camera.

        Args:
            settings: field of view and errors.
            car: name of the host.
            cars_at: true states of all cars at a time, s.
            rng: source of the errors.
        """
        self._settings = settings
        self._car = car
        self._cars_at = cars_at
        self._rng = rng
        (self._rate_rng,) = rng.spawn(1)
        self._steady: dict[str, float] = {}
        """Constant part of each car's range error, in standard deviations."""
        self._ids: dict[str, int] = {}
        self._false_ids = _FALSE_IDS

    @property
    def interval_s(self) -> float:
        """From one image to the next."""
        return 1.0 / self._settings.rate_hz

    def detect(self, image_at: float) -> list[VehicleDetection]:
        """Return the detections of the image taken at `image_at`."""
        detections: list[VehicleDetection] = []
        nearer: list[_Span] = []
        cars = self._cars_at(image_at)
        own = cars[self._car]
        others = sorted(
            ((_outline(own, state), name) for name, state in cars.items() if name != self._car),
            key=lambda each: each[0][0],
        )
        for (range_m, bearing_rad, span), name in others:
            # The number of draws is constant, so that settings do not change other cars' errors.
            missed = self._rng.random()
            range_error, bearing_error = self._rng.standard_normal(2)
            if name not in self._steady:
                self._steady[name] = float(self._rng.standard_normal())
                self._ids[name] = len(self._ids)
            if (
                self._is_in_view(range_m, span)
                and (not self._settings.rear_only or _shows_rear(own, cars[name]))
                and _occluded_share(span, nearer) < self._settings.hidden_share
                and missed >= self._settings.misses
            ):
                steady = math.sqrt(STEADY_SHARE) * self._steady[name]
                error = steady + math.sqrt(1.0 - STEADY_SHARE) * float(range_error)
                sigma_m = self._range_sigma_m(range_m)
                detection = self._detection(
                    self._ids[name],
                    range_m + sigma_m * error,
                    bearing_rad + self._settings.bearing_sigma_rad * float(bearing_error),
                    image_at,
                )
                detections.append(self._with_range_rate(detection, own, cars[name]))
            nearer.append(span)
        return detections + self._false_detections(image_at)

    def _is_in_view(self, range_m: float, span: _Span) -> bool:
        half_rad = math.radians(self._settings.view_deg) / 2.0
        return range_m <= self._settings.sight_m and -half_rad <= span[0] and span[1] <= half_rad

    def _false_detections(self, stamp_s: float) -> list[VehicleDetection]:
        settings = self._settings
        found = []
        for _ in range(self._rng.poisson(settings.false_detections_per_s / settings.rate_hz)):
            self._false_ids += 1
            half_rad = math.radians(settings.view_deg) / 2.0
            range_m = float(self._rng.uniform(5.0, settings.sight_m))
            bearing_rad = float(self._rng.uniform(-half_rad, half_rad))
            found.append(self._detection(self._false_ids, range_m, bearing_rad, stamp_s))
        return found

    def _detection(
        self, track_id: int, range_m: float, bearing_rad: float, stamp_s: float
    ) -> VehicleDetection:
        return VehicleDetection(
            stamp_s=stamp_s,
            track_id=track_id,
            range_m=max(range_m, 0.5),
            range_sigma_m=self._range_sigma_m(range_m),
            bearing_rad=bearing_rad,
            bearing_sigma_rad=self._settings.bearing_sigma_rad,
        )

    def _range_sigma_m(self, range_m: float) -> float:
        return self._settings.range_sigma * range_m + self._settings.range_sigma_m

    def _with_range_rate(
        self, detection: VehicleDetection, own: CarState, other: CarState
    ) -> VehicleDetection:
        sigma_m_s = self._settings.range_rate_sigma_m_s
        if sigma_m_s is None:
            return detection
        rate_m_s = _range_rate_m_s(own, other) + sigma_m_s * self._rate_rng.standard_normal()
        return replace(detection, range_rate_m_s=rate_m_s, range_rate_sigma_m_s=sigma_m_s)


def _range_rate_m_s(own: CarState, other: CarState) -> float:
    """Change of the distance of two cars' middles."""
    east_m, north_m = other.x_m - own.x_m, other.y_m - own.y_m
    east_m_s, north_m_s = (
        other.speed_m_s * of(other.heading_rad) - own.speed_m_s * of(own.heading_rad)
        for of in (math.sin, math.cos)
    )
    return (east_m * east_m_s + north_m * north_m_s) / math.hypot(east_m, north_m)


def _shows_rear(own: CarState, other: CarState) -> bool:
    line_rad = math.atan2(other.x_m - own.x_m, other.y_m - own.y_m)
    return abs(_turn(other.heading_rad - line_rad)) <= REAR_VIEW_RAD


def _outline(own: CarState, other: CarState) -> tuple[float, float, _Span]:
    """Range and bearing of the visible side of a car, and the span of its bearings.

    The range is that of the car's middle less half of its extent along the line of sight.
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


def _occluded_share(span: _Span, nearer: list[_Span]) -> float:
    """Share of `span` that nearer cars cover."""
    covered, reached = 0.0, span[0]
    for left, right in sorted(nearer):
        begin, end = max(left, reached), min(right, span[1])
        if end > begin:
            covered += end - begin
            reached = end
    return covered / (span[1] - span[0])
