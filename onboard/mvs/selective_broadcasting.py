"""Which measurements and estimates to broadcast (section IV-A, Algorithm 1; baselines, V-A)."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from onboard.mvs.evidence import Evidence, Measurement
from onboard.mvs.settings import Selection


@dataclass(frozen=True, slots=True, eq=False)
class Candidate:
    """A known car without a radio, with what came in about it during the window."""

    evidence: Sequence[Evidence]
    """All MEs about it that may be sent on; at least one."""
    received: int
    """How many were sensed or received in the window, those not to be sent on included."""
    is_seen: bool
    """Whether a direct measurement is among them."""

    @property
    def significance(self) -> float:
        """The fewer know of a car, the more important it is to tell of it."""
        return 1.0 / self.received


Estimator = Callable[[Sequence[Sequence[Evidence]]], list[Evidence]]
"""The cooperative estimation, of many cars at once: one ME for each from all MEs about it."""


def algorithm_1(
    candidates: Sequence[Candidate],
    most: int,
    estimate: Estimator,
    rng: np.random.Generator,  # noqa: ARG001 (all selections have one signature)
) -> list[Evidence]:
    """Select at most `most` MEs: of cars that the own car sees first, then by significance."""
    one_of_each = _one_of_each(candidates, estimate)
    first_seen = sorted(
        range(len(candidates)),
        key=lambda at: (not candidates[at].is_seen, -candidates[at].significance),
    )
    return [one_of_each[at] for at in first_seen[:most]]


def random_selection(
    candidates: Sequence[Candidate], most: int, estimate: Estimator, rng: np.random.Generator
) -> list[Evidence]:
    """RS: one ME of each car as in Algorithm 1, but of `most` cars at random."""
    one_of_each = _one_of_each(candidates, estimate)
    return [one_of_each[at] for at in rng.permutation(len(one_of_each))[:most]]


def measurements_only(
    candidates: Sequence[Candidate],
    most: int,
    estimate: Estimator,  # noqa: ARG001 (all selections have one signature)
    rng: np.random.Generator,
) -> list[Evidence]:
    """MO: `most` of all direct and indirect measurements at random."""
    measurements = [
        piece
        for candidate in candidates
        for piece in candidate.evidence
        if isinstance(piece, Measurement)
    ]
    return [measurements[at] for at in rng.permutation(len(measurements))[:most]]


SELECTIONS = {
    Selection.MVS: algorithm_1,
    Selection.RANDOM: random_selection,
    Selection.MEASUREMENTS_ONLY: measurements_only,
}


def _one_of_each(candidates: Iterable[Candidate], estimate: Estimator) -> list[Evidence]:
    """Lines 4 to 9: a car's only ME as it is, or an estimate from all of them."""
    candidates = list(candidates)
    several = iter(estimate([c.evidence for c in candidates if len(c.evidence) > 1]))
    return [
        next(several) if len(candidate.evidence) > 1 else candidate.evidence[0]
        for candidate in candidates
    ]
