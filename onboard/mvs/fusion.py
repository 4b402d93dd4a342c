"""From independent evidence of a car to one estimate of it (section IV-B).

Each estimate is made anew from its evidence, in order of time and from no prior knowledge. So a
late measurement falls where it belongs, and an estimate depends on the measurements in its
provenance and on nothing else.
"""

from collections.abc import Sequence

import numpy as np

from onboard.mvs.evidence import Estimate, Evidence, Measurement
from onboard.mvs.kalman import Array, predict, update_position, update_state

UNKNOWN_SPEED_SIGMA_M_S = 100.0
"""Of a car of which one position is known: no knowledge, with margin."""


def fuse(
    evidence_of_cars: Sequence[Sequence[Evidence]], acceleration_density: float
) -> list[Estimate]:
    """Estimate N cars from the independent evidence of each.

    Args:
        evidence_of_cars: of each car, at least one piece, with no measurement in two of them.
        acceleration_density: q of the process noise, m^2/s^3.

    Returns:
        N estimates, each at the time of its last measurement.
    """
    cars = [sorted(evidence, key=_stamp_ms) for evidence in evidence_of_cars]
    # The longest first: at step k, the cars that have a k-th piece are the first ones.
    order = sorted(range(len(cars)), key=lambda car: -len(cars[car]))
    states, covariances = np.empty((4, len(cars))), np.empty((4, 4, len(cars)))
    for place, car in enumerate(order):
        first = as_estimate(cars[car][0])
        states[:, place], covariances[:, :, place] = first.state, first.covariance
    for step in range(1, max((len(evidence) for evidence in cars), default=0)):
        pieces = [cars[car][step] for car in order if len(cars[car]) > step]
        before = [cars[car][step - 1] for car in order[: len(pieces)]]
        dt_s = np.array([b.stamp_ms - a.stamp_ms for a, b in zip(before, pieces, strict=True)])
        n = len(pieces)
        states[:, :n], covariances[:, :, :n] = _update(
            *predict(states[:, :n], covariances[:, :, :n], dt_s / 1000, acceleration_density),
            pieces,
        )
    estimates: list[Estimate | None] = [None] * len(cars)
    for place, car in enumerate(order):
        estimates[car] = Estimate(
            frozenset().union(*(piece.provenance for piece in cars[car])),
            states[:, place].copy(),
            covariances[:, :, place].copy(),
        )
    return estimates  # type: ignore[return-value]


def propagate(
    estimates: Sequence[Estimate], now_ms: int, acceleration_density: float
) -> tuple[Array, Array]:
    """Carry N estimates to `now_ms`; returns states (4, N) and covariances (4, 4, N)."""
    dt_s = np.array([max(now_ms - estimate.stamp_ms, 0) for estimate in estimates]) / 1000
    states = np.array([estimate.state for estimate in estimates]).reshape(-1, 4).T
    covariances = np.array([estimate.covariance for estimate in estimates]).reshape(-1, 4, 4)
    return predict(states, covariances.transpose(1, 2, 0), dt_s, acceleration_density)


def as_estimate(piece: Evidence) -> Estimate:
    """What one piece says of the whole state: a position says nothing of the speed."""
    if isinstance(piece, Estimate):
        return piece
    state, covariance = np.zeros(4), np.eye(4) * UNKNOWN_SPEED_SIGMA_M_S**2
    state[:2], covariance[:2, :2] = piece.position_m, piece.covariance
    return Estimate(piece.provenance, state, covariance)


def _stamp_ms(piece: Evidence) -> int:
    return piece.stamp_ms


def _update(states: Array, covariances: Array, pieces: Sequence[Evidence]) -> tuple[Array, Array]:
    """Use one piece of each car: the 2 x 4 model for measurements, the 4 x 4 for estimates."""
    measured = np.array([isinstance(piece, Measurement) for piece in pieces])
    if measured.any():
        some = [piece for piece in pieces if isinstance(piece, Measurement)]
        states[:, measured], covariances[:, :, measured] = update_position(
            states[:, measured],
            covariances[:, :, measured],
            np.array([piece.position_m for piece in some]).T,
            np.array([piece.covariance for piece in some]).transpose(1, 2, 0),
        )
    if not measured.all():
        rest = [piece for piece in pieces if isinstance(piece, Estimate)]
        states[:, ~measured], covariances[:, :, ~measured] = update_state(
            states[:, ~measured],
            covariances[:, :, ~measured],
            np.array([piece.state for piece in rest]).T,
            np.array([piece.covariance for piece in rest]).transpose(1, 2, 0),
        )
    return states, covariances
