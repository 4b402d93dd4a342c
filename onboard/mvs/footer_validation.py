"""Footer validation: limits that received footers must keep before their entries are used.

Each entry is also checked against what is physically possible (`misbehaviour/evidence_check.py`).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from onboard.kinematics.arrays import Array
from onboard.misbehaviour.evidence_check import RADIO_RANGE_M, SENSING_RANGE_M, violations
from onboard.mvs.received_footers import ReceivedFooter
from onboard.tracking.evidence import measured_ms, observer_of
from onboard.tracking.evidence_store import EvidenceBatch

FOOTERS_PER_S = 20.0
"""Of one sender in the long run: twice the rate of BSMs; more are dropped."""
FOOTERS_AT_ONCE = 8
"""Of one sender: a CPM has up to 8 segments, and footers that were delayed arrive together with the
next ones."""
MAX_SENDERS = 512
"""Remote vehicles at once; bounds computing time."""
MAX_ENTRIES = 64
"""Entries in one footer; bounds computing time."""


@dataclass(frozen=True, slots=True)
class OwnMeasurements:
    """The host vehicle's own measurements of the last seconds."""

    own_ids: frozenset[bytes]
    """Temporary IDs under which it made them."""
    stamps_ms: frozenset[int]
    """When it made some, UTC."""


def violations_of_received(
    batch: EvidenceBatch,
    received: Sequence[ReceivedFooter],
    own: OwnMeasurements,
    *,
    memory_ms: int,
    max_measurements: int,
) -> tuple[dict[int, str], Array]:
    """Check the entries of received footers.

    Args:
        batch: the N entries of the footers.
        received: the footers.
        own: the host vehicle's own measurements.
        memory_ms: older measurements are `stale`.
        max_measurements: in one estimate.

    Returns:
        a reason not to use it for each row of `batch` that has one: those of `violations`, `stale`,
        `not_my_measurement`; and for each row the factor of `covariance_inflation`.
    """
    received_ms = np.array(batch.received_ms, dtype=np.float64)
    refused = dict.fromkeys(_naming_false_own_measurements(received, own), "not_my_measurement")
    stale = batch.spans.oldest_ms <= received_ms - memory_ms
    refused |= dict.fromkeys(np.flatnonzero(stale).tolist(), "stale")
    senders_m = [each.sender_m for each in received for _ in range(len(each.footer))]
    impossible, inflation = violations(
        batch.entries,
        batch.spans,
        ranges_m=np.where(batch.firsthand, SENSING_RANGE_M, SENSING_RANGE_M + RADIO_RANGE_M),
        senders_m=np.array(senders_m).T,
        received_ms=received_ms,
        max_measurements=max_measurements,
    )
    return impossible | dict(sorted(refused.items())), inflation


def _naming_false_own_measurements(
    received: Sequence[ReceivedFooter], own: OwnMeasurements
) -> list[int]:
    """Rows that name a measurement of the host vehicle that it has not made."""
    rows, first = [], 0
    for footer in (each.footer for each in received):
        if not own.own_ids.isdisjoint(footer.observers):
            not_mine = {
                identity
                for identity in frozenset().union(*footer.provenances)
                if observer_of(identity) in own.own_ids
                and measured_ms(identity) not in own.stamps_ms
            }
            rows += [
                first + at
                for at, provenance in enumerate(footer.provenances)
                if not not_mine.isdisjoint(provenance)
            ]
        first += len(footer)
    return rows
