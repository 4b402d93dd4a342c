"""A piece of evidence that is held of a car."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import overload

from typing_extensions import override

from onboard.mvs.evidence import Evidence, Provenance
from onboard.mvs.evidence_store import EvidenceStore


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
