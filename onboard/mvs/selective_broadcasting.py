"""Which measurements and estimates to broadcast (section IV-A, Algorithm 1; baselines, V-A)."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from onboard.mvs.settings import Selection
from onboard.tracking.evidence import Evidence, Measurement


@dataclass(frozen=True, slots=True, eq=False)
class Candidate:
    """A known car without a radio, with what came in about it during the window."""

    evidence: Sequence[Evidence]
    """All MEs about it that may be sent on; at least one."""
    received: int
    """How many were sensed or received in the window, those not to be sent on included."""
    is_seen: bool
    """Whether a direct measurement is among them."""
    told_ms: int = 0
    """When the own car last told of it."""

    @property
    def significance(self) -> float:
        """The fewer know of a car, the more important it is to tell of it."""
        return 1.0 / self.received


Estimator = Callable[[Sequence[Sequence[Evidence]]], list[Evidence]]
"""The cooperative estimation, of many cars at once: one ME for each from all MEs about it."""
Selected = tuple[int, Evidence]
"""Which of the candidates, and what is told of it."""


def algorithm_1(
    candidates: Sequence[Candidate],
    most: int,
    estimate: Estimator,
    rng: np.random.Generator,  # noqa: ARG001 (all selections have one signature)
) -> list[Selected]:
    """Select at most `most` MEs: of cars that the own car sees first, then by significance.

    Among equals, those come first that were last told of the longest ago; the paper leaves it open.
    """
    order = sorted(range(len(candidates)), key=lambda at: _rank(candidates[at]))[:most]
    return list(zip(order, _one_of_each([candidates[at] for at in order], estimate), strict=True))


def random_selection(
    candidates: Sequence[Candidate], most: int, estimate: Estimator, rng: np.random.Generator
) -> list[Selected]:
    """RS: one ME of each car as in Algorithm 1, but of `most` cars at random."""
    order = rng.permutation(len(candidates))[:most].tolist()
    return list(zip(order, _one_of_each([candidates[at] for at in order], estimate), strict=True))


def measurements_only(
    candidates: Sequence[Candidate],
    most: int,
    estimate: Estimator,  # noqa: ARG001 (all selections have one signature)
    rng: np.random.Generator,
) -> list[Selected]:
    """MO: `most` of all direct and indirect measurements at random."""
    measurements = [
        (at, piece)
        for at, candidate in enumerate(candidates)
        for piece in candidate.evidence
        if isinstance(piece, Measurement)
    ]
    return [measurements[at] for at in rng.permutation(len(measurements))[:most]]


SELECTIONS = {
    Selection.MVS: algorithm_1,
    Selection.RANDOM: random_selection,
    Selection.MEASUREMENTS_ONLY: measurements_only,
}


def _rank(candidate: Candidate) -> tuple[bool, float, int]:
    return not candidate.is_seen, -candidate.significance, candidate.told_ms


def _one_of_each(candidates: Sequence[Candidate], estimate: Estimator) -> list[Evidence]:
    """Lines 4 to 9: a car's only ME as it is, or an estimate from all of them."""
    several = iter(estimate([c.evidence for c in candidates if len(c.evidence) > 1]))
    return [
        next(several) if len(candidate.evidence) > 1 else candidate.evidence[0]
        for candidate in candidates
    ]
