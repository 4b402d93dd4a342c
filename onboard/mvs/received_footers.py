"""Entries of received footers: of one footer in its sender's frame, of many in the host's."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from onboard.errors import DecodeError
from onboard.kinematics.arrays import Array, StateArrays
from onboard.kinematics.local_frame import LocalFrame
from onboard.tracking.evidence import (
    Evidence,
    Provenance,
    ProvenanceSpans,
    measurement_id,
    observer_of,
    piece_of,
)
from onboard.tracking.evidence_store import EvidenceBatch


@dataclass(frozen=True, slots=True, eq=False)
class SharedEntries:
    """The N entries of one footer, in the frame of its anchor; receivers may share the object."""

    anchor: LocalFrame
    numbers: Sequence[int]
    """The sender's number for each vehicle; equal in its other footers."""
    provenances: Sequence[Provenance]
    observers: frozenset[bytes]
    """Observers of the measurements in them."""
    spans: ProvenanceSpans
    """Spans of `provenances`."""
    states: Array
    """(N, 4) at the time of the last measurement; the speed of a mere position is 0."""
    covariances: Array
    """(N, 4, 4)"""
    has_speed: Array
    """(N), 1.0 for a whole state, 0.0 for a mere position."""

    def __len__(self) -> int:
        return len(self.numbers)


@dataclass(frozen=True, slots=True)
class MeasuredPlace:
    """A position that the sender of a message states without provenance, as its measurement."""

    number: int
    """The sender's number for the vehicle."""
    stamp_ms: int
    """UTC."""
    east_m: float
    """From the anchor, as `north_m`."""
    north_m: float
    sigma_m: float
    """Of either axis."""


def of_measurements(
    sender_id: bytes, anchor: LocalFrame, places: Sequence[MeasuredPlace]
) -> SharedEntries:
    """Return the entries of a message without provenance: each is known by sender and time.

    Raises:
        DecodeError: `out_of_range` for a time before 1970, which names no measurement.
    """
    if any(each.stamp_ms < 0 for each in places):
        raise DecodeError("out_of_range", "measured before 1970")
    states = [(each.east_m, each.north_m, 0.0, 0.0) for each in places]
    covariances = np.zeros((len(places), 4, 4))
    for row, each in enumerate(places):
        covariances[row, :2, :2] = each.sigma_m**2 * np.eye(2)
    provenances = [frozenset((measurement_id(sender_id, each.stamp_ms),)) for each in places]
    return SharedEntries(
        anchor,
        [each.number for each in places],
        provenances,
        frozenset((sender_id,)),
        ProvenanceSpans.of(provenances),
        states=np.array(states, np.float64).reshape(-1, 4),
        covariances=covariances,
        has_speed=np.zeros(len(places)),
    )


@dataclass(frozen=True, slots=True, eq=False)
class ReceivedFooter:
    """A received footer."""

    footer: SharedEntries
    sender_id: bytes
    sender_m: Array
    """Position of the sender by its BSM (2), in the host vehicle's frame."""
    received_s: float


def concatenate(
    received: Sequence[ReceivedFooter], frame: LocalFrame, utc_ms: Callable[[float], int]
) -> EvidenceBatch:
    """Return the entries of all footers, one footer after the other, in `frame`.

    Args:
        received: at least one footer.
        frame: the host vehicle's.
        utc_ms: converts a time of receipt to UTC.
    """
    footers = [each.footer for each in received]
    senders = [each.sender_id for each in received for _ in range(len(each.footer))]
    provenances, spans, entries = _in_frame(footers, frame)
    return EvidenceBatch(
        senders,
        [number for footer in footers for number in footer.numbers],
        provenances,
        [ms for each in received for ms in [utc_ms(each.received_s)] * len(each.footer)],
        spans,
        _are_firsthand(senders, provenances, entries),
        entries,
    )


def evidence_in(footer: SharedEntries, frame: LocalFrame) -> list[Evidence]:
    """Return all entries of a footer as evidence in `frame`."""
    provenances, _, entries = _in_frame([footer], frame)
    return [
        piece_of(provenance, entries, row, is_measurement=not entries.has_speed[row])
        for row, provenance in enumerate(provenances)
    ]


def _in_frame(
    footers: Sequence[SharedEntries], frame: LocalFrame
) -> tuple[list[Provenance], ProvenanceSpans, StateArrays]:
    """Return the entries of all footers, one footer after the other, in `frame`."""
    provenances = [provenance for footer in footers for provenance in footer.provenances]
    spans = ProvenanceSpans.concatenate([footer.spans for footer in footers])
    entries = StateArrays(
        spans.newest_ms,
        np.concatenate([footer.states for footer in footers]).T,
        np.concatenate([footer.covariances for footer in footers]).transpose(1, 2, 0),
        np.concatenate([footer.has_speed for footer in footers]),
    )
    mappings = [frame.mapping_from(footer.anchor) for footer in footers]
    counts = [len(footer) for footer in footers]
    turns = np.repeat([turn for turn, _ in mappings], counts, axis=0)
    shifts = np.repeat([shift for _, shift in mappings], counts, axis=0)
    return provenances, spans, entries.mapped(turns, shifts)


def _are_firsthand(
    senders: Sequence[bytes], provenances: Sequence[Provenance], entries: StateArrays
) -> list[bool]:
    """Whether each entry is a measurement that its sender made itself."""
    return [
        not has_speed and all(observer_of(each) == sender for each in provenance)
        for sender, provenance, has_speed in zip(
            senders, provenances, entries.has_speed.tolist(), strict=True
        )
    ]
