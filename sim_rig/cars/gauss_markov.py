"""Errors and speeds that change slowly: a first-order Gauss-Markov process of constant variance."""

import math

from onboard.kinematics.arrays import Array


def wandered(values: Array, sigmas: Array | float, times: float, draws: Array) -> Array:
    """Return the values of such a process (Ornstein-Uhlenbeck) after so many of its times.

    Args:
        values: the present ones.
        sigmas: their deviations; 1 if those of `draws` are the values' own.
        times: the time that passes, by that in which the correlation falls to 1/e.
        draws: as many independent ones of the normal distribution.
    """
    keep = math.exp(-times)
    result: Array = keep * values + math.sqrt(1.0 - keep**2) * sigmas * draws
    return result
