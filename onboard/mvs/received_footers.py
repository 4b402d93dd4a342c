"""Footers that have come in: their entries side by side, and why some of them are not used."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from onboard.kinematics.arrays import Array, StateArrays
from onboard.kinematics.local_frame import LocalFrame
from onboard.tracking.evidence import Evidence, Provenance, ProvenanceSpans, piece_of
from onboard.tracking.evidence_store import EvidenceBatch


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
    entries: StateArrays

    def __len__(self) -> int:
        return len(self.cars)


@dataclass(slots=True, eq=False)
class ReceivedFooter:
    """A footer not yet taken up."""

    told: SharedEntries
    sender_id: bytes
    sender_m: Array
    """Where the sender said it was (2), in the own car's frame."""
    at: float


def concatenate(
    heard: Sequence[ReceivedFooter], frame: LocalFrame, utc_ms: Callable[[float], int]
) -> EvidenceBatch:
    """Put the entries of all footers side by side, placed in `frame`."""
    tellers = [each.sender_id for each in heard for _ in range(len(each.told))]
    provenances = [provenance for each in heard for provenance in each.told.provenances]
    entries = placed([each.told for each in heard], frame)
    return EvidenceBatch(
        tellers,
        [car for each in heard for car in each.told.cars],
        provenances,
        [at_ms for each in heard for at_ms in [utc_ms(each.at)] * len(each.told)],
        ProvenanceSpans.together([each.told.spans for each in heard]),
        are_firsthand(tellers, provenances, entries),
        entries,
    )


def are_firsthand(
    tellers: Sequence[bytes], provenances: Sequence[Provenance], entries: StateArrays
) -> list[bool]:
    """Of each entry whether it is a measurement that its teller has made himself."""
    return [
        not has_speed and all(by == teller for by, _ in provenance)
        for teller, provenance, has_speed in zip(
            tellers, provenances, entries.has_speed.tolist(), strict=True
        )
    ]


def placed(footers: Sequence[SharedEntries], frame: LocalFrame) -> StateArrays:
    """Bring the entries of all `footers` into `frame`, one footer after the other."""
    mappings = [frame.mapping_from(footer.anchor) for footer in footers]
    counts = [len(footer) for footer in footers]
    turns = np.repeat([turn for turn, _ in mappings], counts, axis=0)
    shifts = np.repeat([shift for _, shift in mappings], counts, axis=0)
    return StateArrays.together([footer.entries for footer in footers]).mapped(turns, shifts)


def evidence_in(footer: SharedEntries, frame: LocalFrame) -> list[Evidence]:
    """All entries of a footer as evidence in `frame`."""
    entries = placed([footer], frame)
    return [piece_of(p, entries, row) for row, p in enumerate(footer.provenances)]
