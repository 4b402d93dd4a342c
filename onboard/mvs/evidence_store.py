"""The numbers of all evidence that is held, side by side: each piece knows its row."""

import numpy as np

from onboard.mvs.evidence import Estimate, Evidence, Measurement, Provenance
from onboard.mvs.kalman import Array
from onboard.mvs.kinematics import Kinematics

_LEAST_ROWS = 1024


class EvidenceStore:
    """Grows at its end; what nobody holds any more is dropped by `keep` now and then."""

    def __init__(self) -> None:
        self._rows = _empty(_LEAST_ROWS)
        self._filled = 0

    def put(self, entries: Kinematics) -> int:
        """Take N entries; returns the row of the first, behind which the others follow."""
        first, self._filled = self._filled, self._filled + len(entries)
        if self._filled > len(self._rows):
            self._rows = Kinematics.together([self._rows, _empty(self._filled)])
        place = self._rows[first : self._filled]
        place.stamps_ms[:], place.has_speed[:] = entries.stamps_ms, entries.has_speed
        place.states[:], place.covariances[:] = entries.states, entries.covariances
        return first

    def at(self, rows: list[int]) -> Kinematics:
        """The numbers in `rows`."""
        return self._rows[rows]

    def piece(self, provenance: Provenance, row: int) -> Evidence:
        """The piece of evidence with this provenance whose numbers are in `row`."""
        return piece_of(provenance, self._rows, row)

    def is_due(self, held: int) -> bool:
        """Whether it is worth dropping what is not among the `held` pieces."""
        return self._filled > max(2 * held, _LEAST_ROWS)

    def keep(self, rows: list[int]) -> None:
        """Drop all but `rows`, which are 0, 1, 2, ... from now on."""
        self._rows, self._filled = self._rows[rows], len(rows)

    def map_to(self, turn: Array, shift: Array) -> None:
        """Bring everything into another frame (`LocalFrame.mapping_from`)."""
        self._rows = self._rows.mapped(turn, shift[None])


def piece_of(provenance: Provenance, entries: Kinematics, row: int) -> Evidence:
    """Make evidence of an entry with this provenance."""
    state, covariance = entries.states[:, row].copy(), entries.covariances[:, :, row].copy()
    if entries.has_speed[row]:
        return Estimate(provenance, state, covariance)
    (identity,) = provenance
    return Measurement(identity, state[:2], covariance[:2, :2])


def _empty(rows: int) -> Kinematics:
    return Kinematics(np.zeros(rows), np.zeros((4, rows)), np.zeros((4, 4, rows)), np.zeros(rows))
