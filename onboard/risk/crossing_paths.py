"""Where the own path and another car's cross, and how likely the two meet there.

Of a car whose acceleration is known, that one is the likeliest (section III-E of the paper); of
others, all are alike. But who goes straight on and would have to brake harder than drivers who stop
do, and does not, drives on; between two of these P_C leaves out that anybody stops.

P_C is averaged over what is not known exactly: the distances and speeds of both cars, whose common
covariance follows from those of their states. The average is a fixed rule of 25 points, exact for
polynomials of the fifth degree, so the same states always give the same number.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from onboard.mvs.known_car import KnownCar
from onboard.risk.collision_probability import Approach, collision_probability
from onboard.risk.conflict_zone import CarSize, XCrossing
from onboard.risk.driver_behaviour import Behaviour, Triangular, Uniform
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


_PAIRS_AT_ONCE = 512
"""What stays in a processor's cache."""


class CovarianceError(ValueError):
    """The uncertainty of a state is not finite, or negative in some direction."""


@dataclass(frozen=True, slots=True)
class Driven:
    """What of a car is not in its state."""

    length_m: float
    width_m: float
    acceleration_m_s2: float | None = None
    """Along its course; `None`: not known."""
    sideways_m_s2: float | None = None
    """Across its course, in a bend; `None`: not known."""


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
    *_, east, north = own.state
    *_, east_other, north_other = other.state
    if not all(map(math.isfinite, (*own.state, *other.state))):
        return None
    # Most of many cars around end here, so it is done without arrays.
    speed, speed_other = math.hypot(east, north), math.hypot(east_other, north_other)
    if min(speed, speed_other) < settings.least_speed_m_s:
        return None
    turned = east * north_other - north * east_other
    if abs(turned) < speed * speed_other * math.sin(settings.least_angle_rad):
        return None
    angle_rad = math.atan2(turned, east * east_other + north * north_other)
    if not all(has_course(car, settings) for car in (own, other)) or _may_be_parallel(
        abs(turned) / (speed * speed_other), own, other
    ):
        return None
    states = np.array([*own.state, *other.state])
    mean = _approaches(states[:, None])[:, 0]
    if not np.all(np.abs(mean[[0, 2]]) <= settings.range_m):  # nor what overflowed
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
    meetings: Sequence[Meeting], others: Sequence[Driven], own: Driven, settings: CrossingSettings
) -> Array:
    """P_C of each meeting, (n), averaged over its uncertainty.

    Where both cars drive on, that of two that do, if it is greater.

    Args:
        meetings: n of them.
        others: the other car of each.
        own: the own car.
        settings: what drivers may do.
    """
    p_c = np.zeros(len(meetings))
    known = np.array([each.acceleration_m_s2 is not None for each in others], dtype=bool)
    ahead = _may_meet(meetings, others, own)
    driving_on = ahead & known & _drive_on(meetings, others, own, settings)
    for chosen, behaviour in (
        (ahead & known, _behaviour),
        (ahead & ~known, _behaviour),
        (driving_on, _behaviour_driving_on),
    ):
        group = np.flatnonzero(chosen)
        for begin in range(0, len(group), _PAIRS_AT_ONCE // len(_POINTS)):
            some = group[begin : begin + _PAIRS_AT_ONCE // len(_POINTS)]
            averaged = _averaged(
                [meetings[at] for at in some], [others[at] for at in some], own, settings, behaviour
            )
            p_c[some] = np.maximum(p_c[some], averaged)
    return p_c


def _drive_on(
    meetings: Sequence[Meeting], others: Sequence[Driven], own: Driven, settings: CrossingSettings
) -> NDArray[np.bool_]:
    """Whether to stay out of the other's way asks more braking of both than drivers do, (n).

    The own driver, who is the one to be warned, has time to react. So has who still accelerates,
    and does so until then. Both must be known to go straight on: in a bend, the courses of all that
    come towards us cross ours.
    """
    if not meetings or own.acceleration_m_s2 is None or not _goes_straight(own, settings):
        return np.zeros(len(meetings), dtype=bool)
    own_d, own_v, other_d, other_v = np.array([each.mean for each in meetings]).T
    half, half_other = _zone_halves_m(meetings, others, own)
    gaining = np.array([_gaining_m_s2(each.acceleration_m_s2, settings) for each in others])
    own_gaining = np.full(len(meetings), _gaining_m_s2(own.acceleration_m_s2, settings))
    reaction_s = np.full(len(meetings), settings.reaction_s)
    straight = np.array([_goes_straight(each, settings) for each in others])
    return (
        straight
        & _has_to_brake_hard(own_d - half, own_v, own_gaining, reaction_s, settings)
        & _has_to_brake_hard(
            other_d - half_other,
            other_v,
            gaining,
            np.where(gaining > 0.0, reaction_s, 0.0),
            settings,
        )
    )


def _goes_straight(car: Driven, settings: CrossingSettings) -> bool:
    return car.sideways_m_s2 is not None and abs(car.sideways_m_s2) <= settings.straight_m_s2


def _gaining_m_s2(acceleration_m_s2: float | None, settings: CrossingSettings) -> float:
    """0 of one who does not clearly accelerate."""
    gaining = acceleration_m_s2 or 0.0
    return gaining if gaining > settings.gaining_m_s2 else 0.0


def _has_to_brake_hard(
    room_m: Array, speed_m_s: Array, gaining_m_s2: Array, after_s: Array, settings: CrossingSettings
) -> NDArray[np.bool_]:
    """Whether more than `stopping_m_s2` is needed to stop in `room_m`, from `after_s` on."""
    then_m_s = speed_m_s + gaining_m_s2 * after_s
    left_m = room_m - (speed_m_s + then_m_s) / 2.0 * after_s
    hard: NDArray[np.bool_] = left_m <= then_m_s**2 / (2.0 * settings.stopping_m_s2)
    return hard


def _may_meet(
    meetings: Sequence[Meeting], others: Sequence[Driven], own: Driven
) -> NDArray[np.bool_]:
    """Whether neither car is behind the crossing for certain, (n); if one is, P_C is exactly 0."""
    if not meetings:
        return np.zeros(0, dtype=bool)
    means = np.array([each.mean for each in meetings])
    spread = np.array([each.covariance.diagonal() for each in meetings])
    # No point is farther from the mean than sqrt(6) sigma.
    nearest = means + np.sqrt(6.0 * np.maximum(spread, 0.0)) * (1.0 + _ROUNDING) + _ROUNDING
    half, half_other = _zone_halves_m(meetings, others, own)
    may: NDArray[np.bool_] = (nearest[:, 0] > -half) & (nearest[:, 2] > -half_other)
    return may


def _zone_halves_m(
    meetings: Sequence[Meeting], others: Sequence[Driven], own: Driven
) -> tuple[Array, Array]:
    """How far the zone extends from where the courses cross, along the own and the other's, (n)."""
    size = CarSize(np.array(own.length_m), np.array(own.width_m))
    theirs = CarSize(
        np.array([each.length_m for each in others]), np.array([each.width_m for each in others])
    )
    angle = np.array([each.angle_rad for each in meetings])
    return XCrossing(size, theirs, angle).extent_m()[1], XCrossing(theirs, size, angle).extent_m()[
        1
    ]


def _averaged(
    meetings: Sequence[Meeting],
    others: Sequence[Driven],
    own: Driven,
    settings: CrossingSettings,
    behaviour: Callable[[Array | None, CrossingSettings], Behaviour],
) -> Array:
    """P_C, (n), of meetings with cars whose acceleration is known of all, or of none."""
    means = np.array([each.mean for each in meetings])
    roots = np.array([_square_root(each.covariance) for each in meetings])
    drawn = means[:, None, :] + np.einsum("nij,pj->npi", roots, _POINTS)
    own_d, own_v, other_d, other_v = drawn.reshape(-1, 4).T[:, :, None]

    def each_point(values: list[float]) -> Array:
        return np.repeat(np.array(values), len(_POINTS))[:, None]

    accelerations = [
        each.acceleration_m_s2 for each in others if each.acceleration_m_s2 is not None
    ]
    top = np.array(settings.top_speed_m_s)
    zone = XCrossing(
        CarSize(np.array(own.length_m), np.array(own.width_m)),
        CarSize(
            each_point([each.length_m for each in others]),
            each_point([each.width_m for each in others]),
        ),
        each_point([each.angle_rad for each in meetings]),
    )
    p_c = collision_probability(
        Approach(
            own_d,
            np.maximum(own_v, 0.0),
            top,
            behaviour(
                None if own.acceleration_m_s2 is None else np.array(own.acceleration_m_s2), settings
            ),
        ),
        Approach(
            other_d,
            np.maximum(other_v, 0.0),
            top,
            behaviour(each_point(accelerations) if accelerations else None, settings),
        ),
        zone,
    )
    averaged: Array = p_c.reshape(len(meetings), -1) @ _WEIGHTS
    return averaged


def _behaviour(present_m_s2: Array | None, settings: CrossingSettings) -> Behaviour:
    lowest, highest = np.array(-settings.hardest_braking_m_s2), np.array(settings.acceleration_m_s2)
    if present_m_s2 is None:
        return Uniform(lowest, highest)
    return Triangular(lowest, present_m_s2, highest)


def _behaviour_driving_on(present_m_s2: Array | None, settings: CrossingSettings) -> Behaviour:
    """Of one who does not stop: goes on as he does, or coasts, a little more or less."""
    assert present_m_s2 is not None  # noqa: S101 (asked of those that say it)
    around = settings.driving_on_m_s2
    lowest, highest = np.minimum(present_m_s2, 0.0) - around, np.maximum(present_m_s2, 0.0) + around
    return Triangular(lowest, present_m_s2, highest)


def has_course(car: KnownCar, settings: CrossingSettings) -> bool:
    """Whether a velocity has settled, by its largest sigma or by time, and its direction has."""
    (a, b), (_, c) = (row[2:] for row in car.covariance[2:])
    largest = (a + c) / 2.0 + math.hypot((a - c) / 2.0, b)
    is_new = car.known_for_s < settings.settled_after_s
    is_vague = is_new and largest > settings.settled_sigma_m_s**2
    is_vague |= _course_variance(car) > settings.course_sigma_rad**2
    return not is_vague  # what is no number is told of later


def _may_be_parallel(sine: float, own: KnownCar, other: KnownCar) -> bool:
    """Whether courses at an angle of that sine may be parallel, to two sigma of the angle."""
    sigma_rad = math.sqrt(max(_course_variance(own) + _course_variance(other), 0.0))
    return math.asin(min(sine, 1.0)) < 2.0 * sigma_rad


def _course_variance(car: KnownCar) -> float:
    """Of the direction in which a car drives, in rad^2."""
    east, north = car.state[2:]
    (a, b), (_, c) = (row[2:] for row in car.covariance[2:])
    across = north * north * a - 2.0 * north * east * b + east * east * c
    return across / (east * east + north * north) ** 2


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
