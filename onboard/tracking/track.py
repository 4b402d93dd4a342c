"""One track: the evidence of a vehicle without radio, and which of it is used together."""

import math
from collections.abc import Iterable
from heapq import nlargest

from onboard.tracking.evidence import (
    Estimate,
    Evidence,
    Measurement,
    MeasurementId,
    Provenance,
    as_estimate,
    measured_ms,
    stamp_ms_of,
)
from onboard.tracking.evidence_store import OWN, Label, StoredEvidence
from onboard.tracking.independent_set import Bits, select_independent_masks

MAX_EVIDENCE = 128
"""Pieces of evidence that a track keeps; bounds computing time."""
MAX_ESTIMATES = 48
"""Estimates among them."""
MAX_SETTLED = 256
"""Settled pieces besides, for the same reason: the oldest of more say least of the present."""

_MAX_BITS = 512
_SAME_POSITION_M = 0.1
"""One measurement from two senders differs by less than this, by rounding on the air."""


class Track:
    """Evidence and state of one vehicle without radio. All times are ms of UTC."""

    def __init__(self, number: int, first: StoredEvidence) -> None:
        self.number = number
        """The host vehicle's number for it."""
        self.first_sender = first.sender
        self.labels: dict[Label, int] = {}
        """The numbers that senders and the own sensors use for it, and when each was last used."""
        self.is_sensed = False
        """Whether an own sensor is among `labels`."""
        self.evidence: dict[Provenance, StoredEvidence] = {}
        """Evidence to choose from."""
        self.settled: list[StoredEvidence] = []
        """Evidence in use when it grew old: it stays in use, and its measurements are spent."""
        self._spent: set[MeasurementId] = set()
        self._bits = Bits()
        """One bit for each measurement of this vehicle."""
        self._has_changed = False
        """Whether evidence was added or dropped since it was last chosen."""
        self._oldest_ms = first.oldest_ms
        """Lower limit of the times of stored evidence."""
        self.chosen = [first]
        """The independent evidence in `estimate`."""
        self.first_ms = self.last_ms = first.stamp_ms
        """Times of the first and of the last evidence."""
        self.add(first)
        self.estimate = as_estimate(first.piece)
        self.common_variance_m2 = 0.0
        """Of its position on either axis, beside that in `estimate` (`common_errors.py`)."""
        self.is_confirmed = False
        """Whether there was evidence of enough different times; before, it is tentative."""
        self.is_reported = False
        """Whether it is confirmed, certain enough, and no duplicate of another reported track."""
        self.duplicates: list[Track] = []
        """Other tracks of the same vehicle; what is reported is fused from the evidence of all."""
        self.fused_with_duplicates: Estimate | None = None
        """With all variance of its position; `None` without duplicates."""
        self.remote_vehicle_id: bytes | None = None
        """Temporary ID of the vehicle with a radio that the track was matched with."""
        self.remote_vehicle_until_ms = 0

    @property
    def placed(self) -> Estimate:
        """What is reported: its estimate with all variance of the position."""
        if self.fused_with_duplicates is not None:
            return self.fused_with_duplicates
        return self.estimate.with_position_variance(self.common_variance_m2)

    @property
    def reporters(self) -> frozenset[bytes]:
        """The senders that have reported it lately."""
        return frozenset({sender for sender, _ in self.labels} - {OWN})

    @property
    def used(self) -> list[Evidence]:
        """The independent evidence in `estimate`."""
        return [stored.piece for stored in self.chosen]

    @property
    def pieces(self) -> list[Evidence]:
        """All stored evidence."""
        return [stored.piece for stored in self.stored]

    @property
    def stored(self) -> list[StoredEvidence]:
        """All stored evidence, the settled first."""
        return [*self.settled, *self.evidence.values()]

    def add_label(self, label: Label, at_ms: int) -> None:
        """Note that a sender used this number for it."""
        self.labels[label] = at_ms
        self.is_sensed = self.is_sensed or label[0] == OWN

    def remove_labels(self, labels: Iterable[Label]) -> None:
        """Forget some of its labels."""
        for label in labels:
            del self.labels[label]
        self.is_sensed = any(sender == OWN for sender, _ in self.labels)

    def accepts(self, provenance: Provenance, *, is_firsthand: bool) -> bool:
        """Whether evidence with this provenance would be new.

        An observer's own report of its measurement replaces what others have repeated of it.
        """
        if not self._spent.isdisjoint(provenance):
            return False
        known = self.evidence.get(provenance)
        return known is None or (is_firsthand and not known.is_firsthand)

    def shares_measurement(self, provenance: Provenance) -> bool:
        """Whether a measurement in `provenance` is one of this vehicle."""
        return not self._bits.keys().isdisjoint(provenance)

    def shares_measurement_with(self, other: "Track") -> bool:
        """Whether one measurement is in the evidence of both."""
        return not self._bits.keys().isdisjoint(other._bits)  # noqa: SLF001 (of the same class)

    def add(self, stored: StoredEvidence) -> None:
        """Add evidence that it accepts."""
        stored.mask = self._mask(stored.provenance)
        self.evidence[stored.provenance] = stored
        self.last_ms = max(self.last_ms, stored.stamp_ms)
        self._oldest_ms = min(self._oldest_ms, stored.oldest_ms)
        self._has_changed = True

    def drop_old(self, before_ms: int) -> None:
        """Drop evidence with a measurement of `before_ms` or earlier, and the oldest in excess."""
        if self._oldest_ms <= before_ms:
            self.settled = [stored for stored in self.settled if stored.oldest_ms > before_ms]
            self._drop([p for p, stored in self.evidence.items() if stored.oldest_ms <= before_ms])
            self._oldest_ms = min([stored.oldest_ms for stored in self.stored], default=before_ms)
            self._has_changed = True
        if old := [label for label, at_ms in self.labels.items() if at_ms <= before_ms]:
            self.remove_labels(old)
        if len(self.settled) > MAX_SETTLED:
            self.settled = nlargest(MAX_SETTLED, self.settled, key=stamp_ms_of)
            self._has_changed = True
        if len(self.evidence) > min(MAX_ESTIMATES, MAX_EVIDENCE):
            estimates = [p for p, stored in self.evidence.items() if not stored.is_measurement]
            self._drop(estimates[: max(0, len(estimates) - MAX_ESTIMATES)])
            self._drop(list(self.evidence)[:-MAX_EVIDENCE])
        if len(self._bits) > _MAX_BITS:
            self._renumber_bits(before_ms)

    def choose_evidence(self) -> bool:
        """Choose the independent evidence anew if any has changed; whether the choice differs."""
        if not self._has_changed:
            return False
        before, self.chosen = self.chosen, self._choice(self.evidence.values())
        self._has_changed = False
        return self.chosen != before

    def choice_without_repeats(self) -> list[StoredEvidence]:
        """Return the choice among evidence of others that has no measurement of own sensors.

        Empty, if nothing that is chosen repeats one.
        """
        own = 0
        for stored in self.evidence.values() if self.is_sensed else ():
            if stored.sender == OWN:
                own |= stored.mask
        if not any(stored.mask & own and stored.sender != OWN for stored in self.chosen):
            return []
        return self._choice(
            stored
            for stored in self.evidence.values()
            if stored.sender == OWN or not stored.mask & own
        )

    def settle(self, before_ms: int) -> None:
        """Settle the evidence of `before_ms` or earlier: used until dropped, or never."""
        young = self.chosen[len(self.settled) :]
        if old := [stored for stored in young if stored.stamp_ms <= before_ms]:
            self._settle(old)
            self.chosen = self.settled + [stored for stored in young if stored.stamp_ms > before_ms]
            # What is left of the best choice is the best choice of what is left.
            self._has_changed = False

    def merge(self, other: "Track") -> None:
        """Take over all evidence of a track of the same vehicle."""
        settled = [stored for stored in other.settled if self._spent.isdisjoint(stored.provenance)]
        for stored in settled:
            stored.mask = self._mask(stored.provenance)
        self._settle(settled)
        for provenance, stored in other.evidence.items():
            if self.accepts(provenance, is_firsthand=stored.is_firsthand):
                self.add(stored)
        self.first_ms = min(self.first_ms, other.first_ms)
        self.last_ms = max(self.last_ms, other.last_ms)
        self.is_confirmed |= other.is_confirmed
        self.labels |= other.labels
        self.is_sensed |= other.is_sensed
        self._oldest_ms = min(self._oldest_ms, other._oldest_ms)  # noqa: SLF001 (of the same class)
        self._has_changed = True

    def count_times(self) -> int:
        """Return the number of different times at which it was measured."""
        return len({measured_ms(identity) for each in self.stored for identity in each.provenance})

    def was_measured_beside(self, other: "Track") -> bool:
        """Whether one observer measured both at one time: then they are two vehicles."""
        if self.evidence.keys().isdisjoint(other.evidence):
            return False
        for both in self.evidence.keys() & other.evidence.keys():
            mine, others = self.evidence[both].piece, other.evidence[both].piece
            if (
                isinstance(mine, Measurement)
                and isinstance(others, Measurement)
                and math.dist(mine.position_m, others.position_m) > _SAME_POSITION_M
            ):
                return True
        return False

    def _choice(self, evidence: Iterable[StoredEvidence]) -> list[StoredEvidence]:
        latest_first = sorted(evidence, key=stamp_ms_of, reverse=True)
        indices = select_independent_masks([stored.mask for stored in latest_first])
        return self.settled + [latest_first[index] for index in indices]

    def _settle(self, some: Iterable[StoredEvidence]) -> None:
        spent = 0
        for stored in some:
            self.settled.append(stored)
            self._spent |= stored.provenance
            spent |= stored.mask
        if spent:
            self._drop([p for p, stored in self.evidence.items() if stored.mask & spent])

    def _drop(self, provenances: Iterable[Provenance]) -> None:
        for provenance in provenances:
            del self.evidence[provenance]
            self._has_changed = True

    def _renumber_bits(self, after_ms: int) -> None:
        """Forget the measurements of `after_ms` or earlier, and number the others anew."""
        self._spent = {each for each in self._spent if measured_ms(each) > after_ms}
        self._bits.clear()
        for stored in self.stored:
            stored.mask = self._mask(stored.provenance)

    def _mask(self, provenance: Provenance) -> int:
        return self._bits.mask(provenance)
