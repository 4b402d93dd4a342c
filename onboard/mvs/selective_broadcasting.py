"""Which measurements and estimates to broadcast (section IV-A, Algorithm 1; baselines, V-A)."""

from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass

import numpy as np

from onboard.mvs.settings import Selection
from onboard.tracking.evidence import Evidence, Measurement


@dataclass(frozen=True, slots=True, eq=False)
class Candidate:
    """A reported vehicle without radio, with the evidence of it that arrived in the window."""

    evidence: Sequence[Evidence]
    """All MEs about it that may be sent; at least one."""
    received: int
    """Number of MEs measured or received in the window, including those not to be sent."""
    is_sensed: bool
    """Whether a direct measurement is among them."""
    sent_ms: int = 0
    """When the host vehicle last sent something of it."""

    @property
    def significance(self) -> float:
        """1 over the number of received MEs: the fewer vehicles report it, the higher."""
        return 1.0 / self.received


Estimates = Generator[None, None, list[Evidence]]
"""One ME for each of many vehicles, in slices."""
Estimator = Callable[[Sequence[Sequence[Evidence]]], Estimates]
"""The cooperative estimation: one ME for each vehicle from all MEs about it."""
Selected = tuple[int, Evidence]
"""Index of a candidate, and the ME that is sent of it."""
Selecting = Generator[None, None, list[Selected]]
"""A selection in slices."""


def algorithm_1(
    candidates: Sequence[Candidate],
    max_entries: int,
    estimate: Estimator,
    rng: np.random.Generator,  # noqa: ARG001 (all selections have one signature)
) -> Selecting:
    """Select MEs of vehicles that own sensors measure first, then by significance.

    Among equals, those come first that were last sent the longest ago; the paper leaves it open.

    Args:
        candidates: all that may be sent.
        max_entries: M.
        estimate: combines the MEs of one vehicle.
        rng: not used.
    """
    order = sorted(range(len(candidates)), key=lambda at: _rank(candidates[at]))[:max_entries]
    selected = yield from _one_of_each([candidates[at] for at in order], estimate)
    return list(zip(order, selected, strict=True))


def random_selection(
    candidates: Sequence[Candidate],
    max_entries: int,
    estimate: Estimator,
    rng: np.random.Generator,
) -> Selecting:
    """RS: select one ME of each vehicle as in Algorithm 1, but of vehicles at random.

    Args:
        candidates: all that may be sent.
        max_entries: M.
        estimate: combines the MEs of one vehicle.
        rng: chooses the vehicles.
    """
    order = rng.permutation(len(candidates))[:max_entries].tolist()
    selected = yield from _one_of_each([candidates[at] for at in order], estimate)
    return list(zip(order, selected, strict=True))


def measurements_only(
    candidates: Sequence[Candidate],
    max_entries: int,
    estimate: Estimator,  # noqa: ARG001 (all selections have one signature)
    rng: np.random.Generator,
) -> Selecting:
    """MO: select among all direct and indirect measurements at random.

    Args:
        candidates: all that may be sent.
        max_entries: M.
        estimate: not used.
        rng: chooses the measurements.
    """
    measurements = [
        (at, piece)
        for at, candidate in enumerate(candidates)
        for piece in candidate.evidence
        if isinstance(piece, Measurement)
    ]
    yield
    return [measurements[at] for at in rng.permutation(len(measurements))[:max_entries]]


SELECTIONS = {
    Selection.MVS: algorithm_1,
    Selection.RANDOM: random_selection,
    Selection.MEASUREMENTS_ONLY: measurements_only,
}


def _rank(candidate: Candidate) -> tuple[bool, float, int]:
    return not candidate.is_sensed, -candidate.significance, candidate.sent_ms


def _one_of_each(candidates: Sequence[Candidate], estimate: Estimator) -> Estimates:
    """Lines 4 to 9: a vehicle's only ME as it is, or an estimate from all of them."""
    estimates = yield from estimate([c.evidence for c in candidates if len(c.evidence) > 1])
    several = iter(estimates)
    return [
        next(several) if len(candidate.evidence) > 1 else candidate.evidence[0]
        for candidate in candidates
    ]
