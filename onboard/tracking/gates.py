"""Which piece of evidence belongs to which car: gated, globally optimal assignment.

The distance of a piece from a car is Mahalanobis': the car is carried to the time of the piece, the
difference is weighed with both covariances. What lies outside a car's gate is never assigned to it.
Among all assignments of pieces to cars, at most one each, the one of the greatest likelihood is
taken (d^2 + ln det S, which keeps a vaguely known car from attracting its neighbours' evidence),
after as many pieces as possible have found a car.
"""

import math
from functools import cache

import numpy as np
from numpy.typing import NDArray

from onboard.kinematics.arrays import Array, StateArrays

_SPEED = slice(2, 4)


def with_speed_prior(cars: StateArrays, sigma_m_s: float) -> StateArrays:
    """The same after learning that cars drive at 0 +- `sigma_m_s` on either axis.

    Used for distances only: the speed of a car seen once is not known, but it is not just any.
    """
    p = cars.covariances
    speed = p[_SPEED, _SPEED] + sigma_m_s**2 * np.eye(2)[:, :, None]
    a, b, c = speed[0, 0], speed[0, 1], speed[1, 1]
    cross = p[:, _SPEED] / (a * c - b * b)
    gain_x = cross[:, 0] * c - cross[:, 1] * b
    gain_y = cross[:, 1] * a - cross[:, 0] * b
    learnt = p - gain_x[:, None] * p[2] - gain_y[:, None] * p[3]
    return StateArrays(cars.stamps_ms, cars.states, learnt, cars.has_speed)


def are_inside(
    pieces: StateArrays, cars: StateArrays, gate_probability: float, acceleration_density: float
) -> NDArray[np.bool_]:
    """Whether each of N pieces is inside the gate of its car, the one of N at the same place."""
    squared, _, _ = distances(pieces, cars, acceleration_density)
    inside: NDArray[np.bool_] = squared <= gates(pieces, gate_probability)
    return inside


def gates(pieces: StateArrays, probability: float) -> Array:
    """The largest d^2 that belongs, for each piece."""
    largest: Array = np.where(pieces.has_speed > 0, gate(probability, 4), gate(probability, 2))
    return largest


@cache
def gate(probability: float, degrees_of_freedom: int) -> float:
    """Return what a chi-squared variable of 2 or 4 degrees stays below with `probability`.

    It lies above x with probability exp(-x/2), or exp(-x/2) (1 + x/2).
    """
    log_rest = math.log1p(-probability)
    if degrees_of_freedom == 2:
        return -2.0 * log_rest
    above, x = math.inf, 4.0 - 4.0 * log_rest  # Newton's steps come down from the right
    while x < above:
        above = x
        x += (2.0 * (x + 2.0) / x) * (math.log1p(x / 2.0) - x / 2.0 - log_rest)
    return above


def distances(pieces: StateArrays, cars: StateArrays, q: float) -> tuple[Array, Array, Array]:
    """d^2 and ln det S in position and, if known, speed; and the trace of S in position.

    Pieces and cars are broadcast against each other: a column of M pieces against N cars gives
    (M, N), as many pieces as cars give (N).
    """
    dt = (pieces.stamps_ms - cars.stamps_ms) / 1000
    drift = q * np.abs(dt)
    x, p, z, r = cars.states, cars.covariances, pieces.states, pieces.covariances

    def carried(i: int, j: int) -> Array:
        grown = p[i, j] + dt * (p[i, j + 2] + p[i + 2, j] + dt * p[i + 2, j + 2])
        spread: Array = grown + r[i, j]
        return spread

    noise = drift * dt**2 / 3
    a, b, c = carried(0, 0) + noise, carried(0, 1), carried(1, 1) + noise
    squared, log_det = _mahalanobis(z[0] - x[0] - dt * x[2], z[1] - x[1] - dt * x[3], (a, b, c))
    both = (pieces.has_speed * cars.has_speed) > 0
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
    """Of differences with the covariances [[a, b], [b, c]]."""
    a, b, c = spread
    determinant = a * c - b * b
    # Rounding may leave of a needle what is no covariance: nothing is near to that.
    positive = (determinant > 0.0) & (a > 0.0)
    divisor = np.where(positive, determinant, 1.0)
    squared = (c * dx * dx - 2 * b * dx * dy + a * dy * dy) / divisor
    return np.where(positive, squared, np.inf), np.log(divisor)
