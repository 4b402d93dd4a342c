"""Motion along a path with constant acceleration between standstill and a top speed.

A car that brakes stops and stays; one that accelerates reaches its top speed and keeps it. All
functions broadcast over arrays. `speed_m_s` is at least 0 and at most `top_speed_m_s`.
"""

import numpy as np

from onboard.kinematics.arrays import Array

STANDSTILL_M_S2 = 1e-12
"""Accelerations of smaller magnitude count as zero."""


def travelled_m(time_s: Array, acceleration_m_s2: Array, speed_m_s: Array, top_m_s: Array) -> Array:
    """Distance covered after `time_s`, which may be infinite. Rises with time and acceleration."""
    a = np.where(np.abs(acceleration_m_s2) < STANDSTILL_M_S2, STANDSTILL_M_S2, acceleration_m_s2)
    changing_s = np.minimum(time_s, np.where(a < 0.0, -speed_m_s, top_m_s - speed_m_s) / a)
    steady_m_s = np.where(a < 0.0, 0.0, top_m_s)
    steady_s = time_s - changing_s
    with np.errstate(invalid="ignore"):  # 0 m/s for an infinite time is 0 m
        steady_m = np.where(steady_m_s > 0.0, steady_m_s * steady_s, 0.0)
    result: Array = speed_m_s * changing_s + 0.5 * a * changing_s**2 + steady_m
    return result


def reached_after_s(
    distance_m: Array, acceleration_m_s2: Array, speed_m_s: Array, top_m_s: Array
) -> Array:
    """Time to cover `distance_m`: 0 if it is not positive, infinite if the car stops before."""
    a = np.where(np.abs(acceleration_m_s2) < STANDSTILL_M_S2, STANDSTILL_M_S2, acceleration_m_s2)
    d = np.maximum(distance_m, 0.0)
    squared = speed_m_s**2 + 2.0 * a * d
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        # 2 d / (v + sqrt(v^2 + 2 a d)) has no cancellation where a is small.
        changing_s = 2.0 * d / (speed_m_s + np.sqrt(np.maximum(squared, 0.0)))
        to_top_s = (top_m_s - speed_m_s) / a
        to_top_m = 0.5 * (top_m_s + speed_m_s) * to_top_s
        steady_s = to_top_s + (d - to_top_m) / top_m_s
    beyond_top = (a > 0.0) & (d > to_top_m)
    reached = np.where(beyond_top, steady_s, changing_s)
    reached = np.where(squared < 0.0, np.inf, reached)
    return np.where(distance_m <= 0.0, 0.0, reached)


def acceleration_to_cover(
    distance_m: Array, time_s: Array, speed_m_s: Array, top_m_s: Array
) -> Array:
    """The acceleration in m/s^2 with which exactly `distance_m` is covered after `time_s`.

    `-inf` where any covers more, `+inf` where none covers as much. With `time_s` infinite it is
    the braking that stops at `distance_m`.
    """
    d = np.maximum(distance_m, 0.0)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        unlimited = 2.0 * (d - speed_m_s * time_s) / time_s**2
        final_m_s = speed_m_s + unlimited * time_s
        stopping = -(speed_m_s**2) / (2.0 * d)
        topping = (top_m_s - speed_m_s) ** 2 / (2.0 * (top_m_s * time_s - d))
    a = np.where(final_m_s > top_m_s, topping, unlimited)
    a = np.where((final_m_s < 0.0) | np.isinf(time_s), stopping, a)
    a = np.where(d >= top_m_s * np.where(d > 0.0, time_s, 1.0), np.inf, a)
    return np.where(distance_m <= 0.0, -np.inf, a)
