"""From independent evidence of a car to one estimate of it (section IV-B).

Each estimate is made anew from its evidence, in order of time and from no prior knowledge. So a
late measurement falls where it belongs, and an estimate depends on the measurements in its
provenance and on nothing else.
"""

from collections.abc import Sequence
from itertools import zip_longest

import numpy as np

from onboard.mvs.evidence import Estimate, Evidence, stamp_ms_of
from onboard.mvs.kalman import Array, predict, update_position, update_state
from onboard.mvs.kinematics import Kinematics

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
    cars = [sorted(evidence, key=stamp_ms_of) for evidence in evidence_of_cars]
    # The longest first: at step k, the cars that have a k-th piece are the first ones.
    order = sorted(range(len(cars)), key=lambda car: -len(cars[car]))
    steps = [
        [piece for piece in pieces if piece is not None]
        for pieces in zip_longest(*(cars[car] for car in order))
    ]
    pieces = Kinematics.of([piece for step in steps for piece in step])
    begin = len(cars)
    first = pieces[:begin].with_any_speed(UNKNOWN_SPEED_SIGMA_M_S)
    stamps_ms, states, covariances = first.stamps_ms, first.states, first.covariances
    for step in steps[1:]:
        n, begin = len(step), begin + len(step)
        piece = pieces[begin - n : begin]
        dt_s = (piece.stamps_ms - stamps_ms[:n]) / 1000
        states[:, :n], covariances[:, :, :n] = _update(
            *predict(states[:, :n], covariances[:, :, :n], dt_s, acceleration_density), piece
        )
        stamps_ms[:n] = piece.stamps_ms
    place_of = {car: place for place, car in enumerate(order)}
    return [
        Estimate(
            frozenset().union(*[piece.provenance for piece in evidence]),
            states[:, place_of[car]].copy(),
            covariances[:, :, place_of[car]].copy(),
            evidence[-1].stamp_ms,
            min([piece.oldest_ms for piece in evidence]),
        )
        for car, evidence in enumerate(cars)
    ]


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


def _update(states: Array, covariances: Array, pieces: Kinematics) -> tuple[Array, Array]:
    """Use one piece of each car: the 2 x 4 model for measurements, the 4 x 4 for estimates."""
    for model, size, uses in ((update_position, 2, 0.0), (update_state, 4, 1.0)):
        at = np.flatnonzero(pieces.has_speed == uses)
        if len(at):
            states[:, at], covariances[:, :, at] = model(
                states.take(at, axis=1),
                covariances.take(at, axis=2),
                pieces.states[:size].take(at, axis=1),
                pieces.covariances[:size, :size].take(at, axis=2),
            )
    return states, covariances
