"""Which piece of evidence belongs to which car: gated, globally optimal assignment.

The distance of a piece from a car is Mahalanobis': the car is carried to the time of the piece, the
difference is weighed with both covariances. What lies outside a car's gate is never assigned to it.
Among all assignments of pieces to cars, at most one each, the one of the greatest likelihood is
taken (d^2 + ln det S, which keeps a vaguely known car from attracting its neighbours' evidence),
after as many pieces as possible have found a car.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Self

import numpy as np

from onboard.assignment import cheapest_pairs
from onboard.mvs.evidence import Estimate, Evidence, Measurement
from onboard.mvs.kalman import Array

_POSITION, _SPEED = slice(0, 2), slice(2, 4)


@dataclass(frozen=True, slots=True, eq=False)
class Kinematics:
    """N states of cars, or pieces of evidence about them, each at its own time."""

    stamps_ms: Array
    """(N)"""
    states: Array
    """(4, N); the speed of a mere position is 0 and means nothing."""
    covariances: Array
    """(4, 4, N)"""
    has_speed: Array
    """(N), 1.0 or 0.0."""

    def __len__(self) -> int:
        return len(self.stamps_ms)

    def positions_m(self, at_ms: int) -> Array:
        """Where they are at `at_ms`: (2, N)."""
        positions: Array = self.states[:2] + (at_ms - self.stamps_ms) / 1000 * self.states[2:]
        return positions

    @classmethod
    def of(cls, pieces: Sequence[Evidence]) -> Self:
        """Take what is to be compared of `pieces`."""
        n = len(pieces)
        states, covariances = np.zeros((n, 4)), np.zeros((n, 4, 4))
        for at, piece in enumerate(pieces):
            if isinstance(piece, Measurement):
                states[at, :2], covariances[at, :2, :2] = piece.position_m, piece.covariance
            else:
                states[at], covariances[at] = piece.state, piece.covariance
        return cls(
            np.array([piece.stamp_ms for piece in pieces], dtype=np.float64),
            states.T,
            covariances.transpose(1, 2, 0),
            np.array([isinstance(piece, Estimate) for piece in pieces], dtype=np.float64),
        )


def with_speed_prior(covariances: Array, sigma_m_s: float) -> Array:
    """Covariances (4, 4, N) after learning that cars drive at 0 +- `sigma_m_s` on either axis.

    Used for distances only: of a car seen once the speed is not known, but it is no cannonball.
    """
    speed = covariances[_SPEED, _SPEED] + sigma_m_s**2 * np.eye(2)[:, :, None]
    a, b, c = speed[0, 0], speed[0, 1], speed[1, 1]
    cross = covariances[:, _SPEED] / (a * c - b * b)
    gain_x = cross[:, 0] * c - cross[:, 1] * b
    gain_y = cross[:, 1] * a - cross[:, 0] * b
    learnt: Array = (
        covariances - gain_x[:, None] * covariances[2] - gain_y[:, None] * covariances[3]
    )
    return learnt


def assign(
    pieces: Kinematics, cars: Kinematics, gate_probability: float, acceleration_density: float
) -> dict[int, int]:
    """Assign M pieces to N cars; returns the car of each piece that has found one."""
    if not len(pieces) or not len(cars):
        return {}
    squared, spread = _distances(pieces, cars, acceleration_density)
    gates = np.where(pieces.has_speed > 0, gate(gate_probability, 4), gate(gate_probability, 2))
    inside = squared <= gates[:, None]
    rows, columns = np.flatnonzero(inside.any(axis=1)), np.flatnonzero(inside.any(axis=0))
    if not len(rows):
        return {}
    allowed = inside[np.ix_(rows, columns)]
    cost = (squared + spread)[np.ix_(rows, columns)]
    least, most = cost[allowed].min(), cost[allowed].max()
    alone = (most - least + 1) * len(rows)  # dearer than any other assignment of all pieces
    cost = np.where(allowed, cost - least, 2 * alone)
    to_nobody = np.full((len(rows), len(rows)), alone)
    return {
        int(rows[row]): int(columns[column])
        for row, column in cheapest_pairs(np.hstack([cost, to_nobody]))
        if column < len(columns)
    }


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


def _distances(pieces: Kinematics, cars: Kinematics, q: float) -> tuple[Array, Array]:
    """d^2 and ln det S of M pieces from N cars, (M, N) each, in position and, if known, speed."""
    dt = (pieces.stamps_ms[:, None] - cars.stamps_ms) / 1000
    drift = q * np.abs(dt)
    x, p, z, r = cars.states, cars.covariances, pieces.states[:, :, None], pieces.covariances

    def carried(i: int, j: int) -> Array:
        spread: Array = p[i, j] + dt * (p[i, j + 2] + p[i + 2, j] + dt * p[i + 2, j + 2])
        return spread + r[i, j, :, None]

    noise = drift * dt**2 / 3
    squared, log_det = _mahalanobis(
        z[0] - x[0] - dt * x[2],
        z[1] - x[1] - dt * x[3],
        (carried(0, 0) + noise, carried(0, 1), carried(1, 1) + noise),
    )
    both = pieces.has_speed[:, None] * cars.has_speed
    if not both.any():
        return squared, log_det
    speed_squared, speed_log_det = _mahalanobis(
        z[2] - x[2],
        z[3] - x[3],
        (
            p[2, 2] + r[2, 2, :, None] + drift + 1e-9,
            p[2, 3] + r[2, 3, :, None],
            p[3, 3] + r[3, 3, :, None] + drift + 1e-9,
        ),
    )
    return squared + both * speed_squared, log_det + both * speed_log_det


def _mahalanobis(dx: Array, dy: Array, spread: tuple[Array, Array, Array]) -> tuple[Array, Array]:
    """Of differences with the covariances [[a, b], [b, c]]."""
    a, b, c = spread
    determinant = a * c - b * b
    return (c * dx * dx - 2 * b * dx * dy + a * dy * dy) / determinant, np.log(determinant)
