"""Which vehicles are ahead on the host vehicle's path, in bends as well.

Two estimates of how far a vehicle is to the side of the path, weighed by their variances:

- **Path prediction** (SAE J2945/1): the path is a circle through the host vehicle, along its
  course. Its curvature is the host's yaw rate over its speed, and as well the difference of both
  vehicles' courses over their distance. Where these differ, the road is no circle, and the
  estimate counts less.
- **Path history** of the other's BSM, where it passes the host vehicle.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

from onboard.bsm_transmission.path_prediction import PathPredictor
from onboard.kinematics.course_rate import WINDOW_S
from onboard.observations import Position
from onboard.tracking.perceived_object import ObjectSource, PerceivedObject

RANGE_M = 150.0
"""Farther ahead a vehicle asks for no reaction: 27 m/s stop in 100 m with 4 m/s^2."""
OWN_LANE_M = 2.0
"""Farther to the side a vehicle is in another lane."""
MAX_LATERAL_SIGMA_M = 1.3
"""With a larger sigma, the lane is unknown."""
MAX_HEADING_DIFFERENCE_RAD = 0.5
"""A vehicle whose course differs by more from that of the path is on another road."""
HISTORY_SIGMA_M = 1.0
"""Allowable error of a path history (SAE J2945/1)."""

_CERTAIN_M = 0.3
"""Below this sigma a path prediction needs no path history, which takes time to decode."""
_FAR_SIGMAS = 5.0
"""A vehicle that is farther from the own lane is in another, whatever its path history."""
_VELOCITY_SIGMA_M_S = 0.1
"""Error of a GNSS receiver's velocity on either axis, which BSMs do not report."""
_MIN_COURSE_SPEED_M_S = 2.0
"""A slower vehicle has no course that could be compared."""
_AT_REST_M_S = 0.01
"""A slower host vehicle has no course."""
_NEAREST_M = 0.5
"""Nearer, two middles are of one vehicle."""
_STRAIGHT_1_M = 1e-6
"""A smaller curvature counts as none."""
_Point = tuple[float, float]
"""Metres ahead of the host vehicle and to the left of it."""


@dataclass(frozen=True, slots=True)
class PlaceOnPath:
    """Place of a vehicle's middle relative to the host vehicle's middle."""

    ahead_m: float
    """Along the path."""
    left_m: float
    """To the left of the path."""
    left_sigma_m: float
    """Of that, without the errors of both positions."""
    course_rad: float
    """Direction of the path there, from east to north, as of the states."""


class PathAhead:
    """The host vehicle's path, by its GNSS fixes."""

    def __init__(self) -> None:
        self._predictor = PathPredictor()
        self._yaw_rate_rad_s = 0.0
        """Positive to the right; 0 while it is unknown."""

    def receive_position(self, position: Position) -> None:
        """Take a fix of the host vehicle."""
        self._predictor.receive_position(position)
        self._yaw_rate_rad_s = self._predictor.yaw_rate_rad_s or 0.0

    def place(
        self,
        own: PerceivedObject,
        other: PerceivedObject,
        history_m: Callable[[], Sequence[_Point]],
    ) -> PlaceOnPath | None:
        """Return the place of a vehicle ahead in the host vehicle's lane; `None` for others.

        Args:
            own: the host vehicle; at rest it has no path.
            other: a perceived object.
            history_m: returns past positions of the other, metres east and north of its last one,
                the newest first.
        """
        place = self.place_in_any_lane(own, other, history_m, RANGE_M)
        if place is None or abs(place.left_m) > OWN_LANE_M:
            return None
        return place if place.left_sigma_m <= MAX_LATERAL_SIGMA_M else None

    def place_in_any_lane(
        self,
        own: PerceivedObject,
        other: PerceivedObject,
        history_m: Callable[[], Sequence[_Point]],
        range_m: float,
    ) -> PlaceOnPath | None:
        """Return the same for all lanes of this direction, up to `range_m`."""
        here = _relative(own, other)
        if here is None or not here[0] > _NEAREST_M:
            return None
        predicted = self._predicted(own, other, here, range_m)
        if predicted is None:
            return None
        left_m, variance = predicted.left_m, predicted.left_sigma_m**2
        is_open = abs(left_m) <= OWN_LANE_M + _FAR_SIGMAS * math.sqrt(variance)
        passed_m = None
        if is_open and variance > _CERTAIN_M**2:
            passed_m = _history_to_the_left_m(history_m(), other, own)
        if passed_m is not None:
            weight = variance / (variance + HISTORY_SIGMA_M**2)
            left_m += weight * (passed_m - left_m)
            variance *= 1.0 - weight
        return replace(predicted, left_m=left_m, left_sigma_m=math.sqrt(variance))

    def predicted_place(self, own: PerceivedObject, other: PerceivedObject) -> PlaceOnPath | None:
        """Return the place of a vehicle in any lane, ahead or behind, by path prediction alone.

        `None` for vehicles farther away than `RANGE_M`, or that drive elsewhere than the path
        leads.

        Args:
            own: the host vehicle; at rest it has no path.
            other: a perceived object.
        """
        here = _relative(own, other)
        if here is None or math.hypot(*here) <= _NEAREST_M:
            return None
        return self._predicted(own, other, here, RANGE_M)

    def _predicted(
        self, own: PerceivedObject, other: PerceivedObject, here: _Point, range_m: float
    ) -> PlaceOnPath | None:
        distance_m = math.hypot(*here)
        if distance_m > range_m:
            return None
        speed_m_s = math.hypot(*own.state[2:])
        curvature = self._curvature(own, other, math.copysign(distance_m, here[0]))
        ahead_m, left_m = _on_circle(here, curvature.mean_1_m)
        turned_rad = curvature.mean_1_m * ahead_m
        course_rad = math.atan2(own.state[3], own.state[2]) + turned_rad
        if _has_course(other):
            difference = math.atan2(other.state[3], other.state[2]) - course_rad
            if math.cos(difference) < math.cos(MAX_HEADING_DIFFERENCE_RAD):
                return None
        variance = (distance_m**2 / 2.0) ** 2 * curvature.variance
        variance += (distance_m * _VELOCITY_SIGMA_M_S / speed_m_s) ** 2
        return PlaceOnPath(ahead_m, left_m, math.sqrt(variance), course_rad)

    def _curvature(
        self, own: PerceivedObject, other: PerceivedObject, distance_m: float
    ) -> "_Curvature":
        """Curvature of the path as far as a vehicle, positive to the left.

        The distance is negative to vehicles behind.
        """
        speed_m_s = math.hypot(*own.state[2:])
        own_sigma_rad = _VELOCITY_SIGMA_M_S / speed_m_s
        by_yaw_rate = _Curvature(
            -self._yaw_rate_rad_s / speed_m_s, 2.0 * (own_sigma_rad / WINDOW_S / speed_m_s) ** 2
        )
        if not _has_course(other):
            return by_yaw_rate
        turned_rad = math.remainder(
            math.atan2(other.state[3], other.state[2]) - math.atan2(own.state[3], own.state[2]),
            math.tau,
        )
        variance = own_sigma_rad**2 + _course_variance(other)
        by_courses = _Curvature(turned_rad / distance_m, variance / distance_m**2)
        return by_yaw_rate.combined(by_courses)


