"""Where the own course and another car's cross, how far off both cars are, and how sure that is."""

import math
from dataclasses import dataclass

import numpy as np

from onboard.mvs.perceived_object import PerceivedObject
from onboard.risk.settings import ImaSettings
from onboard.risk.trajectory import Array

_STEP = 1e-4
"""Of the numerical derivative, in m and m/s."""

_ROUNDING = 1e-9
"""Relative; an eigenvalue this little below zero is zero."""


class CovarianceError(ValueError):
    """The uncertainty of a state is not finite, or negative in some direction."""


@dataclass(frozen=True, slots=True)
class PathCrossing:
    """Two courses that cross ahead of both cars, or around them."""

    mean: Array
    """(4): own distance in m and speed in m/s, the other's distance and speed."""
    covariance: Array
    """(4, 4) of these."""
    angle_rad: float
    """Between the courses."""


def path_crossing(
    own: PerceivedObject, other: PerceivedObject, settings: ImaSettings
) -> PathCrossing | None:
    """Where the courses cross; `None` for parallel ones, far ones, and cars without a course.

    Raises:
        CovarianceError: what is said of either car's uncertainty cannot be.
    """
    angle_rad = _angle_rad(own, other, settings)
    if angle_rad is None:
        return None
    states = np.array([*own.state, *other.state])
    mean = _approaches(states[:, None])[:, 0]
    if not np.all(np.abs(mean[[0, 2]]) <= settings.range_m):  # nor what overflowed
        return None
    offsets = _STEP * np.eye(8)
    derivative = (
        _approaches(states[:, None] + offsets) - _approaches(states[:, None] - offsets)
    ) / (2.0 * _STEP)
    return PathCrossing(mean, derivative @ _covariance(own, other) @ derivative.T, angle_rad)


def has_course(car: PerceivedObject, settings: ImaSettings) -> bool:
    """Whether its velocity has settled, by its largest sigma or by time, and its direction has."""
    return _course_variance(car, settings) is not None


def _angle_rad(own: PerceivedObject, other: PerceivedObject, settings: ImaSettings) -> float | None:
    """From the own course to the other; `None` if they may be parallel, or either is not known."""
    if not all(map(math.isfinite, (*own.state, *other.state))):
        return None
    # Most of many cars around end here, so it is done without arrays.
    *_, east, north = own.state
    *_, east_other, north_other = other.state
    speed, speed_other = math.hypot(east, north), math.hypot(east_other, north_other)
    if min(speed, speed_other) < settings.least_speed_m_s:
        return None
    turned = east * north_other - north * east_other
    if abs(turned) < speed * speed_other * math.sin(settings.least_angle_rad):
        return None
    variance, variance_other = _course_variance(own, settings), _course_variance(other, settings)
    if variance is None or variance_other is None:
        return None
    sine = min(abs(turned) / (speed * speed_other), 1.0)
    if math.asin(sine) < 2.0 * math.sqrt(max(variance + variance_other, 0.0)):
        return None
    return math.atan2(turned, east * east_other + north * north_other)


def _course_variance(car: PerceivedObject, settings: ImaSettings) -> float | None:
    """Of the direction in which a car drives, in rad^2; `None` if that is as good as unknown.

    It is not finite where the car's covariance is not.
    """
    if _is_settling(car, settings):
        return None
    east, north = car.state[2:]
    (a, b), (_, c) = (row[2:] for row in car.covariance[2:])
    across = north * north * a - 2.0 * north * east * b + east * east * c
    variance = across / (east * east + north * north) ** 2
    return None if variance > settings.course_sigma_rad**2 else variance


def _is_settling(car: PerceivedObject, settings: ImaSettings) -> bool:
    if car.tracked_for_s >= settings.settled_after_s:
        return False
    (a, b), (_, c) = (row[2:] for row in car.covariance[2:])
    largest_variance = (a + c) / 2.0 + math.hypot((a - c) / 2.0, b)
    return largest_variance > settings.settled_sigma_m_s**2


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
    """Distances to where the courses cross, and speeds, (4, k), from states of both, (8, k)."""
    p, v, q, w = states.reshape(4, 2, -1)
    speed, speed_other = np.hypot(*v), np.hypot(*w)
    apart, both = q - p, _cross(v, w)
    distance = _cross(apart, w) / both * speed
    distance_other = _cross(apart, v) / both * speed_other
    return np.stack([distance, speed, distance_other, speed_other])


def _cross(a: Array, b: Array) -> Array:
    result: Array = a[0] * b[1] - a[1] * b[0]
    return result
