"""How much there is in a provenance, and over what time: what is asked of every entry of a tick."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from onboard.mvs.evidence import Provenance
from onboard.mvs.kalman import Array


@dataclass(frozen=True, slots=True, eq=False)
class ProvenanceSpans:
    """Of N provenances."""

    counts: Array
    """(N) measurements in each."""
    oldest_ms: Array
    """(N) when the first of them was made."""
    newest_ms: Array
    """(N) and the last."""
    spreads_s2: Array
    """(N) sums of the squares of the distances of their times from the mean of these."""

    def __getitem__(self, rows: Any) -> Self:
        """Some of them."""
        return type(self)(
            self.counts[rows], self.oldest_ms[rows], self.newest_ms[rows], self.spreads_s2[rows]
        )

    @classmethod
    def together(cls, some: Sequence[Self]) -> Self:
        """All of `some`, one after the other."""
        return cls(
            np.concatenate([each.counts for each in some]),
            np.concatenate([each.oldest_ms for each in some]),
            np.concatenate([each.newest_ms for each in some]),
            np.concatenate([each.spreads_s2 for each in some]),
        )

    @classmethod
    def of(cls, provenances: Sequence[Provenance]) -> Self:
        """Look them up; no provenance is empty."""
        counts = np.array([len(provenance) for provenance in provenances], dtype=np.intp)
        stamps_ms = np.array(
            [stamp_ms for provenance in provenances for _, stamp_ms in provenance], np.float64
        )
        if not len(counts):
            return cls(stamps_ms, stamps_ms, stamps_ms, stamps_ms)
        starts = np.cumsum(counts) - counts
        oldest_ms = np.minimum.reduceat(stamps_ms, starts)
        newest_ms = np.maximum.reduceat(stamps_ms, starts)
        ages_ms = np.repeat(newest_ms, counts) - stamps_ms
        squares = np.add.reduceat(ages_ms * ages_ms, starts)
        spreads_s2 = (squares - np.add.reduceat(ages_ms, starts) ** 2 / counts) / 1e6
        return cls(counts.astype(np.float64), oldest_ms, newest_ms, spreads_s2)
