"""Where the paths of two vehicles cross, how far both are from there, and how certain that is."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from onboard.kinematics.arrays import Array
from onboard.risk.path_ahead import MAX_HEADING_DIFFERENCE_RAD
from onboard.risk.vehicle_motion import SETTLED_SIGMA_M_S
from onboard.tracking.perceived_object import PerceivedObject

CROSSING_RANGE_M = 120.0
"""Largest distance of either vehicle from the crossing: 4 s at 30 m/s."""
MIN_ANGLE_RAD = 0.35
"""Smallest angle between the courses; below it paths count as parallel."""
MIN_SAME_WAY_RAD = MAX_HEADING_DIFFERENCE_RAD
"""The same of vehicles that drive the same way: up to it, they may be on one road that bends, where
FCW judges them. Behind who turns a corner, the next one's course crosses his."""
MIN_SPEED_M_S = 0.3
"""A slower vehicle has no course."""
MAX_COURSE_SIGMA_RAD = 0.35
"""A vehicle with a less certain course is not assessed: it was just detected, its speed settles."""
SETTLED_AFTER_S = 1.0
"""After this time of tracking a velocity counts as settled in any case: what is left of its sigma
is mostly the error of the host's position, which all images share."""

_STEP = 1e-4
"""Of the numerical derivative, in m and m/s."""
_ROUNDING = 1e-9
"""Relative; an eigenvalue this little below zero is zero."""


class CovarianceError(ValueError):
    """The covariance of a state is not finite, or not positive."""


@dataclass(frozen=True, slots=True)
class PathCrossing:
    """Two paths that cross ahead of both vehicles, or around them."""

    mean: Array
    """(4): distance in m and speed in m/s of the host vehicle, distance and speed of the other."""
    covariance: Array
    """(4, 4) of these."""
    angle_rad: float
    """Between the courses."""

    def of_other(self) -> "PathCrossing":
        """Return the same crossing with the roles exchanged."""
        order = [2, 3, 0, 1]
        return PathCrossing(
            self.mean[order], self.covariance[np.ix_(order, order)], -self.angle_rad
        )


def path_crossing(own: PerceivedObject, other: PerceivedObject) -> PathCrossing | None:
    """Return where the paths cross; `None` for parallel or far ones, and for unknown courses.

    Raises:
        CovarianceError: the covariance of either state is invalid.
    """
    angle_rad = _angle_rad(own, other)
    if angle_rad is None:
        return None
    mean = _approaches(np.array([[*own.state, *other.state]]).T)[:, 0]
    if not np.all(np.abs(mean[[0, 2]]) <= CROSSING_RANGE_M):  # also false for overflows
        return None
    return PathCrossing(*linearised(_approaches, own, other), angle_rad)


def linearised(
    approaches: Callable[[Array], Array], one: PerceivedObject, other: PerceivedObject
) -> tuple[Array, Array]:
    """Return mean and covariance of distances and speeds, as in `PathCrossing`.

    Args:
        approaches: distances and speeds, (4, k), from states of both vehicles, (8, k).
        one: the vehicle whose distance and speed come first.
        other: the other vehicle.

    Raises:
        CovarianceError: the covariance of either state is invalid.
    """
    states = np.array([*one.state, *other.state])[:, None]
    offsets = _STEP * np.eye(8)
    derivative = (approaches(states + offsets) - approaches(states - offsets)) / (2.0 * _STEP)
    covariance = derivative @ _covariance(one, other) @ derivative.T
    return approaches(states)[:, 0], covariance


def has_course(vehicle: PerceivedObject) -> bool:
    """Whether its velocity has settled, by its largest sigma or by time, and its direction has."""
    return _course_variance(vehicle) is not None


def _angle_rad(own: PerceivedObject, other: PerceivedObject) -> float | None:
    """From the host's course to the other; `None` if they may be parallel, or one is unknown."""
    if not all(map(math.isfinite, (*own.state, *other.state))):
        return None
    # Most of many objects end here, so it is done without arrays.
    *_, east, north = own.state
    *_, east_other, north_other = other.state
    speed, speed_other = math.hypot(east, north), math.hypot(east_other, north_other)
    if min(speed, speed_other) < MIN_SPEED_M_S:
        return None
    turned = east * north_other - north * east_other
    along = east * east_other + north * north_other
    least_rad = MIN_SAME_WAY_RAD if along > 0.0 else MIN_ANGLE_RAD
    if abs(turned) < speed * speed_other * math.sin(least_rad):
        return None
    variance, variance_other = _course_variance(own), _course_variance(other)
    if variance is None or variance_other is None:
        return None
    sine = min(abs(turned) / (speed * speed_other), 1.0)
    if math.asin(sine) < 2.0 * math.sqrt(max(variance + variance_other, 0.0)):
        return None
    return math.atan2(turned, along)


def _course_variance(vehicle: PerceivedObject) -> float | None:
    """Variance of a vehicle's course in rad^2; `None` if the course is unknown.

    It is not finite where the vehicle's covariance is not.
    """
    if _is_settling(vehicle):
        return None
    east, north = vehicle.state[2:]
    (a, b), (_, c) = (row[2:] for row in vehicle.covariance[2:])
    across = north * north * a - 2.0 * north * east * b + east * east * c
    squared = east * east + north * north
    if squared < MIN_SPEED_M_S**2:
        return None
    variance = across / squared**2
    return None if variance > MAX_COURSE_SIGMA_RAD**2 else variance


def _is_settling(vehicle: PerceivedObject) -> bool:
    if vehicle.tracked_for_s >= SETTLED_AFTER_S:
        return False
    (a, b), (_, c) = (row[2:] for row in vehicle.covariance[2:])
    largest_variance = (a + c) / 2.0 + math.hypot((a - c) / 2.0, b)
    return largest_variance > SETTLED_SIGMA_M_S**2


def _covariance(own: PerceivedObject, other: PerceivedObject) -> Array:
    """(8, 8), of both states; raises `CovarianceError`."""
    both = np.zeros((8, 8))
    both[:4, :4], both[4:, 4:] = own.covariance, other.covariance
    if not np.all(np.isfinite(both)):
        raise CovarianceError("not finite")
    for each in (both[:4, :4], both[4:, 4:]):
        eigenvalues = np.linalg.eigvalsh((each + each.T) / 2.0)
        if eigenvalues[0] < -_ROUNDING * max(eigenvalues[-1], 1.0):
            raise CovarianceError(f"an eigenvalue of {eigenvalues[0]:.3g}")
    return both


def _approaches(states: Array) -> Array:
    """Distances to the crossing, and speeds, (4, k), from states of both vehicles, (8, k)."""
    p, v, q, w = states.reshape(4, 2, -1)
    speed, speed_other = np.hypot(*v), np.hypot(*w)
    apart, both = q - p, _cross(v, w)
    distance = _cross(apart, w) / both * speed
    distance_other = _cross(apart, v) / both * speed_other
    return np.stack([distance, speed, distance_other, speed_other])


def _cross(a: Array, b: Array) -> Array:
    result: Array = a[0] * b[1] - a[1] * b[0]
    return result
