"""Whether a car runs into the one ahead when both brake, and which of Table I's four kinds it is.

kind   the lead car    the follower
1      still moves     has not reacted
2      has stopped     has not reacted
3      still moves     brakes
4      has stopped     brakes
"""

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from onboard.access.slotted import Array

NO_COLLISION = 0


class Braking(NamedTuple):
    """How a car brakes; both broadcast."""

    deceleration_m_s2: Array
    """Positive."""
    begins_at_s: Array


def collision_kind(
    gap_m: Array, speed_m_s: Array, lead: Braking, follower: Braking
) -> NDArray[np.int8]:
    """Kind of the first collision between two cars that drove at one speed; 0 for none.

    The gap is a quadratic of time between the moments at which one of the two begins to brake or
    stops, so its first zero is found exactly. All arguments broadcast.

    Raises:
        ValueError: a gap or speed is negative, or a deceleration not positive.
    """
    if np.any(gap_m < 0.0) or np.any(speed_m_s < 0.0):
        raise ValueError("gaps and speeds must not be negative")
    if np.any(lead.deceleration_m_s2 <= 0.0) or np.any(follower.deceleration_m_s2 <= 0.0):
        raise ValueError("decelerations are positive")
    gap, speed, lead_a, lead_at, a, at = np.broadcast_arrays(gap_m, speed_m_s, *lead, *follower)
    lead_stops, stops = lead_at + speed / lead_a, at + speed / a
    zero = np.zeros_like(gap)
    turning = np.sort(
        np.stack([zero, np.maximum(lead_at, 0), lead_stops, np.maximum(at, 0), stops]), 0
    )
    kind = np.where(gap <= 0.0, 1, NO_COLLISION).astype(np.int8)
    for begin, end in pairwise(turning):
        middle = 0.5 * (begin + end)
        lead_slows = (middle > lead_at) & (middle < lead_stops)
        slows = (middle > at) & (middle < stops)
        curvature = np.where(slows, a, 0.0) - np.where(lead_slows, lead_a, 0.0)
        closing = _speed(begin, speed, a, at) - _speed(begin, speed, lead_a, lead_at)
        gap_now = gap + _way(begin, speed, lead_a, lead_at) - _way(begin, speed, a, at)
        hit = _first_zero(gap_now, -closing, 0.5 * curvature) <= end - begin
        reacted = 2 * (middle > at)
        stopped = (middle > lead_stops).astype(np.int8)
        kind = np.where((kind == NO_COLLISION) & hit, 1 + stopped + reacted, kind).astype(np.int8)
    return kind


def tolerable_lag_s(
    gap_m: Array,
    lead_speed_m_s: float | Array,
    speed_m_s: float | Array,
    lead_m_s2: Array,
    own_m_s2: Array,
) -> Array:
    """How much later than the lead car the follower may begin to brake, and just not touch it.

    The later it begins, the nearer it comes, so it collides exactly if it lags by more. If it
    brakes harder, the nearest moment may be while both still move, at equal speeds; else it is when
    both stand. Negative where the follower would have to begin first; by how much is exact for
    equal speeds only. All arguments broadcast; the follower moves.
    """
    closing_m_s = np.subtract(speed_m_s, lead_speed_m_s)
    harder_m_s2 = np.subtract(own_m_s2, lead_m_s2)
    ways_m = 0.5 * np.square(lead_speed_m_s) / lead_m_s2 - 0.5 * np.square(speed_m_s) / own_m_s2
    standing_s = (gap_m + ways_m) / speed_m_s
    root = np.maximum(harder_m_s2, 0.0) * (closing_m_s**2 + 2.0 * gap_m * lead_m_s2) / own_m_s2
    moving_s = (np.sqrt(root) - closing_m_s) / lead_m_s2
    # Speeds are equal at (closing + own lag) / harder, and that must be before the lead stops.
    meet = lead_m_s2 * (closing_m_s + own_m_s2 * moving_s) < harder_m_s2 * lead_speed_m_s
    lag_s: Array = np.where((harder_m_s2 > 0.0) & meet, moving_s, standing_s)
    return lag_s


def _speed(time_s: Array, speed: Array, a: Array, at: Array) -> Array:
    return np.maximum(speed - a * np.maximum(time_s - at, 0.0), 0.0)


def _way(time_s: Array, speed: Array, a: Array, at: Array) -> Array:
    braking_s = np.clip(time_s - at, 0.0, speed / a)
    result: Array = speed * np.minimum(time_s, at) + speed * braking_s - 0.5 * a * braking_s**2
    return result


def _first_zero(constant: Array, linear: Array, quadratic: Array) -> Array:
    """The first t >= 0 at which constant + linear t + quadratic t^2 reaches 0 from above."""
    discriminant = linear**2 - 4.0 * quadratic * constant
    with np.errstate(divide="ignore", invalid="ignore"):
        root = np.sqrt(np.maximum(discriminant, 0.0))
        # The form without cancellation: falling at once, or at the far end of a cap.
        falling = 2.0 * constant / (-linear + root)
        capped = (-linear - root) / (2.0 * quadratic)
    first = np.where((-linear + root > 0.0), falling, np.where(quadratic < 0.0, capped, np.inf))
    return np.where((discriminant < 0.0) | (first < 0.0) | np.isnan(first), np.inf, first)
