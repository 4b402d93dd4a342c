"""From independent evidence of a car to one estimate of it (section IV-B).

Each estimate is made anew from its evidence, in order of time and from no prior knowledge. So a
late measurement falls where it belongs, and an estimate depends on the measurements in its
provenance and on nothing else.
"""

from collections.abc import Sequence

import numpy as np

from onboard.kinematics.arrays import Array, StateArrays
from onboard.tracking.evidence import UNKNOWN_SPEED_SIGMA_M_S, Estimate, Evidence, as_arrays
from onboard.tracking.evidence_store import EvidenceStore, StoredEvidence
from onboard.tracking.kalman import predict, update_position, update_state
from onboard.tracking.track import Track

_ROUNDING = 1.2
"""By this factor a variance may grow on its way: deviations are sent rounded up, by 1.2 % each."""


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
    fused = filtered(as_arrays(pieces), counts, acceleration_density)
    return as_estimates(evidence_of_cars, fused)


def filtered(
    pieces: StateArrays, counts: Sequence[int], acceleration_density: float
) -> StateArrays:
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
    evidence_of_cars: Sequence[Sequence[StoredEvidence | Evidence]], fused: StateArrays
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


def choose_and_fuse(tracks: Sequence[Track], shelf: EvidenceStore, now_ms: int, q: float) -> None:
    """Choose the evidence of each track anew, and fuse what has changed.

    An estimate by another car that contains our own measurements should know at least what these
    say alone. If with such estimates the car is known less well, in place or speed, than without
    them, something is wrong with them, and the evidence that repeats us is left out.

    Args:
        tracks: all of them.
        shelf: where the numbers of their evidence stand.
        now_ms: UTC.
        q: density of the process noise, m^2/s^3.
    """
    changed = [track for track in tracks if track.choose()]
    own = [track.chosen_without_repeaters() for track in changed]
    repeated = [at for at, pieces in enumerate(own) if pieces]
    choices = [track.chosen for track in changed] + [own[at] for at in repeated]
    fused = _fused(choices, shelf, q)
    vague = _vagueness(fused, now_ms, q)
    best = list(range(len(changed)))
    for other, at in enumerate(repeated, len(changed)):
        if (vague[:, at] > _ROUNDING * vague[:, other]).any():
            changed[at].chosen, best[at] = own[at], other
    estimates = as_estimates([track.chosen for track in changed], fused[best])
    for track, estimate in zip(changed, estimates, strict=True):
        track.estimate = estimate


def _fused(
    choices: Sequence[Sequence[StoredEvidence]], shelf: EvidenceStore, q: float
) -> StateArrays:
    rows = [held.row for choice in choices for held in choice]
    return filtered(shelf.at(rows), [len(choice) for choice in choices], q)


def _vagueness(cars: StateArrays, now_ms: int, q: float) -> Array:
    """Variances (2, N) of place and of speed as of now, either over both axes."""
    dt_s = np.maximum(now_ms - cars.stamps_ms, 0.0) / 1000
    _, covariances = predict(cars.states, cars.covariances, dt_s, q)
    variances: Array = np.einsum("iin->in", covariances).reshape(2, 2, -1).sum(axis=1)
    return variances


def _update(states: Array, covariances: Array, pieces: StateArrays) -> tuple[Array, Array]:
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
