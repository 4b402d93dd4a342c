"""Evidence as arrays: a batch as it arrives, and the store of all that tracks keep.

A tick brings hundreds of entries, most of which repeat what is known. They are compared as arrays;
an object is made of an entry only when a track keeps it.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import overload

import numpy as np
from typing_extensions import override

from onboard.kinematics.arrays import Array, StateArrays
from onboard.tracking.evidence import Evidence, Provenance, ProvenanceSpans, piece_of

OWN = b""
"""Sender of the host vehicle's own measurements."""

Label = tuple[bytes, int]
"""A sender, and its number for a vehicle, which it keeps as long as it tracks the vehicle."""

_MIN_ROWS = 1024


@dataclass(frozen=True, slots=True, eq=False)
class EvidenceBatch:
    """N entries of any senders, in the host vehicle's frame, in the order of their arrival."""

    senders: Sequence[bytes]
    numbers: Sequence[int]
    """Each sender's number for the vehicle."""
    provenances: Sequence[Provenance]
    received_ms: Sequence[int]
    """UTC."""
    spans: ProvenanceSpans
    """Spans of `provenances`."""
    firsthand: Sequence[bool]
    """Whether the entry is a measurement that its sender made itself."""
    entries: StateArrays

    def __len__(self) -> int:
        return len(self.numbers)

    def subset(self, rows: Sequence[int]) -> "EvidenceBatch":
        """Return the entries `rows`."""
        if len(rows) == len(self):
            return self
        return EvidenceBatch(
            [self.senders[row] for row in rows],
            [self.numbers[row] for row in rows],
            [self.provenances[row] for row in rows],
            [self.received_ms[row] for row in rows],
            self.spans[list(rows)],
            [self.firsthand[row] for row in rows],
            self.entries[list(rows)],
        )

    @classmethod
    def concatenate(cls, parts: Sequence["EvidenceBatch"]) -> "EvidenceBatch":
        """Return the entries of all of `parts`, one after the other."""
        if len(parts) == 1:
            return parts[0]
        return cls(
            [sender for part in parts for sender in part.senders],
            [number for part in parts for number in part.numbers],
            [provenance for part in parts for provenance in part.provenances],
            [received_ms for part in parts for received_ms in part.received_ms],
            ProvenanceSpans.concatenate([part.spans for part in parts]),
            [is_firsthand for part in parts for is_firsthand in part.firsthand],
            StateArrays.concatenate([part.entries for part in parts]),
        )

    def with_covariances_scaled(self, factors: Array) -> "EvidenceBatch":
        """Return the entries with each covariance multiplied by its factor (N)."""
        return replace(self, entries=self.entries.with_covariances_scaled(factors))


class EvidenceStore:
    """The numbers of all stored evidence in common arrays; each piece holds its row.

    The arrays are its own and grow at the end; what it returns are copies.
    """

    def __init__(self) -> None:
        self._filled = 0
        self._set(_empty(_MIN_ROWS))

    def append(self, entries: StateArrays) -> int:
        """Add N entries; returns the row of the first, the others follow it."""
        first, self._filled = self._filled, self._filled + len(entries)
        if self._filled > len(self._stamps_ms):
            self._set(StateArrays.concatenate([self._all, _empty(self._filled)]))
        rows = slice(first, self._filled)
        self._stamps_ms[rows], self._has_speed[rows] = entries.stamps_ms, entries.has_speed
        self._states[:, rows], self._covariances[:, :, rows] = entries.states, entries.covariances
        return first

    def at(self, rows: list[int]) -> StateArrays:
        """Return the states in `rows`."""
        return self._all[rows]

    def piece(self, provenance: Provenance, row: int, *, is_measurement: bool) -> Evidence:
        """Return the evidence with this provenance whose numbers are in `row`."""
        return piece_of(provenance, self._all, row, is_measurement=is_measurement)

    def is_sparse(self, kept: int) -> bool:
        """Whether `kept` pieces are so few of all rows that compacting pays."""
        return self._filled > max(2 * kept, _MIN_ROWS)

    def compact(self, rows: list[int]) -> None:
        """Drop all but `rows`, which become rows 0, 1, 2, ..."""
        self._set(self._all[rows])
        self._filled = len(rows)

    def change_frame(self, turn: Array, shift: Array) -> None:
        """Map everything into another frame (`LocalFrame.mapping_from`)."""
        self._set(self._all.mapped(turn, shift[None]))

    @property
    def _all(self) -> StateArrays:
        return StateArrays(self._stamps_ms, self._states, self._covariances, self._has_speed)

    def _set(self, rows: StateArrays) -> None:
        self._stamps_ms, self._has_speed = rows.stamps_ms, rows.has_speed
        self._states, self._covariances = rows.states, rows.covariances


@dataclass(slots=True, eq=False)
class StoredEvidence:
    """A piece of evidence that a track keeps; its numbers are in the store."""

    provenance: Provenance
    stamp_ms: int
    """Time of its last measurement; UTC, as all times."""
    oldest_ms: int
    """Time of its first measurement."""
    is_measurement: bool
    is_firsthand: bool
    """Whether it is a measurement that its sender made itself."""
    sender: bytes
    """`OWN` for the host vehicle's measurements."""
    received_ms: int
    store: EvidenceStore
    row: int
    """Row in the store."""
    mask: int = 0
    """The provenance as a bit set, with one bit for each measurement of its track."""

    @property
    def piece(self) -> Evidence:
        """The evidence itself."""
        return self.store.piece(self.provenance, self.row, is_measurement=self.is_measurement)


class EvidenceView(Sequence[Evidence]):
    """Stored evidence as a sequence; objects are made on access, since most is only counted."""

    def __init__(self, stored: Sequence[StoredEvidence]) -> None:
        self.stored = stored

    @override
    def __len__(self) -> int:
        return len(self.stored)

    @overload
    def __getitem__(self, at: int) -> Evidence: ...
    @overload
    def __getitem__(self, at: slice) -> Sequence[Evidence]: ...
    @override
    def __getitem__(self, at: int | slice) -> Evidence | Sequence[Evidence]:
        if isinstance(at, slice):
            return [stored.piece for stored in self.stored[at]]
        return self.stored[at].piece


def _empty(rows: int) -> StateArrays:
    return StateArrays(np.zeros(rows), np.zeros((4, rows)), np.zeros((4, 4, rows)), np.zeros(rows))
