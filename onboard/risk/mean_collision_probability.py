"""Mean P_C of two vehicles on crossing paths over their uncertain states.

What a driver does next is a distribution of accelerations: about the present acceleration where it
is known (section III-E of the paper), else uniform. A driver who goes straight on, and does not
brake where drivers who stop do, is taken to drive on. Where both do, P_C is also computed for two
drivers of whom neither stops, and the greater value counts.

Distances and speeds of both vehicles are uncertain. P_C is averaged over them by a fixed rule of 25
points that is exact for polynomials of the fifth degree, so equal states give equal numbers.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from numpy.typing import NDArray

from onboard.kinematics.arrays import Array
from onboard.risk.collision_probability import Approach, collision_probability
from onboard.risk.conflict_zone import CarSize, XCrossing
from onboard.risk.driver_behaviour import Behaviour, Triangular, Uniform
from onboard.risk.path_crossing import PathCrossing

MAX_BRAKING_M_S2 = 9.55
"""Hardest braking of a driver; Table I."""
MAX_ACCELERATION_M_S2 = 2.1
"""Largest acceleration of a driver; Table I."""
STOPPING_M_S2 = 2.5
"""A driver who would need more than this to stop short of the other's path, and does not brake, is
taken to drive on. Drivers who stop brake less, and begin sooner."""
STOPPING_S = 1.7
"""So is another driver who is this close to it by his speed: from low speeds drivers stop gently,
and what they would need says nothing in time. In a left turn so is the host driver, a reaction time
sooner."""
STOPPING_LATE_M_S2 = 3.5
"""The same for a driver who has begun to brake (signals are timed for 10 ft/s^2)."""
REACTION_S = 1.0
"""Time until another driver who accelerates would brake, or the host's, if it is not known."""
BRAKING_M_S2 = 1.0
"""A host driver who brakes by more has reacted: two steps of 1 km/h within the window."""
ANSWERING_M_S2 = 0.3
"""Another driver who brakes by more has begun to."""
GAINING_M_S2 = 1.0
"""A driver who accelerates by more does not yet mean to stop."""
SETTING_OFF_M_S = 4.0
"""A driver below this speed who accelerates sets off."""
SETTING_OFF_M = 8.0
"""Who sets off this close to the other's path has left the stop line, and drives on."""
DRIVING_ON_M_S2 = 1.0
"""A driver who drives on keeps the present acceleration, or none, +- this."""
MAX_LATERAL_M_S2 = 1.0
"""A vehicle with more lateral acceleration is in a bend, and leaves its present course."""
TOP_SPEED_M_S = 70.0
"""No driver goes faster."""

_CORNERS = np.concatenate([np.eye(4), -np.eye(4), list(product((-0.5, 0.5), repeat=4))])
"""Of the 24-cell, on the unit sphere: a spherical design of strength five."""
_POINTS = np.concatenate([np.zeros((1, 4)), np.sqrt(6.0) * _CORNERS])
"""(25, 4), in standard deviations."""
_WEIGHTS = np.array([1.0 / 3.0, *np.full(24, 1.0 / 36.0)])

_ROUNDING = 1e-9
"""Relative."""

_PAIRS_AT_ONCE = 512
"""Fits a processor's cache."""


@dataclass(frozen=True, slots=True)
class DrivenVehicle:
    """Size and accelerations of a vehicle."""

    length_m: float
    width_m: float
    acceleration_m_s2: float | None = None
    """Along its course; `None`: not known."""
    lateral_m_s2: float | None = None
    """Across its course, in a bend; `None`: not known."""
    turns_left: bool = False
    """Across the path of the other, which has the right of way."""
    passes_red: bool = False
    """By its signal, at which its driver does not stop any more."""
    passes_green: bool = False
    """By its signal."""

    @property
    def driving_on(self) -> "DrivenVehicle":
        """The same if its driver does not stop.

        Who brakes as a left turn begins, brakes for the turn, and keeps its speed in it.
        """
        if not self.turns_left or self.acceleration_m_s2 is None:
            return self
        return replace(self, acceleration_m_s2=max(self.acceleration_m_s2, 0.0))


