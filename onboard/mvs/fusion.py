"""From independent evidence of a car to one estimate of it (section IV-B).

Each estimate is made anew from its evidence, in order of time and from no prior knowledge. So a
late measurement falls where it belongs, and an estimate depends on the measurements in its
provenance and on nothing else.
"""

from collections.abc import Sequence

import numpy as np

from onboard.mvs.evidence import Estimate, Evidence
from onboard.mvs.kalman import Array, predict, update_position, update_state
from onboard.mvs.kinematics import Kinematics
from onboard.mvs.stored_evidence import StoredEvidence

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
    pieces = [piece for evidence in evidence_of_cars for piece in evidence]
    counts = [len(evidence) for evidence in evidence_of_cars]
    fused = filtered(Kinematics.of(pieces), counts, acceleration_density)
    return as_estimates(evidence_of_cars, fused)


def filtered(pieces: Kinematics, counts: Sequence[int], acceleration_density: float) -> Kinematics:
    """Estimate N cars: the first `counts[0]` of the pieces are of the first car, and so on."""
    # The longest first: at step k, the cars that have a k-th piece are the first ones.
    lengths = np.asarray(counts, dtype=np.intp)
    place_of = np.empty_like(lengths)
    place_of[np.argsort(-lengths, kind="stable")] = np.arange(len(lengths))
    cars = np.repeat(np.arange(len(lengths)), lengths)
    by_time = np.lexsort((pieces.stamps_ms, cars))  # of each car, the cars one after the other
    steps = np.arange(len(cars)) - np.repeat(np.cumsum(lengths) - lengths, lengths)
    pieces = pieces[by_time[np.lexsort((place_of[cars], steps))]]
    begin = len(lengths)
    first = pieces[:begin].with_any_speed(UNKNOWN_SPEED_SIGMA_M_S)
    stamps_ms, states, covariances = first.stamps_ms, first.states, first.covariances
    for n in np.bincount(steps)[1:].tolist():
        piece, begin = pieces[begin : begin + n], begin + n
        dt_s = (piece.stamps_ms - stamps_ms[:n]) / 1000
        states[:, :n], covariances[:, :, :n] = _update(
            *predict(states[:, :n], covariances[:, :, :n], dt_s, acceleration_density), piece
        )
        stamps_ms[:n] = piece.stamps_ms
    return first[place_of]


def as_estimates(
    evidence_of_cars: Sequence[Sequence[StoredEvidence | Evidence]], fused: Kinematics
) -> list[Estimate]:
    """Say of N cars from what each has been fused."""
    states, covariances = fused.states.T.copy(), fused.covariances.transpose(2, 0, 1).copy()
    return [
        Estimate(
            frozenset().union(*[piece.provenance for piece in evidence]),
            state,
            covariance,
            round(stamp_ms),
            min([piece.oldest_ms for piece in evidence]),
        )
        for evidence, state, covariance, stamp_ms in zip(
            evidence_of_cars, states, covariances, fused.stamps_ms.tolist(), strict=True
        )
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