@dataclass(frozen=True, slots=True)
class _Curvature:
    mean_1_m: float
    variance: float

    def combined(self, other: "_Curvature") -> "_Curvature":
        """Weigh both by their variances; their difference adds to the variance."""
        weight = self.variance / (self.variance + other.variance)
        difference = other.mean_1_m - self.mean_1_m
        return _Curvature(
            self.mean_1_m + weight * difference,
            (1.0 - weight) * self.variance + weight * (1.0 - weight) * difference**2,
        )


def _relative(own: PerceivedObject, other: PerceivedObject) -> _Point | None:
    """The other from the host vehicle, along its course; `None` while that has none."""
    east, north = own.state[2:]
    speed_m_s = math.hypot(east, north)
    if not speed_m_s > _AT_REST_M_S:
        return None
    cos, sin = east / speed_m_s, north / speed_m_s
    to_east, to_north = other.state[0] - own.state[0], other.state[1] - own.state[1]
    return to_east * cos + to_north * sin, to_north * cos - to_east * sin


def _on_circle(point: _Point, curvature_1_m: float) -> _Point:
    """Way along a circle that leaves the host vehicle straight ahead, and distance to its left."""
    ahead_m, left_m = point
    if abs(curvature_1_m) < _STRAIGHT_1_M:
        return point
    inside = 2.0 * left_m - curvature_1_m * (ahead_m**2 + left_m**2)
    angle = math.atan2(curvature_1_m * ahead_m, 1.0 - curvature_1_m * left_m)
    root = math.sqrt(max(1.0 - curvature_1_m * inside, 0.0))
    return angle / curvature_1_m, inside / (1.0 + root)


def _has_course(vehicle: PerceivedObject) -> bool:
    return math.hypot(*vehicle.state[2:]) >= _MIN_COURSE_SPEED_M_S


def _course_variance(vehicle: PerceivedObject) -> float:
    """Of a vehicle that moves, in rad^2; a track's by its covariance."""
    _, _, east, north = vehicle.state
    squared = east * east + north * north
    if vehicle.source is ObjectSource.BSM:
        return _VELOCITY_SIGMA_M_S**2 / squared
    (a, b), (_, c) = (row[2:] for row in vehicle.covariance[2:])
    return max(north * north * a - 2.0 * north * east * b + east * east * c, 0.0) / squared**2


def _history_to_the_left_m(
    history_m: Sequence[_Point], other: PerceivedObject, own: PerceivedObject
) -> float | None:
    """How far to the left of the host vehicle the other has passed; `None` if it has not."""
    x, y, east, north = other.state
    speed_m_s = math.hypot(*own.state[2:])
    cos, sin = own.state[2] / speed_m_s, own.state[3] / speed_m_s
    reported = x - other.age_s * east - own.state[0], y - other.age_s * north - own.state[1]
    points = [(x - own.state[0], y - own.state[1]), reported]
    points += [(reported[0] + to_east, reported[1] + to_north) for to_east, to_north in history_m]
    turned = [(px * cos + py * sin, py * cos - px * sin) for px, py in points]
    for (ahead_m, left_m), (behind_m, left_before_m) in pairwise(turned):
        if behind_m <= 0.0 < ahead_m:
            along_m, across_m = ahead_m - behind_m, left_m - left_before_m
            if abs(across_m) > math.tan(MAX_HEADING_DIFFERENCE_RAD) * along_m:
                return None
            return left_before_m - across_m * behind_m / along_m
    return None
