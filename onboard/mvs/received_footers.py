"""Entries of received footers: of one footer in its sender's frame, of many in the host's."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from onboard.kinematics.arrays import Array, StateArrays
from onboard.kinematics.local_frame import LocalFrame
from onboard.tracking.evidence import Evidence, Provenance, ProvenanceSpans, piece_of
from onboard.tracking.evidence_store import EvidenceBatch


@dataclass(frozen=True, slots=True, eq=False)
class SharedEntries:
    """The N entries of one footer, in the frame of its anchor; receivers may share the object."""

    anchor: LocalFrame
    numbers: tuple[int, ...]
    """The sender's number for each vehicle; equal in its other footers."""
    provenances: tuple[Provenance, ...]
    observers: frozenset[bytes]
    """Observers of the measurements in them."""
    spans: ProvenanceSpans
    """Of `provenances`."""
    entries: StateArrays

    def __len__(self) -> int:
        return len(self.numbers)

    @classmethod
    def of(
        cls,
        anchor: LocalFrame,
        numbers: Sequence[int],
        provenances: Sequence[Provenance],
        observers: Iterable[bytes],
        entries: tuple[Array, Array, Array],
    ) -> Self:
        """Return N entries.

        Args:
            anchor: their frame.
            numbers: (N) the sender's.
            provenances: (N).
            observers: of the measurements in them.
            entries: states (N, 4), covariances (N, 4, 4), and 1 for each that has a speed (N).
        """
        states, covariances, has_speed = entries
        spans = ProvenanceSpans.of(provenances)
        return cls(
            anchor,
            tuple(numbers),
            tuple(provenances),
            frozenset(observers),
            spans,
            StateArrays(spans.newest_ms, states.T, covariances.transpose(1, 2, 0), has_speed),
        )


@dataclass(frozen=True, slots=True, eq=False)
class ReceivedFooter:
    """A received footer that is not yet processed."""

    footer: SharedEntries
    sender_id: bytes
    sender_m: Array
    """Position of the sender by its BSM (2), in the host vehicle's frame."""
    received_s: float

    def mapped(self, turn: Array, shift: Array) -> "ReceivedFooter":
        """Return it with the sender in another frame (`LocalFrame.mapping_from`)."""
        sender_m = turn @ self.sender_m + shift
        return ReceivedFooter(self.footer, self.sender_id, sender_m, self.received_s)


def concatenate(
    received: Sequence[ReceivedFooter], frame: LocalFrame, utc_ms: Callable[[float], int]
) -> EvidenceBatch:
    """Return the entries of all footers, one footer after the other, in `frame`.

    Args:
        received: at least one footer.
        frame: the host vehicle's.
        utc_ms: converts a time of receipt to UTC.
    """
    senders = [each.sender_id for each in received for _ in range(len(each.footer))]
    provenances = [provenance for each in received for provenance in each.footer.provenances]
    entries = in_frame([each.footer for each in received], frame)
    return EvidenceBatch(
        senders,
        [number for each in received for number in each.footer.numbers],
        provenances,
        [ms for each in received for ms in [utc_ms(each.received_s)] * len(each.footer)],
        ProvenanceSpans.concatenate([each.footer.spans for each in received]),
        _are_firsthand(senders, provenances, entries),
        entries,
    )


def in_frame(footers: Sequence[SharedEntries], frame: LocalFrame) -> StateArrays:
    """Return the entries of all footers, one footer after the other, in `frame`."""
    mappings = [frame.mapping_from(footer.anchor) for footer in footers]
    counts = [len(footer) for footer in footers]
    turns = np.repeat([turn for turn, _ in mappings], counts, axis=0)
    shifts = np.repeat([shift for _, shift in mappings], counts, axis=0)
    return StateArrays.concatenate([footer.entries for footer in footers]).mapped(turns, shifts)


def evidence_in(footer: SharedEntries, frame: LocalFrame) -> list[Evidence]:
    """Return all entries of a footer as evidence in `frame`."""
    entries = in_frame([footer], frame)
    return [
        piece_of(p, entries, row, is_measurement=not entries.has_speed[row])
        for row, p in enumerate(footer.provenances)
    ]


def _are_firsthand(
    senders: Sequence[bytes], provenances: Sequence[Provenance], entries: StateArrays
) -> list[bool]:
    """Whether each entry is a measurement that its sender made itself."""
    return [
        not has_speed and all(observer == sender for observer, _ in provenance)
        for sender, provenance, has_speed in zip(
            senders, provenances, entries.has_speed.tolist(), strict=True
        )
    ]
