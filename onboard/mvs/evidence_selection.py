"""Which evidence of each car is used, and what comes of it (section IV-B)."""

from collections.abc import Sequence

import numpy as np

from onboard.mvs.evidence_store import EvidenceStore
from onboard.mvs.fusion import as_estimates, filtered
from onboard.mvs.kalman import Array, predict
from onboard.mvs.kinematics import Kinematics
from onboard.mvs.stored_evidence import StoredEvidence
from onboard.mvs.track import Track

_ROUNDING = 1.2
"""By this factor a variance may grow on its way: deviations are sent rounded up, by 1.2 % each."""


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
) -> Kinematics:
    rows = [held.row for choice in choices for held in choice]
    return filtered(shelf.at(rows), [len(choice) for choice in choices], q)


def _vagueness(cars: Kinematics, now_ms: int, q: float) -> Array:
    """Variances (2, N) of place and of speed as of now, either over both axes."""
    dt_s = np.maximum(now_ms - cars.stamps_ms, 0.0) / 1000
    _, covariances = predict(cars.states, cars.covariances, dt_s, q)
    variances: Array = np.einsum("iin->in", covariances).reshape(2, 2, -1).sum(axis=1)
    return variances
