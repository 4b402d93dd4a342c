"""The numbers of all evidence that is held, side by side: each piece knows its row."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import overload

import numpy as np
from typing_extensions import override

from onboard.kinematics.arrays import Array, StateArrays
from onboard.tracking.evidence import Evidence, Provenance, ProvenanceSpans, piece_of

OWN = b""
"""The teller of what the own camera sees."""

_LEAST_ROWS = 1024


@dataclass(frozen=True, slots=True, eq=False)
class EvidenceBatch:
    """N entries of any tellers, in the own car's frame, in the order in which they came."""

    tellers: Sequence[bytes]
    cars: Sequence[int]
    provenances: Sequence[Provenance]
    received_ms: Sequence[int]
    """UTC."""
    spans: ProvenanceSpans
    """Of the provenances."""
    firsthand: Sequence[bool]
    """Whether it is a measurement that its teller has made himself."""
    entries: StateArrays

    def __len__(self) -> int:
        return len(self.cars)

    def rows(self, rows: Sequence[int]) -> "EvidenceBatch":
        """Some of them."""
        if len(rows) == len(self):
            return self
        return EvidenceBatch(
            [self.tellers[row] for row in rows],
            [self.cars[row] for row in rows],
            [self.provenances[row] for row in rows],
            [self.received_ms[row] for row in rows],
            self.spans[list(rows)],
            [self.firsthand[row] for row in rows],
            self.entries[list(rows)],
        )


class EvidenceStore:
    """Grows at its end; what nobody holds any more is dropped by `keep` now and then."""

    def __init__(self) -> None:
        self._rows = _empty(_LEAST_ROWS)
        self._filled = 0

    def put(self, entries: StateArrays) -> int:
        """Take N entries; returns the row of the first, behind which the others follow."""
        first, self._filled = self._filled, self._filled + len(entries)
        if self._filled > len(self._rows):
            self._rows = StateArrays.together([self._rows, _empty(self._filled)])
        place = self._rows[first : self._filled]
        place.stamps_ms[:], place.has_speed[:] = entries.stamps_ms, entries.has_speed
        place.states[:], place.covariances[:] = entries.states, entries.covariances
        return first

    def at(self, rows: list[int]) -> StateArrays:
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


def _empty(rows: int) -> StateArrays:
    return StateArrays(np.zeros(rows), np.zeros((4, rows)), np.zeros((4, 4, rows)), np.zeros(rows))


@dataclass(slots=True, eq=False)
class StoredEvidence:
    """What came, and how; its numbers stand on a shelf."""

    provenance: Provenance
    stamp_ms: int
    """When the last measurement in it was made; UTC, as all times."""
    oldest_ms: int
    """And the first."""
    is_measurement: bool
    is_firsthand: bool
    """Whether its teller has measured it himself."""
    teller: bytes
    """Who sent it; `OWN` for the own measurements."""
    received_ms: int
    shelf: EvidenceStore
    row: int
    """On the shelf."""
    mask: int = 0
    """The provenance as a bit set, in its track's numbering."""

    @property
    def piece(self) -> Evidence:
        """The evidence itself."""
        return self.shelf.piece(self.provenance, self.row)


class EvidenceView(Sequence[Evidence]):
    """What is held, as evidence; made where it is asked for, since most of it is only counted."""

    def __init__(self, held: Sequence[StoredEvidence]) -> None:
        self._held = held

    @override
    def __len__(self) -> int:
        return len(self._held)

    @overload
    def __getitem__(self, at: int) -> Evidence: ...
    @overload
    def __getitem__(self, at: slice) -> Sequence[Evidence]: ...
    @override
    def __getitem__(self, at: int | slice) -> Evidence | Sequence[Evidence]:
        if isinstance(at, slice):
            return [held.piece for held in self._held[at]]
        return self._held[at].piece
