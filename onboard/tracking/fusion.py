"""Fuses independent evidence of a vehicle to one estimate (section IV-B).

Each estimate is computed anew from its evidence, in order of time and without prior knowledge. So
a late measurement is used in its order, and an estimate depends on the measurements in its
provenance and on nothing else.
"""

from collections.abc import Sequence

import numpy as np

from onboard.kinematics.arrays import Array, StateArrays
from onboard.tracking.evidence import UNKNOWN_SPEED_SIGMA_M_S, Estimate, Evidence, as_arrays
from onboard.tracking.evidence_store import EvidenceStore, StoredEvidence
from onboard.tracking.kalman import predict, update_position, update_state
from onboard.tracking.track import Track

_MAX_GROWTH = 1.2
"""Factor by which a variance may grow on the air: deviations are sent rounded up, by 1.2 % each."""


def fuse(evidence_of_vehicles: Sequence[Sequence[Evidence]], q: float) -> list[Estimate]:
    """Estimate N vehicles from the independent evidence of each.

    Args:
        evidence_of_vehicles: of each vehicle, at least one piece, no measurement in two of them.
        q: spectral density of the acceleration noise, m^2/s^3.

    Returns:
        N estimates, each at the time of its last measurement.
    """
    pieces = [piece for evidence in evidence_of_vehicles for piece in evidence]
    counts = [len(evidence) for evidence in evidence_of_vehicles]
    return _as_estimates(evidence_of_vehicles, _filtered(as_arrays(pieces), counts, q))


def fuse_chosen(changed: Sequence[Track], store: EvidenceStore, now_ms: int, q: float) -> None:
    """Fuse the evidence of the tracks whose choice has changed.

    An estimate by another vehicle that contains the host's own measurements should be at least as
    certain as these alone. If such estimates leave the vehicle less certain, in position or speed,
    the evidence that repeats own measurements is left out.

    Args:
        changed: tracks that have chosen their evidence anew.
        store: has the numbers of their evidence.
        now_ms: UTC.
        q: spectral density of the acceleration noise, m^2/s^3.
    """
    own = [track.choice_without_repeats() for track in changed]
    repeated = [at for at, pieces in enumerate(own) if pieces]
    choices = [track.chosen for track in changed] + [own[at] for at in repeated]
    rows = [stored.row for choice in choices for stored in choice]
    fused = _filtered(store.at(rows), [len(choice) for choice in choices], q)
    variances = _variances(fused, now_ms, q)
    best = list(range(len(changed)))
    for other, at in enumerate(repeated, len(changed)):
        if (variances[:, at] > _MAX_GROWTH * variances[:, other]).any():
            changed[at].chosen, best[at] = own[at], other
    estimates = _as_estimates([track.chosen for track in changed], fused[best])
    for track, estimate in zip(changed, estimates, strict=True):
        track.estimate = estimate


def propagate(estimates: Sequence[Estimate], now_ms: int, q: float) -> tuple[Array, Array]:
    """Predict N estimates to `now_ms`; an estimate later than that stays as it is.

    Args:
        estimates: N of them.
        now_ms: UTC.
        q: spectral density of the acceleration noise, m^2/s^3.

    Returns:
        states (4, N) and covariances (4, 4, N).
    """
    dt_s = np.array([max(now_ms - estimate.stamp_ms, 0) for estimate in estimates]) / 1000
    states = np.array([estimate.state for estimate in estimates]).reshape(-1, 4).T
    covariances = np.array([estimate.covariance for estimate in estimates]).reshape(-1, 4, 4)
    return predict(states, covariances.transpose(1, 2, 0), dt_s, q)


def _filtered(evidence: StateArrays, counts: Sequence[int], q: float) -> StateArrays:
    """Estimate N vehicles; the first `counts[0]` pieces are of the first vehicle, and so on."""
    # Longest first: at step k, the vehicles that have a k-th piece are the first ones.
    lengths = np.asarray(counts, dtype=np.intp)
    place_of = np.empty_like(lengths)
    place_of[np.argsort(-lengths, kind="stable")] = np.arange(len(lengths))
    vehicles = np.repeat(np.arange(len(lengths)), lengths)
    by_time = np.lexsort((evidence.stamps_ms, vehicles))  # within each vehicle
    steps = np.arange(len(vehicles)) - np.repeat(np.cumsum(lengths) - lengths, lengths)
    evidence = evidence[by_time[np.lexsort((place_of[vehicles], steps))]]
    begin = len(lengths)
    first = evidence[:begin].with_unknown_speed(UNKNOWN_SPEED_SIGMA_M_S)
    stamps_ms, states = first.stamps_ms.copy(), first.states.copy()
    covariances = first.covariances.copy(order="K")
    for n in np.bincount(steps)[1:].tolist():
        piece, begin = evidence[begin : begin + n], begin + n
        dt_s = (piece.stamps_ms - stamps_ms[:n]) / 1000
        states[:, :n], covariances[:, :, :n] = _update(
            *predict(states[:, :n], covariances[:, :, :n], dt_s, q), piece
        )
        stamps_ms[:n] = piece.stamps_ms
    return StateArrays(stamps_ms, states, covariances, first.has_speed)[place_of]


def _update(states: Array, covariances: Array, pieces: StateArrays) -> tuple[Array, Array]:
    """Use one piece of each vehicle: the 2 x 4 model for measurements, the 4 x 4 for estimates."""
    if not pieces.has_speed.any():
        return update_position(states, covariances, pieces.states[:2], pieces.covariances[:2, :2])
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


def _as_estimates(
    evidence_of_vehicles: Sequence[Sequence[StoredEvidence | Evidence]], fused: StateArrays
) -> list[Estimate]:
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
            evidence_of_vehicles, states, covariances, fused.stamps_ms.tolist(), strict=True
        )
    ]


def _variances(vehicles: StateArrays, now_ms: int, q: float) -> Array:
    """Variances (2, N) of position and of speed at `now_ms`, each summed over both axes."""
    dt_s = np.maximum(now_ms - vehicles.stamps_ms, 0.0) / 1000
    _, covariances = predict(vehicles.states, vehicles.covariances, dt_s, q)
    variances: Array = np.einsum("iin->in", covariances).reshape(2, 2, -1).sum(axis=1)
    return variances
