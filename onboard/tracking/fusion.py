"""Fuses independent evidence of a vehicle to one estimate (section IV-B).

Each estimate is computed anew from its evidence, in order of time and without prior knowledge. So
a late measurement is used in its order, and an estimate depends on the measurements in its
provenance and on nothing else.
"""

from collections.abc import Generator, Iterator, Sequence

import numpy as np

from onboard.kinematics.arrays import Array, StateArrays
from onboard.tracking.evidence import UNKNOWN_SPEED_SIGMA_M_S, Estimate, Evidence, as_arrays
from onboard.tracking.evidence_store import EvidenceStore, StoredEvidence
from onboard.tracking.kalman import Steps, advance, predict
from onboard.tracking.slices import batches, result_of
from onboard.tracking.track import Track

_PIECES_AT_ONCE = 256
"""Pieces of evidence that are fused in one slice."""
_TRACKS_AT_ONCE = 64
"""Tracks of which one slice looks for repeats."""
_ESTIMATES_AT_ONCE = 32
"""Estimates that are made in one slice."""
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
    return result_of(fuse_in_slices(evidence_of_vehicles, q))


def fuse_in_slices(
    evidence_of_vehicles: Sequence[Sequence[Evidence]], q: float
) -> Generator[None, None, list[Estimate]]:
    """Do what `fuse` does in slices."""
    pieces = [piece for evidence in evidence_of_vehicles for piece in evidence]
    counts = [len(evidence) for evidence in evidence_of_vehicles]
    fused = yield from _filtered(as_arrays(pieces), counts, q)
    return _as_estimates(evidence_of_vehicles, fused)


def fuse_stored(
    evidence_of_vehicles: Sequence[Sequence[StoredEvidence]], store: EvidenceStore, q: float
) -> Generator[None, None, list[Estimate]]:
    """Do what `fuse` does in slices, with evidence whose numbers are in `store`."""
    fused = yield from _filtered_stored(evidence_of_vehicles, store, q)
    return _as_estimates(evidence_of_vehicles, fused)


def fuse_chosen(
    changed: Sequence[Track], store: EvidenceStore, now_ms: int, q: float
) -> Iterator[None]:
    """Fuse in slices the evidence of the tracks whose choice has changed.

    An estimate by another vehicle that contains the host's own measurements should be at least as
    certain as these alone. If such estimates leave the vehicle less certain, in position or speed,
    the evidence that repeats own measurements is left out.

    Args:
        changed: tracks that have chosen their evidence anew.
        store: has the numbers of their evidence.
        now_ms: UTC.
        q: spectral density of the acceleration noise, m^2/s^3.
    """
    own = []
    for at, track in enumerate(changed):
        own.append(track.choice_without_repeats())
        if at % _TRACKS_AT_ONCE == _TRACKS_AT_ONCE - 1:
            yield
    repeated = [at for at, pieces in enumerate(own) if pieces]
    choices = [track.chosen for track in changed] + [own[at] for at in repeated]
    fused = yield from _filtered_stored(choices, store, q)
    yield
    variances = _variances(fused, now_ms, q)
    best = list(range(len(changed)))
    for other, at in enumerate(repeated, len(changed)):
        if (variances[:, at] > _MAX_GROWTH * variances[:, other]).any():
            changed[at].chosen, best[at] = own[at], other
    for some in batches(list(zip(changed, best, strict=True)), _ESTIMATES_AT_ONCE):
        rows = [row for _, row in some]
        estimates = _as_estimates([track.chosen for track, _ in some], fused[rows])
        for (track, _), estimate in zip(some, estimates, strict=True):
            track.estimate = estimate
        yield


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


def _filtered_stored(
    choices: Sequence[Sequence[StoredEvidence]], store: EvidenceStore, q: float
) -> Generator[None, None, StateArrays]:
    pieces = store.at([stored.row for choice in choices for stored in choice])
    yield
    return (yield from _filtered(pieces, [len(choice) for choice in choices], q))


def _filtered(
    evidence: StateArrays, counts: Sequence[int], q: float
) -> Generator[None, None, StateArrays]:
    """Estimate N vehicles in slices.

    The first `counts[0]` pieces are of the first vehicle, and so on.
    """
    # Longest first: at step k, the vehicles that have a k-th piece are the first ones.
    lengths = np.asarray(counts, dtype=np.intp)
    place_of = np.empty_like(lengths)
    place_of[np.argsort(-lengths, kind="stable")] = np.arange(len(lengths))
    vehicles = np.repeat(np.arange(len(lengths)), lengths)
    by_time = np.lexsort((evidence.stamps_ms, vehicles))  # within each vehicle
    numbers = np.arange(len(vehicles)) - np.repeat(np.cumsum(lengths) - lengths, lengths)
    ordered = evidence[by_time]
    dt_s = np.diff(ordered.stamps_ms, prepend=0.0) / 1000  # of no use where a vehicle begins
    by_step = np.lexsort((place_of[vehicles], numbers))
    evidence, begin = ordered[by_step], len(lengths)
    steps = Steps.of(evidence[begin:], dt_s[by_step[begin:]], q)
    yield
    first = evidence[:begin].with_unknown_speed(UNKNOWN_SPEED_SIGMA_M_S)
    states, covariances = first.states.T[:, :, None].copy(), first.covariances.transpose(2, 0, 1)
    covariances = covariances.copy()
    last = by_step[:begin].copy()
    done = 0
    for n in np.bincount(numbers)[1:].tolist():
        states[:n], covariances[:n] = advance(states[:n], covariances[:n], steps[done : done + n])
        last[:n] = by_step[begin + done : begin + done + n]
        done += n
        if done // _PIECES_AT_ONCE > (done - n) // _PIECES_AT_ONCE:
            yield
    return StateArrays(
        ordered.stamps_ms[last], states[:, :, 0].T, covariances.transpose(1, 2, 0), first.has_speed
    )[place_of]


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
