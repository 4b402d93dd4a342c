"""Where the own path and another car's cross, and how likely the two meet there.

P_C is averaged over what is not known exactly: the distances and speeds of both cars, whose common
covariance follows from those of their states. The average is a fixed rule of 25 points, exact for
polynomials of the fifth degree, so the same states always give the same number.
"""

from dataclasses import dataclass
from itertools import product

import numpy as np

from onboard.mvs.known_car import KnownCar
from onboard.risk.collision_probability import Approach, collision_probability
from onboard.risk.conflict_zone import CarSize, XCrossing
from onboard.risk.driver_behaviour import Uniform
from onboard.risk.settings import CrossingSettings
from onboard.risk.trajectory import Array

_CORNERS = np.concatenate([np.eye(4), -np.eye(4), list(product((-0.5, 0.5), repeat=4))])
"""Of the 24-cell, on the unit sphere: a spherical design of strength five."""
_POINTS = np.concatenate([np.zeros((1, 4)), np.sqrt(6.0) * _CORNERS])
"""(25, 4), in standard deviations."""
_WEIGHTS = np.array([1.0 / 3.0, *np.full(24, 1.0 / 36.0)])

_STEP = 1e-4
"""Of the numerical derivative, in m and m/s."""

_ROUNDING = 1e-9
"""Relative; an eigenvalue this little below zero is zero."""


class CovarianceError(ValueError):
    """The uncertainty of a state is not finite, or negative in some direction."""


@dataclass(frozen=True, slots=True)
class Meeting:
    """Two courses that cross ahead of both cars, or around them."""

    mean: Array
    """(4): own distance in m and speed in m/s, the other's distance and speed."""
    covariance: Array
    """(4, 4) of these."""
    angle_rad: float
    """Between the courses."""


def meeting(own: KnownCar, other: KnownCar, settings: CrossingSettings) -> Meeting | None:
    """Where the courses cross; `None` for parallel ones, far ones, and cars without a course.

    Raises:
        CovarianceError: what is said of either car's uncertainty cannot be.
    """
    states = np.array([own.state, other.state]).reshape(8)
    if not np.all(np.isfinite(states)):
        return None
    velocity, velocity_other = states[2:4], states[6:8]
    if min(np.hypot(*velocity), np.hypot(*velocity_other)) < settings.least_speed_m_s:
        return None
    dot = velocity @ velocity_other
    angle_rad = float(np.arctan2(_cross(velocity, velocity_other), dot))
    if abs(np.sin(angle_rad)) < np.sin(settings.least_angle_rad):
        return None
    mean = _approaches(states[:, None])[:, 0]
    if np.any(np.abs(mean[[0, 2]]) > settings.range_m):
        return None
    offsets = _STEP * np.eye(8)
    derivative = (
        _approaches(states[:, None] + offsets) - _approaches(states[:, None] - offsets)
    ) / (2.0 * _STEP)
    both = np.zeros((8, 8))
    both[:4, :4], both[4:, 4:] = own.covariance, other.covariance
    if not np.all(np.isfinite(both)):
        raise CovarianceError("not finite")
    for each in (both[:4, :4], both[4:, 4:]):
        eigenvalues = np.linalg.eigvalsh((each + each.T) / 2.0)
        if eigenvalues[0] < -_ROUNDING * max(eigenvalues[-1], 1.0):
            raise CovarianceError(f"an eigenvalue of {eigenvalues[0]:.3g}")
    return Meeting(mean, derivative @ both @ derivative.T, angle_rad)


def averaged_collision_probabilities(
    meetings: list[Meeting], sizes: list[tuple[float, float]], own_size: tuple[float, float],
    settings: CrossingSettings,
) -> Array:  # fmt: skip
    """P_C of each meeting, (n), averaged over its uncertainty.

    Args:
        meetings: n of them.
        sizes: length and width of each other car in m.
        own_size: of the own car.
        settings: what drivers may do.
    """
    if not meetings:
        return np.zeros(0)
    means = np.array([each.mean for each in meetings])
    roots = np.array([_square_root(each.covariance) for each in meetings])
    drawn = means[:, None, :] + np.einsum("nij,pj->npi", roots, _POINTS)
    own_d, own_v, other_d, other_v = drawn.reshape(-1, 4).T[:, :, None]

    def each_point(values: list[float]) -> Array:
        return np.repeat(np.array(values), len(_POINTS))[:, None]

    behaviour = Uniform(
        np.array(-settings.hardest_braking_m_s2), np.array(settings.acceleration_m_s2)
    )
    top = np.array(settings.top_speed_m_s)
    zone = XCrossing(
        CarSize(*map(np.array, own_size)),
        CarSize(each_point([size[0] for size in sizes]), each_point([size[1] for size in sizes])),
        each_point([each.angle_rad for each in meetings]),
    )
    p_c = collision_probability(
        Approach(own_d, np.maximum(own_v, 0.0), top, behaviour),
        Approach(other_d, np.maximum(other_v, 0.0), top, behaviour),
        zone,
    )
    averaged: Array = p_c.reshape(len(meetings), -1) @ _WEIGHTS
    return averaged


def _approaches(states: Array) -> Array:
    """Distances to where the courses cross, and speeds, (4, k), from states of both, (8, k)."""
    (p, v), (q, w) = (
        (states[begin : begin + 2], states[begin + 2 : begin + 4]) for begin in (0, 4)
    )
    speed, speed_other = np.hypot(*v), np.hypot(*w)
    apart, both = q - p, _cross(v, w)
    distance = _cross(apart, w) / both * speed
    distance_other = _cross(apart, v) / both * speed_other
    return np.stack([distance, speed, distance_other, speed_other])


def _cross(a: Array, b: Array) -> Array:
    result: Array = a[0] * b[1] - a[1] * b[0]
    return result


def _square_root(covariance: Array) -> Array:
    """A matrix whose product with its transpose is `covariance`, which may be singular."""
    values, vectors = np.linalg.eigh(covariance)
    root: Array = vectors * np.sqrt(np.maximum(values, 0.0))
    return root
