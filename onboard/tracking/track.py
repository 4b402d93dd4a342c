"""One car without a radio: the evidence of it, and which of that may be used together."""

import math
from collections.abc import Iterable

from onboard.tracking.evidence import (
    Evidence,
    Measurement,
    MeasurementId,
    Provenance,
    as_estimate,
    stamp_ms_of,
)
from onboard.tracking.evidence_store import OWN, StoredEvidence
from onboard.tracking.independent_set import select_independent_masks

_MOST_BITS = 512
_SAME_PLACE_M = 0.1
"""One measurement told by two is the same place, but for the rounding on its ways."""

Name = tuple[bytes, int]
"""Who tells of a car, and what he calls it."""


class Track:
    """What the own car holds of one car without a radio."""

    def __init__(self, number: int, first: StoredEvidence) -> None:
        self.number = number
        """The own car's name for it."""
        self.first_teller = first.teller
        self.names: dict[Name, int] = {}
        """What others, and the own camera, call it, and when they last did; UTC, as all times."""
        self.is_seen = False
        """Whether the own camera has seen it, as long as that is remembered."""
        self.evidence: dict[Provenance, StoredEvidence] = {}
        self.settled: list[StoredEvidence] = []
        """What was used when it grew old: it stays in use, and its measurements are spent."""
        self._spent: set[MeasurementId] = set()
        self._bits: dict[MeasurementId, int] = {}
        """What has been told of this car, one bit for each measurement."""
        self._has_changed = False
        """Whether evidence has come or gone since it was last chosen."""
        self._oldest_ms = first.oldest_ms
        """Nothing that is held of it is older than this."""
        self.chosen = [first]
        """The independent evidence in `estimate`."""
        self.first_ms = self.last_ms = first.stamp_ms
        """Of the first evidence of it and of the last."""
        self.add(first)
        self.estimate = as_estimate(first.piece)
        self.is_confirmed = False
        self.is_known = False
        """Whether it is confirmed, well placed, and no other car seen twice."""
        self.radio_id: bytes | None = None
        """The car with a radio that it has turned out to be."""
        self.radio_until_ms = 0
        self.wire_number: int | None = None
        """The own car's name for it in footers, once it has told of it."""
        self.told: set[MeasurementId] = set()
        """The measurements in what the own car has told others of it."""
        self.told_ms = 0
        """When the own car last told others of it."""

    @property
    def used(self) -> list[Evidence]:
        """The independent evidence in `estimate`."""
        return [held.piece for held in self.chosen]

    @property
    def pieces(self) -> list[Evidence]:
        """All evidence of it, as it came."""
        return [held.piece for held in self.held]

    @property
    def held(self) -> list[StoredEvidence]:
        """All evidence of it, as it came."""
        return [*self.settled, *self.evidence.values()]

    def call(self, name: Name, at_ms: int) -> None:
        """Note what somebody has called it just now."""
        self.names[name] = at_ms
        self.is_seen = self.is_seen or name[0] == OWN

    def uncall(self, names: Iterable[Name]) -> None:
        """Let it go by some of its names no longer."""
        for name in names:
            del self.names[name]
        self.is_seen = any(teller == OWN for teller, _ in self.names)

    def wants(self, provenance: Provenance, *, is_firsthand: bool) -> bool:
        """Whether a piece would say something new.

        What an observer says of its own measurement replaces what others have repeated of it.
        """
        if not self._spent.isdisjoint(provenance):
            return False
        known = self.evidence.get(provenance)
        return known is None or (is_firsthand and not known.is_firsthand)

    def shares(self, provenance: Provenance) -> bool:
        """Whether a measurement in `provenance` has been told of this car."""
        return not self._bits.keys().isdisjoint(provenance)

    def shares_with(self, other: "Track") -> bool:
        """Whether one measurement has been told of both."""
        return not self._bits.keys().isdisjoint(other._bits)  # noqa: SLF001 (of the same class)

    def add(self, held: StoredEvidence) -> None:
        """Take a piece that it wants."""
        held.mask = self._mask(held.provenance)
        self.evidence[held.provenance] = held
        self.last_ms = max(self.last_ms, held.stamp_ms)
        self._oldest_ms = min(self._oldest_ms, held.oldest_ms)
        self._has_changed = True

    def forget(self, before_ms: int, most_estimates: int, most: int) -> None:
        """Drop what has a measurement of `before_ms` or earlier, and the first of the too many."""
        if self._oldest_ms <= before_ms:
            self.settled = [held for held in self.settled if held.oldest_ms > before_ms]
            self._drop([p for p, held in self.evidence.items() if held.oldest_ms <= before_ms])
            self._oldest_ms = min([held.oldest_ms for held in self.held], default=before_ms)
            self._has_changed = True
        if old := [name for name, at_ms in self.names.items() if at_ms <= before_ms]:
            self.uncall(old)
        if len(self.evidence) > min(most_estimates, most):
            estimates = [p for p, held in self.evidence.items() if not held.is_measurement]
            self._drop(estimates[: max(0, len(estimates) - most_estimates)])
            self._drop(list(self.evidence)[:-most])
        if len(self._bits) > _MOST_BITS:
            self._number_anew(before_ms)

    def choose(self) -> bool:
        """Choose anew which evidence to use, as `independent` does; whether that is another."""
        if not self._has_changed:
            return False
        before, self.chosen = self.chosen, self._choice(self.evidence.values())
        self._has_changed = False
        return self.chosen != before

    def chosen_without_repeaters(self) -> list[StoredEvidence]:
        """What would be chosen if nobody repeated what the own camera has measured.

        Empty, if nothing that is chosen does.
        """
        own = 0
        for held in self.evidence.values() if self.is_seen else ():
            if held.teller == OWN:
                own |= held.mask
        if not any(held.mask & own and held.teller != OWN for held in self.chosen):
            return []
        return self._choice(
            held for held in self.evidence.values() if held.teller == OWN or not held.mask & own
        )

    def settle(self, before_ms: int) -> None:
        """Decide for good on evidence of `before_ms` or earlier: in use now, or never again."""
        young = self.chosen[len(self.settled) :]
        if old := [held for held in young if held.stamp_ms <= before_ms]:
            self._settle(old)
            self.chosen = self.settled + [held for held in young if held.stamp_ms > before_ms]
            # What is left of the best choice is the best choice of what is left.
            self._has_changed = False

    def take_over(self, other: "Track") -> None:
        """Take all evidence of what has turned out to be the same car."""
        settled = [held for held in other.settled if self._spent.isdisjoint(held.provenance)]
        for held in settled:
            held.mask = self._mask(held.provenance)
        self._settle(settled)
        for provenance, held in other.evidence.items():
            if self.wants(provenance, is_firsthand=held.is_firsthand):
                self.add(held)
        self.first_ms = min(self.first_ms, other.first_ms)
        self.last_ms = max(self.last_ms, other.last_ms)
        self.is_confirmed |= other.is_confirmed
        self.names |= other.names
        self.is_seen |= other.is_seen
        self.told |= other.told
        self._oldest_ms = min(self._oldest_ms, other._oldest_ms)  # noqa: SLF001 (of the same class)
        self._has_changed = True

    def moments(self) -> int:
        """Of how many different moments there is evidence."""
        return len({held.stamp_ms for held in self.held})

    def was_seen_beside(self, other: "Track") -> bool:
        """Whether one observer at one moment measured both, which are therefore two cars."""
        for both in self.evidence.keys() & other.evidence.keys():
            mine, others = self.evidence[both].piece, other.evidence[both].piece
            if (
                isinstance(mine, Measurement)
                and isinstance(others, Measurement)
                and math.dist(mine.position_m, others.position_m) > _SAME_PLACE_M
            ):
                return True
        return False

    def _choice(self, evidence: Iterable[StoredEvidence]) -> list[StoredEvidence]:
        latest_first = sorted(evidence, key=stamp_ms_of, reverse=True)
        indices = select_independent_masks([held.mask for held in latest_first])
        return self.settled + [latest_first[index] for index in indices]

    def _settle(self, some: Iterable[StoredEvidence]) -> None:
        spent = 0
        for held in some:
            self.settled.append(held)
            self._spent |= held.provenance
            spent |= held.mask
        if spent:
            self._drop([p for p, held in self.evidence.items() if held.mask & spent])

    def _drop(self, provenances: Iterable[Provenance]) -> None:
        for provenance in provenances:
            del self.evidence[provenance]
            self._has_changed = True

    def _number_anew(self, after_ms: int) -> None:
        """Sweep out what was noted of measurements that nobody tells of any more."""
        self._spent = {identity for identity in self._spent if identity.stamp_ms > after_ms}
        self.told = {identity for identity in self.told if identity.stamp_ms > after_ms}
        self._bits.clear()
        for held in self.held:
            held.mask = self._mask(held.provenance)

    def _mask(self, provenance: Provenance) -> int:
        bits = self._bits
        for identity in provenance.difference(bits):
            bits[identity] = 1 << len(bits)
        return sum(map(bits.__getitem__, provenance))
