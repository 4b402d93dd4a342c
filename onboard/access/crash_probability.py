"""How likely a driver runs into the car ahead if that brakes, by physics and reaction alone.

The collision probability "calculated only based on physical/traffic parameters (without
considering the vehicle to vehicle communication)" by which section III calls a car safe or unsafe.
One minus it is the safety index.
"""

import math

import numpy as np

from onboard.access.rear_end import Array, tolerable_lag_s

POINTS = 8
"""At which an unknown deceleration is looked at; 32 change the probability by under 0.003."""

_NO_TIME_S = 1e-9


def rear_end_crash_probability(
    gap_m: float | Array,
    lead_speed_m_s: float | Array,
    speed_m_s: float | Array,
    log_reaction: tuple[Array | float, Array | float],
    deceleration_m_s2: tuple[float, float],
) -> Array:
    """Probability that the reaction takes longer than the gap tolerates.

    Args:
        gap_m: from the own front to the rear of the car ahead.
        lead_speed_m_s: of the car ahead.
        speed_m_s: own, above 0.
        log_reaction: mean and standard deviation of the reaction time's logarithm.
        deceleration_m_s2: each of the two cars brakes evenly between these, on its own.

    Returns:
        in the shape of what is given, all of which broadcasts.
    """
    low, high = deceleration_m_s2
    brakes = low + (high - low) * (np.arange(POINTS) + 0.5) / POINTS
    mean, sigma = (np.asarray(value)[..., None, None] for value in log_reaction)
    lag_s = tolerable_lag_s(
        np.asarray(gap_m)[..., None, None],
        np.asarray(lead_speed_m_s)[..., None, None],
        np.asarray(speed_m_s)[..., None, None],
        brakes[:, None],
        brakes,
    )
    too_late: Array = normal_share_below((mean - np.log(np.maximum(lag_s, _NO_TIME_S))) / sigma)
    danger: Array = too_late.mean(axis=(-2, -1))
    return danger


def normal_share_below(z: Array) -> Array:
    """Return which share of a standard normal variable is below `z`, to within 1e-7.

    Abramowitz and Stegun, Handbook of Mathematical Functions, 26.2.17.
    """
    t = 1.0 / (1.0 + 0.2316419 * np.abs(z))
    series = np.zeros_like(t)
    for coefficient in (1.330274429, -1.821255978, 1.781477937, -0.356563782, 0.319381530):
        series = t * (coefficient + series)
    outside = series * np.exp(-0.5 * z * z) / math.sqrt(2.0 * math.pi)
    share: Array = np.where(z > 0.0, 1.0 - outside, outside)
    return share
