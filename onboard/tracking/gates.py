"""Gates: the region around a predicted vehicle in which evidence may belong to it.

The distance between evidence and a vehicle is Mahalanobis': the vehicle is predicted to the time of
the evidence, and the difference is weighed by the sum S of both covariances.
"""

import math
from functools import cache

import numpy as np
from numpy.typing import NDArray

from onboard.kinematics.arrays import Array, StateArrays

GATE_PROBABILITY = 0.9999
"""Share of a vehicle's evidence that its gate lets in. Wide, since a hundred pieces of evidence of
each vehicle arrive every second, and each that the gate leaves out starts a track of its own."""

_SPEED = slice(2, 4)


def with_speed_prior(vehicles: StateArrays, sigma_m_s: float) -> StateArrays:
    """Return the states after a prior speed of 0 +- `sigma_m_s` on either axis.

    Only for distances: the speed of a vehicle that was measured once is unknown, but bounded.
    """
    p = vehicles.covariances
    speed = p[_SPEED, _SPEED] + sigma_m_s**2 * np.eye(2)[:, :, None]
    a, b, c = speed[0, 0], speed[0, 1], speed[1, 1]
    cross = p[:, _SPEED] / (a * c - b * b)
    gain_x = cross[:, 0] * c - cross[:, 1] * b
    gain_y = cross[:, 1] * a - cross[:, 0] * b
    updated = p - gain_x[:, None] * p[2] - gain_y[:, None] * p[3]
    return StateArrays(vehicles.stamps_ms, vehicles.states, updated, vehicles.has_speed)


def are_inside(
    evidence: StateArrays, vehicles: StateArrays, gate_probability: float, q: float
) -> NDArray[np.bool_]:
    """Whether each piece of evidence is inside the gate of the vehicle with the same index.

    Args:
        evidence: N pieces.
        vehicles: N vehicles.
        gate_probability: share of a vehicle's evidence that its gate lets in.
        q: spectral density of the acceleration noise, m^2/s^3.
    """
    squared, _, _ = distances(evidence, vehicles, q)
    inside: NDArray[np.bool_] = squared <= gates(evidence, gate_probability)
    return inside


def gates(evidence: StateArrays, probability: float) -> Array:
    """Return the largest d^2 inside the gate, for each piece of evidence."""
    largest: Array = np.where(evidence.has_speed > 0, gate(probability, 4), gate(probability, 2))
    return largest


@cache
def gate(probability: float, degrees_of_freedom: int) -> float:
    """Return the quantile of the chi-squared distribution with 2 or 4 degrees of freedom.

    P(X > x) is exp(-x/2) with 2, and exp(-x/2) (1 + x/2) with 4 degrees of freedom.
    """
    log_rest = math.log1p(-probability)
    if degrees_of_freedom == 2:
        return -2.0 * log_rest
    above, x = math.inf, 4.0 - 4.0 * log_rest  # Newton's steps come down from the right
    while x < above:
        above = x
        x += (2.0 * (x + 2.0) / x) * (math.log1p(x / 2.0) - x / 2.0 - log_rest)
    return above


def distances(evidence: StateArrays, vehicles: StateArrays, q: float) -> tuple[Array, Array, Array]:
    """Return d^2, ln det S, and the trace of S's position block in m^2.

    The first two are over position and, where both have one, speed. Evidence and vehicles broadcast
    against each other: a column of M pieces against N vehicles gives (M, N), N against N gives (N).

    Args:
        evidence: pieces of evidence.
        vehicles: states to compare them with.
        q: spectral density of the acceleration noise, m^2/s^3.
    """
    dt = (evidence.stamps_ms - vehicles.stamps_ms) / 1000
    drift = q * np.abs(dt)
    x, p, z, r = vehicles.states, vehicles.covariances, evidence.states, evidence.covariances

    def predicted(i: int, j: int) -> Array:
        grown = p[i, j] + dt * (p[i, j + 2] + p[i + 2, j] + dt * p[i + 2, j + 2])
        spread: Array = grown + r[i, j]
        return spread

    noise = drift * dt**2 / 3
    a, b, c = predicted(0, 0) + noise, predicted(0, 1), predicted(1, 1) + noise
    squared, log_det = _mahalanobis(z[0] - x[0] - dt * x[2], z[1] - x[1] - dt * x[3], (a, b, c))
    both = (evidence.has_speed * vehicles.has_speed) > 0
    if not both.any():
        return squared, log_det, a + c
    speed_squared, speed_log_det = _mahalanobis(
        z[2] - x[2],
        z[3] - x[3],
        (
            p[2, 2] + r[2, 2] + drift + 1e-9,
            p[2, 3] + r[2, 3],
            p[3, 3] + r[3, 3] + drift + 1e-9,
        ),
    )
    squared = squared + np.where(both, speed_squared, 0.0)
    return squared, log_det + both * speed_log_det, a + c


def _mahalanobis(dx: Array, dy: Array, spread: tuple[Array, Array, Array]) -> tuple[Array, Array]:
    """Return d^2 and ln det of differences with the covariances [[a, b], [b, c]]."""
    a, b, c = spread
    determinant = a * c - b * b
    # Rounding can make a nearly singular covariance indefinite: then the distance is infinite.
    positive = (determinant > 0.0) & (a > 0.0)
    divisor = np.where(positive, determinant, 1.0)
    squared = (c * dx * dx - 2 * b * dx * dy + a * dy * dy) / divisor
    return np.where(positive, squared, np.inf), np.log(divisor)
