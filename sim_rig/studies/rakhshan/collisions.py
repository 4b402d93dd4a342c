"""Rear-end collisions of a chain of cars: the four kinds of Table I, and pile-ups.

kind   the lead        the follower
1      still moves     has not reacted
2      has stopped     has not reacted
3      still moves     brakes
4      has stopped     brakes
"""

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from onboard.access.rear_end import Array

NO_COLLISION = 0
KINDS = (1, 2, 3, 4)


class CarBraking(NamedTuple):
    """How a car brakes; both broadcast."""

    deceleration_m_s2: Array
    """Positive."""
    begins_at_s: Array


def collision_kind(
    gap_m: Array, speed_m_s: float | Array, lead: CarBraking, follower: CarBraking
) -> NDArray[np.int8]:
    """Kind of the first collision of two cars that drive at one speed until they brake.

    Between the times at which one of the two begins to brake or stops, the gap is a quadratic of
    time, so its first zero is exact. All arguments broadcast.

    Args:
        gap_m: from the follower's front to the rear of the lead, at 0 s.
        speed_m_s: of both.
        lead: deceleration of the lead, and when it begins.
        follower: of the car behind it.

    Returns:
        1 to 4 as in Table I, `NO_COLLISION` for none.

    Raises:
        ValueError: a gap or speed is negative, or a deceleration not positive.
    """
    if np.any(gap_m < 0.0) or np.any(np.less(speed_m_s, 0.0)):
        raise ValueError("gaps and speeds must not be negative")
    if np.any(lead.deceleration_m_s2 <= 0.0) or np.any(follower.deceleration_m_s2 <= 0.0):
        raise ValueError("decelerations must be positive")
    gap, speed, lead_a, lead_at, a, at = np.broadcast_arrays(gap_m, speed_m_s, *lead, *follower)
    lead, follower = CarBraking(lead_a, lead_at), CarBraking(a, at)
    lead_stops, stops = lead_at + speed / lead_a, at + speed / a
    begin_s = [np.zeros_like(gap), np.maximum(lead_at, 0.0), np.maximum(at, 0.0)]
    edges_s = np.sort(np.stack([*begin_s, lead_stops, stops]), axis=0)
    kind = np.where(gap <= 0.0, 1, NO_COLLISION).astype(np.int8)
    for begin, end in pairwise(edges_s):
        middle = 0.5 * (begin + end)
        lead_slows = (middle > lead_at) & (middle < lead_stops)
        slows = (middle > at) & (middle < stops)
        opening_m_s2 = np.where(slows, a, 0.0) - np.where(lead_slows, lead_a, 0.0)
        opening_m_s = speed_after(begin, speed, lead) - speed_after(begin, speed, follower)
        gap_now_m = gap + travelled_m(begin, speed, lead) - travelled_m(begin, speed, follower)
        hits = _first_zero(gap_now_m, opening_m_s, 0.5 * opening_m_s2) <= end - begin
        found = 1 + (middle > lead_stops) + 2 * (middle > at)
        kind = np.where((kind == NO_COLLISION) & hits, found, kind).astype(np.int8)
    return kind


def speed_after(time_s: Array | float, speed_m_s: Array | float, car: CarBraking) -> Array:
    """Speed in m/s at `time_s` of a car that drove at `speed_m_s` until it braked."""
    slowed_m_s = car.deceleration_m_s2 * np.maximum(time_s - car.begins_at_s, 0.0)
    return np.maximum(speed_m_s - slowed_m_s, 0.0)


def travelled_m(time_s: Array | float, speed_m_s: Array | float, car: CarBraking) -> Array:
    """Distance in m from 0 s to `time_s` of a car that drove at `speed_m_s` until it braked."""
    braked_s = np.clip(time_s - car.begins_at_s, 0.0, speed_m_s / car.deceleration_m_s2)
    unbraked_m = speed_m_s * (np.minimum(time_s, car.begins_at_s) + braked_s)
    result: Array = unbraked_m - 0.5 * car.deceleration_m_s2 * braked_s**2
    return result


def hits_in_pile_up(
    gap_m: Array, speed_m_s: float, braking: CarBraking, is_late: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """Whether each follower hits the lead if a collision shortens the way to standstill.

    A car that hits its lead comes to rest no further than behind it, so the car that follows
    has less room.

    Args:
        gap_m: (..., cars) to the lead.
        speed_m_s: of all cars before they brake.
        braking: of each car, (..., cars).
        is_late: (..., cars - 1) whether a follower hits a lead that brakes undisturbed.

    Returns:
        (..., cars - 1).
    """
    stopping_m = speed_m_s * braking.begins_at_s
    stopping_m = stopping_m + 0.5 * speed_m_s**2 / braking.deceleration_m_s2
    hits = np.zeros_like(is_late)
    rest_m = stopping_m[..., 0]
    for i in range(stopping_m.shape[-1] - 1):
        room_m = rest_m + gap_m[..., i + 1]
        hits[..., i] = is_late[..., i] | (stopping_m[..., i + 1] > room_m)
        rest_m = np.minimum(stopping_m[..., i + 1], room_m)
    return hits


def _first_zero(constant: Array, linear: Array, quadratic: Array) -> Array:
    """First t >= 0 at which constant + linear t + quadratic t^2 falls to 0; infinite for none."""
    discriminant = linear**2 - 4.0 * quadratic * constant
    root = np.sqrt(np.maximum(discriminant, 0.0))
    with np.errstate(divide="ignore", invalid="ignore"):
        nearer = 2.0 * constant / (root - linear)  # this form loses no digits
        farther = (-linear - root) / (2.0 * quadratic)
    first = np.where(root - linear > 0.0, nearer, np.where(quadratic < 0.0, farther, np.inf))
    return np.where((discriminant < 0.0) | (first < 0.0) | np.isnan(first), np.inf, first)
