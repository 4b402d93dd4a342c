"""What came in: the entries of footers and of pictures, as arrays.

A tick brings hundreds of entries, most of which say nothing new. They are looked at together, and a
piece of evidence is made of an entry only when a car takes it.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from onboard.kinematics.local_frame import LocalFrame
from onboard.mvs.evidence import Evidence, Provenance
from onboard.mvs.evidence_store import piece_of
from onboard.mvs.kinematics import Kinematics
from onboard.mvs.provenance_spans import ProvenanceSpans

OWN = b""
"""The teller of what the own camera sees."""


@dataclass(frozen=True, slots=True, eq=False)
class SharedEntries:
    """The N entries of one footer, in the frame of its anchor; many cars may read the same."""

    anchor: LocalFrame
    cars: tuple[int, ...]
    """What the teller calls each car; its other footers call it the same."""
    provenances: tuple[Provenance, ...]
    observers: frozenset[bytes]
    """Who made the measurements in them."""
    spans: ProvenanceSpans
    """Of the provenances."""
    entries: Kinematics

    def __len__(self) -> int:
        return len(self.cars)


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
    entries: Kinematics

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


def are_firsthand(
    tellers: Sequence[bytes], provenances: Sequence[Provenance], entries: Kinematics
) -> list[bool]:
    """Of each entry whether it is a measurement that its teller has made himself."""
    return [
        not has_speed and all(by == teller for by, _ in provenance)
        for teller, provenance, has_speed in zip(
            tellers, provenances, entries.has_speed.tolist(), strict=True
        )
    ]


def placed(footers: Sequence[SharedEntries], frame: LocalFrame) -> Kinematics:
    """Bring the entries of all `footers` into `frame`, one footer after the other."""
    mappings = [frame.mapping_from(footer.anchor) for footer in footers]
    counts = [len(footer) for footer in footers]
    turns = np.repeat([turn for turn, _ in mappings], counts, axis=0)
    shifts = np.repeat([shift for _, shift in mappings], counts, axis=0)
    return Kinematics.together([footer.entries for footer in footers]).mapped(turns, shifts)


def evidence_in(footer: SharedEntries, frame: LocalFrame) -> list[Evidence]:
    """All entries of a footer as evidence in `frame`."""
    entries = placed([footer], frame)
    return [piece_of(p, entries, row) for row, p in enumerate(footer.provenances)]