def mean_collision_probabilities(
    crossings: Sequence[PathCrossing],
    others: Sequence[DrivenVehicle],
    own: DrivenVehicle,
    *,
    reaction_s: float = REACTION_S,
) -> Array:
    """Return the mean P_C of each crossing, (n).

    For two drivers who drive on it is the greater of two values: that of any two drivers, and that
    of two who do not stop.

    Args:
        crossings: n path crossings.
        others: the other vehicle of each.
        own: the host vehicle.
        reaction_s: reaction time of the host's driver.
    """
    p_c = np.zeros(len(crossings))
    known = np.array([each.acceleration_m_s2 is not None for each in others], dtype=bool)
    ahead = _may_meet(crossings, others, own)
    driving_on = ahead & known & _drive_on(crossings, others, own, reaction_s)
    on_others, on_own = [each.driving_on for each in others], own.driving_on
    for chosen, behaviour, other_drivers, own_driver in (
        (ahead & known, _behaviour, others, own),
        (ahead & ~known, _behaviour, others, own),
        (driving_on, _behaviour_driving_on, on_others, on_own),
    ):
        group = np.flatnonzero(chosen)
        for begin in range(0, len(group), _PAIRS_AT_ONCE // len(_POINTS)):
            some = group[begin : begin + _PAIRS_AT_ONCE // len(_POINTS)]
            mean = _mean(
                [crossings[at] for at in some],
                [other_drivers[at] for at in some],
                own_driver,
                behaviour,
            )
            p_c[some] = np.maximum(p_c[some], mean)
    return p_c


def _drive_on(
    crossings: Sequence[PathCrossing],
    others: Sequence[DrivenVehicle],
    own: DrivenVehicle,
    reaction_s: float,
) -> NDArray[np.bool_]:
    """Whether both drivers would have to brake harder than drivers do to stop short, (n).

    The host's driver, who is to be warned, needs time to react, unless he brakes. So does another
    driver who still accelerates, and who goes on accelerating in that time. Both must be known to
    go straight on: in a bend, the courses of all oncoming vehicles cross the host's. Nobody stops
    for a host vehicle that turns left and has to yield. Signals say so sooner.
    """
    if not crossings or own.acceleration_m_s2 is None or not _goes_straight(own):
        return np.zeros(len(crossings), dtype=bool)
    own_d, own_v, other_d, other_v = np.array([each.mean for each in crossings]).T
    half, half_other = _zone_halves_m(crossings, others, own)
    gaining = np.array([_gaining_m_s2(each.acceleration_m_s2) for each in others])
    own_gaining = np.full(len(crossings), _gaining_m_s2(own.acceleration_m_s2))
    own_brakes = np.full(len(crossings), own.acceleration_m_s2 <= -BRAKING_M_S2)
    own_reactions_s = np.where(own_brakes, 0.0, reaction_s)
    straight = np.array([_goes_straight(each) for each in others])
    brakes = np.array([(each.acceleration_m_s2 or 0.0) <= -ANSWERING_M_S2 for each in others])
    room_m, other_reactions_s = other_d - half_other, np.where(gaining > 0.0, REACTION_S, 0.0)
    keeps_on = ~brakes & (own.turns_left | (room_m <= STOPPING_S * other_v))
    own_m = own_d - half
    passes_green = np.array([each.passes_green for each in others])
    keeps_green = own.passes_green & ~passes_green  # both: no signal parts them
    keeps_on |= np.array([each.passes_red for each in others])
    keeps_on |= passes_green & (not own.passes_green)
    keeps_turning = own.turns_left & ~own_brakes & (own_m <= (reaction_s + STOPPING_S) * own_v)
    own_drives_on = (
        keeps_turning
        | keeps_green
        | _cannot_stop(own_m, own_v, own_gaining, own_reactions_s, own_brakes)
    )
    other_drives_on = keeps_on | _cannot_stop(room_m, other_v, gaining, other_reactions_s, brakes)
    both: NDArray[np.bool_] = straight & own_drives_on & other_drives_on
    return both


def _goes_straight(vehicle: DrivenVehicle) -> bool:
    return vehicle.lateral_m_s2 is not None and abs(vehicle.lateral_m_s2) <= MAX_LATERAL_M_S2


def _gaining_m_s2(acceleration_m_s2: float | None) -> float:
    """Acceleration of a driver who clearly accelerates, else 0."""
    gaining = acceleration_m_s2 or 0.0
    return gaining if gaining > GAINING_M_S2 else 0.0


def _cannot_stop(
    room_m: Array,
    speed_m_s: Array,
    gaining_m_s2: Array,
    after_s: Array,
    brakes: NDArray[np.bool_],
) -> NDArray[np.bool_]:
    """Whether more than drivers brake with is needed to stop in `room_m`, from `after_s` on.

    So is it for a driver who sets off right before the other's path.
    """
    then_m_s = speed_m_s + gaining_m_s2 * after_s
    left_m = room_m - (speed_m_s + then_m_s) / 2.0 * after_s
    sets_off = (gaining_m_s2 > 0.0) & (speed_m_s < SETTING_OFF_M_S) & (room_m < SETTING_OFF_M)
    stopping_m_s2 = np.where(brakes, STOPPING_LATE_M_S2, STOPPING_M_S2)
    hard: NDArray[np.bool_] = sets_off | (left_m <= then_m_s**2 / (2.0 * stopping_m_s2))
    return hard


def _may_meet(
    crossings: Sequence[PathCrossing], others: Sequence[DrivenVehicle], own: DrivenVehicle
) -> NDArray[np.bool_]:
    """Whether neither vehicle is certainly past the zone, (n); if one is, P_C is exactly 0."""
    if not crossings:
        return np.zeros(0, dtype=bool)
    means = np.array([each.mean for each in crossings])
    spread = np.array([each.covariance.diagonal() for each in crossings])
    # No point is farther from the mean than sqrt(6) sigma.
    nearest = means + np.sqrt(6.0 * np.maximum(spread, 0.0)) * (1.0 + _ROUNDING) + _ROUNDING
    half, half_other = _zone_halves_m(crossings, others, own)
    may: NDArray[np.bool_] = (nearest[:, 0] > -half) & (nearest[:, 2] > -half_other)
    return may


def _zone_halves_m(
    crossings: Sequence[PathCrossing], others: Sequence[DrivenVehicle], own: DrivenVehicle
) -> tuple[Array, Array]:
    """Half lengths of the conflict zone along the host's path and along the other's, (n)."""
    size = CarSize(np.array(own.length_m), np.array(own.width_m))
    theirs = CarSize(
        np.array([each.length_m for each in others]), np.array([each.width_m for each in others])
    )
    angle = np.array([each.angle_rad for each in crossings])
    _, half = XCrossing(size, theirs, angle).extent_m()
    _, half_other = XCrossing(theirs, size, angle).extent_m()
    return half, half_other


def _mean(
    crossings: Sequence[PathCrossing],
    others: Sequence[DrivenVehicle],
    own: DrivenVehicle,
    behaviour: Callable[[Array | None], Behaviour],
) -> Array:
    """Mean P_C, (n); the acceleration of the other vehicles is known of all, or of none."""
    means = np.array([each.mean for each in crossings])
    roots = np.array([_square_root(each.covariance) for each in crossings])
    drawn = means[:, None, :] + np.einsum("nij,pj->npi", roots, _POINTS)
    own_d, own_v, other_d, other_v = drawn.reshape(-1, 4).T[:, :, None]

    def each_point(values: list[float]) -> Array:
        return np.repeat(np.array(values), len(_POINTS))[:, None]

    accelerations = [
        each.acceleration_m_s2 for each in others if each.acceleration_m_s2 is not None
    ]
    zone = XCrossing(
        CarSize(np.array(own.length_m), np.array(own.width_m)),
        CarSize(
            each_point([each.length_m for each in others]),
            each_point([each.width_m for each in others]),
        ),
        each_point([each.angle_rad for each in crossings]),
    )

    def approach(distance_m: Array, speed_m_s: Array, present_m_s2: Array | None) -> Approach:
        top = np.array(TOP_SPEED_M_S)
        return Approach(distance_m, np.maximum(speed_m_s, 0.0), top, behaviour(present_m_s2))

    own_present = None if own.acceleration_m_s2 is None else np.array(own.acceleration_m_s2)
    other_present = each_point(accelerations) if accelerations else None
    p_c = collision_probability(
        approach(own_d, own_v, own_present), approach(other_d, other_v, other_present), zone
    )
    mean: Array = p_c.reshape(len(crossings), -1) @ _WEIGHTS
    return mean


def _behaviour(present_m_s2: Array | None) -> Behaviour:
    lowest, highest = np.array(-MAX_BRAKING_M_S2), np.array(MAX_ACCELERATION_M_S2)
    if present_m_s2 is None:
        return Uniform(lowest, highest)
    return Triangular(lowest, present_m_s2, highest)


def _behaviour_driving_on(present_m_s2: Array | None) -> Behaviour:
    """Behaviour of a driver who does not stop: the present acceleration, none, or between."""
    assert present_m_s2 is not None  # noqa: S101 (only drivers of known acceleration drive on)
    lowest = np.minimum(present_m_s2, 0.0) - DRIVING_ON_M_S2
    highest = np.maximum(present_m_s2, 0.0) + DRIVING_ON_M_S2
    return Triangular(lowest, present_m_s2, highest)


def _square_root(covariance: Array) -> Array:
    """A matrix whose product with its transpose is `covariance`, which may be singular."""
    values, vectors = np.linalg.eigh(covariance)
    root: Array = vectors * np.sqrt(np.maximum(values, 0.0))
    return root
