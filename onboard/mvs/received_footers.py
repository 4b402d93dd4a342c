"""Footers that have come in: their entries side by side, and why some of them are not used."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from onboard.kinematics.local_frame import LocalFrame
from onboard.mvs.footer_validation import violations
from onboard.mvs.kalman import Array
from onboard.mvs.provenance_spans import ProvenanceSpans
from onboard.mvs.settings import MvsSettings
from onboard.mvs.shared_entries import EvidenceBatch, SharedEntries, are_firsthand, placed


@dataclass(slots=True, eq=False)
class ReceivedFooter:
    """A footer not yet taken up."""

    told: SharedEntries
    sender_id: bytes
    sender_m: Array
    """Where the sender said it was (2), in the own car's frame."""
    at: float


@dataclass(frozen=True, slots=True)
class OwnMeasurements:
    """What the own car knows of its own measurements."""

    own_ids: frozenset[bytes]
    stamps_ms: frozenset[int]
    """When it made some, UTC."""


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


def violations_of_received(
    batch: EvidenceBatch,
    heard: Sequence[ReceivedFooter],
    own: OwnMeasurements,
    settings: MvsSettings,
) -> tuple[dict[int, str], Array]:
    """Hold entries against what is possible (`belief.py`), recent, and known of the own car.

    Returns:
        a reason not to use it for each row of `batch` that has one: those of `belief.doubts`,
        `stale`, `not_my_measurement`; and for each row by what to weight it down.
    """
    belief = settings.footer_validation
    received_ms = np.array(batch.received_ms, dtype=np.float64)
    doubted = dict.fromkeys(_with_what_is_not_mine(heard, own), "not_my_measurement")
    stale = batch.spans.oldest_ms <= received_ms - round(settings.memory_s * 1000)
    doubted |= dict.fromkeys(np.flatnonzero(stale).tolist(), "stale")
    reaches_m = np.where(
        batch.firsthand, belief.sensing_range_m, belief.sensing_range_m + belief.radio_range_m
    )
    impossible, excess = violations(
        batch.entries,
        batch.spans,
        belief,
        reaches_m=reaches_m,
        tellers_m=np.array([each.sender_m for each in heard for _ in range(len(each.told))]).T,
        now_ms=received_ms,
    )
    return impossible | dict(sorted(doubted.items())), excess


def _with_what_is_not_mine(heard: Sequence[ReceivedFooter], own: OwnMeasurements) -> list[int]:
    """The rows that name a measurement of the own car's which it has not made."""
    rows, first = [], 0
    for told in (each.told for each in heard):
        if not own.own_ids.isdisjoint(told.observers):
            not_mine = {
                identity
                for identity in frozenset().union(*told.provenances)
                if identity.observer in own.own_ids and identity.stamp_ms not in own.stamps_ms
            }
            rows += [
                first + at
                for at, provenance in enumerate(told.provenances)
                if not not_mine.isdisjoint(provenance)
            ]
        first += len(told)
    return rows
