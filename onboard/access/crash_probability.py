"""Probability of a rear-end crash if the lead vehicle brakes, without V2V communication.

Section III calls a vehicle safe or unsafe by this probability, "calculated only based on
physical/traffic parameters (without considering the vehicle to vehicle communication)". One minus
it is the safety index.
"""

import math

import numpy as np

from onboard.access.rear_end import Array, tolerable_lag_s

POINTS = 8
"""Points of the midpoint rule over each deceleration; 32 change the result by under 0.003."""

_MINIMUM_LAG_S = 1e-9
"""Keeps the logarithm finite where the follower would have to brake first."""


def rear_end_crash_probability(
    gap_m: float | Array,
    lead_speed_m_s: float | Array,
    speed_m_s: float | Array,
    log_reaction: tuple[Array | float, Array | float],
    deceleration_m_s2: tuple[float, float],
) -> Array:
    """Return the probability that the reaction time exceeds the tolerable lag.

    All array arguments broadcast.

    Args:
        gap_m: from the host vehicle's front to the rear of the lead vehicle.
        lead_speed_m_s: speed of the lead vehicle.
        speed_m_s: speed of the host vehicle, above 0.
        log_reaction: mean and standard deviation of the natural logarithm of the reaction time
            in s.
        deceleration_m_s2: limits of the uniform distribution from which the decelerations of
            both vehicles are drawn independently.

    Returns:
        probabilities in the common shape of the arguments.
    """
    low, high = deceleration_m_s2
    decelerations = low + (high - low) * (np.arange(POINTS) + 0.5) / POINTS
    mean, sigma = (np.asarray(value)[..., None, None] for value in log_reaction)
    lag_s = tolerable_lag_s(
        np.asarray(gap_m)[..., None, None],
        np.asarray(lead_speed_m_s)[..., None, None],
        np.asarray(speed_m_s)[..., None, None],
        decelerations[:, None],
        decelerations,
    )
    too_late: Array = normal_cdf((mean - np.log(np.maximum(lag_s, _MINIMUM_LAG_S))) / sigma)
    probability: Array = too_late.mean(axis=(-2, -1))
    return probability


def normal_cdf(z: Array) -> Array:
    """Return the standard normal distribution function at `z`, with an error below 1e-7.

    Abramowitz and Stegun, Handbook of Mathematical Functions, 26.2.17.
    """
    t = 1.0 / (1.0 + 0.2316419 * np.abs(z))
    series = np.zeros_like(t)
    for coefficient in (1.330274429, -1.821255978, 1.781477937, -0.356563782, 0.319381530):
        series = t * (coefficient + series)
    tail = series * np.exp(-0.5 * z * z) / math.sqrt(2.0 * math.pi)
    cdf: Array = np.where(z > 0.0, 1.0 - tail, tail)
    return cdf
