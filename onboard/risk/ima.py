"""How likely two cars on crossing courses collide, averaged over what is not known exactly.

What a driver will do next is a distribution of accelerations: where the present acceleration is
known, it is the likeliest one (section III-E of the paper), else all are equally likely. A driver
who goes straight on, would by now have to brake harder than drivers who stop do, and does not, is
taken to drive on. Where both do, P_C is that of two drivers of whom neither stops.

The distances and speeds of both cars are uncertain too. P_C is averaged over them by a fixed rule
of 25 points that is exact for polynomials of the fifth degree, so that the same states always give
the same number.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from onboard.risk.collision_probability import Approach, collision_probability
from onboard.risk.conflict_zone import CarSize, XCrossing
from onboard.risk.driver_behaviour import Behaviour, Triangular, Uniform
from onboard.risk.path_crossing import PathCrossing
from onboard.risk.settings import ImaSettings
from onboard.risk.trajectory import Array

_CORNERS = np.concatenate([np.eye(4), -np.eye(4), list(product((-0.5, 0.5), repeat=4))])
"""Of the 24-cell, on the unit sphere: a spherical design of strength five."""
_POINTS = np.concatenate([np.zeros((1, 4)), np.sqrt(6.0) * _CORNERS])
"""(25, 4), in standard deviations."""
_WEIGHTS = np.array([1.0 / 3.0, *np.full(24, 1.0 / 36.0)])

_ROUNDING = 1e-9
"""Relative."""

_PAIRS_AT_ONCE = 512
"""What stays in a processor's cache."""


@dataclass(frozen=True, slots=True)
class Driven:
    """What of a car is not in its state."""

    length_m: float
    width_m: float
    acceleration_m_s2: float | None = None
    """Along its course; `None`: not known."""
    sideways_m_s2: float | None = None
    """Across its course, in a bend; `None`: not known."""


def averaged_collision_probabilities(
    meetings: Sequence[PathCrossing], others: Sequence[Driven], own: Driven, settings: ImaSettings
) -> Array:
    """P_C of each meeting, (n), averaged over its uncertainty.

    For two cars that drive on it is the greater of two values: that of any two drivers, and that of
    two who do not stop.

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
    meetings: Sequence[PathCrossing], others: Sequence[Driven], own: Driven, settings: ImaSettings
) -> NDArray[np.bool_]:
    """Whether both drivers would have to brake harder than drivers do to stop short, (n).

    The own driver, who is to be warned, first needs time to react. So does another driver who still
    accelerates, and who goes on accelerating in that time. Both must be known to go straight on: in
    a bend, the courses of all oncoming cars cross ours.
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


def _goes_straight(car: Driven, settings: ImaSettings) -> bool:
    return car.sideways_m_s2 is not None and abs(car.sideways_m_s2) <= settings.straight_m_s2


def _gaining_m_s2(acceleration_m_s2: float | None, settings: ImaSettings) -> float:
    """0 unless the driver clearly accelerates."""
    gaining = acceleration_m_s2 or 0.0
    return gaining if gaining > settings.gaining_m_s2 else 0.0


def _has_to_brake_hard(
    room_m: Array, speed_m_s: Array, gaining_m_s2: Array, after_s: Array, settings: ImaSettings
) -> NDArray[np.bool_]:
    """Whether more than `stopping_m_s2` is needed to stop in `room_m`, from `after_s` on."""
    then_m_s = speed_m_s + gaining_m_s2 * after_s
    left_m = room_m - (speed_m_s + then_m_s) / 2.0 * after_s
    hard: NDArray[np.bool_] = left_m <= then_m_s**2 / (2.0 * settings.stopping_m_s2)
    return hard


def _may_meet(
    meetings: Sequence[PathCrossing], others: Sequence[Driven], own: Driven
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
    meetings: Sequence[PathCrossing], others: Sequence[Driven], own: Driven
) -> tuple[Array, Array]:
    """How far the zone extends from where the courses cross, along the own and the other's, (n)."""
    size = CarSize(np.array(own.length_m), np.array(own.width_m))
    theirs = CarSize(
        np.array([each.length_m for each in others]), np.array([each.width_m for each in others])
    )
    angle = np.array([each.angle_rad for each in meetings])
    _, half = XCrossing(size, theirs, angle).extent_m()
    _, half_other = XCrossing(theirs, size, angle).extent_m()
    return half, half_other


def _averaged(
    meetings: Sequence[PathCrossing],
    others: Sequence[Driven],
    own: Driven,
    settings: ImaSettings,
    behaviour: Callable[[Array | None, ImaSettings], Behaviour],
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

    def approach(distance_m: Array, speed_m_s: Array, present_m_s2: Array | None) -> Approach:
        may_do = behaviour(present_m_s2, settings)
        return Approach(distance_m, np.maximum(speed_m_s, 0.0), top, may_do)

    own_present = None if own.acceleration_m_s2 is None else np.array(own.acceleration_m_s2)
    other_present = each_point(accelerations) if accelerations else None
    p_c = collision_probability(
        approach(own_d, own_v, own_present), approach(other_d, other_v, other_present), zone
    )
    averaged: Array = p_c.reshape(len(meetings), -1) @ _WEIGHTS
    return averaged


def _behaviour(present_m_s2: Array | None, settings: ImaSettings) -> Behaviour:
    lowest, highest = np.array(-settings.hardest_braking_m_s2), np.array(settings.acceleration_m_s2)
    if present_m_s2 is None:
        return Uniform(lowest, highest)
    return Triangular(lowest, present_m_s2, highest)


def _behaviour_driving_on(present_m_s2: Array | None, settings: ImaSettings) -> Behaviour:
    """Of a driver who does not stop: about the present acceleration, or none, or between."""
    assert present_m_s2 is not None  # noqa: S101 (asked of those that say it)
    around = settings.driving_on_m_s2
    lowest, highest = np.minimum(present_m_s2, 0.0) - around, np.maximum(present_m_s2, 0.0) + around
    return Triangular(lowest, present_m_s2, highest)


def _square_root(covariance: Array) -> Array:
    """A matrix whose product with its transpose is `covariance`, which may be singular."""
    values, vectors = np.linalg.eigh(covariance)
    root: Array = vectors * np.sqrt(np.maximum(values, 0.0))
    return root
