"""One car without a radio: the evidence of it, and which of that may be used together."""

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace

from onboard.mvs.evidence import (
    Estimate,
    Evidence,
    Measurement,
    MeasurementId,
    Provenance,
    is_made_by,
    stamp_ms_of,
)
from onboard.mvs.fusion import as_estimate
from onboard.mvs.independent_set import select_independent, select_independent_masks
from onboard.mvs.kalman import Array

_MOST_BITS = 512
_SAME_PLACE_M = 0.1
"""One measurement told by two is the same place, but for the rounding on its ways."""

OWN = b""
"""The teller of what the own camera sees."""
Name = tuple[bytes, int]
"""Who tells of a car, and what he calls it."""


@dataclass(frozen=True, slots=True, eq=False)
class Held:
    """A piece of evidence and how it came."""

    piece: Evidence
    teller: bytes
    """Who sent it; `OWN` for the own measurements."""
    received_ms: int
    """UTC."""

    def is_from_observer(self) -> bool:
        """Whether the teller has measured it itself."""
        return isinstance(self.piece, Measurement) and _is_own_word(
            self.teller, self.piece.provenance
        )


class Track:
    """What the own car holds of one car without a radio."""

    def __init__(self, number: int, first: Held) -> None:
        self.number = number
        """The own car's name for it."""
        self.first_teller = first.teller
        self.names: dict[Name, int] = {}
        """What others, and the own camera, call it, and when they last did; UTC, as all times."""
        self.evidence: dict[Provenance, Held] = {first.piece.provenance: first}
        self.settled: list[Evidence] = []
        """What was used when it grew old: it stays in use, and its measurements are spent."""
        self._spent: set[MeasurementId] = set()
        self._bits: dict[MeasurementId, int] = {}
        """What has been told of this car, one bit for each measurement."""
        self._masks = {first.piece.provenance: self._mask(first.piece.provenance)}
        """The provenances in `evidence` as bit sets."""
        self._next_old_ms = first.piece.oldest_ms
        """Nothing that is held of it is older than this."""
        self.used: list[Evidence] = [first.piece]
        """The independent evidence in `estimate`."""
        self.estimate = as_estimate(first.piece)
        self.first_ms = self.last_ms = first.piece.stamp_ms
        """Of the first evidence of it and of the last."""
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
    def is_seen(self) -> bool:
        """Whether the own camera has seen it, as long as that is remembered."""
        return any(teller == OWN for teller, _ in self.names)

    def call(self, name: Name, at_ms: int) -> None:
        """Note what somebody has called it just now."""
        self.names[name] = at_ms
        self._next_old_ms = min(self._next_old_ms, at_ms)

    def wants(self, provenance: Provenance, teller: bytes, *, measured: bool) -> bool:
        """Whether a piece would say something new.

        What an observer says of its own measurement replaces hearsay of it.
        """
        if not self._spent.isdisjoint(provenance):
            return False
        known = self.evidence.get(provenance)
        return known is None or (
            measured and _is_own_word(teller, provenance) and not known.is_from_observer()
        )

    def shares(self, provenance: Provenance) -> bool:
        """Whether a measurement in `provenance` has been told of this car."""
        return not self._bits.keys().isdisjoint(provenance)

    def shares_with(self, other: "Track") -> bool:
        """Whether one measurement has been told of both."""
        return not self._bits.keys().isdisjoint(other._bits)  # noqa: SLF001 (of the same class)

    def add(self, held: Held) -> None:
        """Take a piece that it wants."""
        provenance = held.piece.provenance
        self.evidence[provenance] = held
        self._masks[provenance] = self._mask(provenance)
        self.last_ms = max(self.last_ms, held.piece.stamp_ms)
        self._next_old_ms = min(self._next_old_ms, held.piece.oldest_ms)

    def forget(self, before_ms: int, most_estimates: int, most: int) -> None:
        """Drop what has a measurement of `before_ms` or earlier, and the first of the too many."""
        if self._next_old_ms <= before_ms:
            self.settled = [piece for piece in self.settled if piece.oldest_ms > before_ms]
            self._spent = {identity for identity in self._spent if identity[1] > before_ms}
            self._keep(p for p, held in self.evidence.items() if held.piece.oldest_ms > before_ms)
            self.told = {identity for identity in self.told if identity[1] > before_ms}
            self.names = {name: at_ms for name, at_ms in self.names.items() if at_ms > before_ms}
            times_ms = [piece.oldest_ms for piece in self.pieces] + list(self.names.values())
            self._next_old_ms = min(times_ms, default=before_ms)
        if len(self.evidence) > min(most_estimates, most):
            estimates = [p for p, held in self.evidence.items() if isinstance(held.piece, Estimate)]
            too_many = set(estimates[: max(0, len(estimates) - most_estimates)])
            kept = [provenance for provenance in self.evidence if provenance not in too_many]
            self._keep(kept[-most:])
        if len(self._bits) > _MOST_BITS:
            self._bits.clear()
            for piece in self.settled:
                self._mask(piece.provenance)
            self._masks = {provenance: self._mask(provenance) for provenance in self.evidence}

    def choose(self) -> None:
        """Choose anew which evidence to use, as `independent` does."""
        latest_first = sorted(
            [held.piece for held in self.evidence.values()], key=stamp_ms_of, reverse=True
        )
        masks = [self._masks[piece.provenance] for piece in latest_first]
        chosen = [latest_first[index] for index in select_independent_masks(masks)]
        self.used = self.settled + chosen

    def settle(self, before_ms: int) -> None:
        """Decide for good on evidence of `before_ms` or earlier: in use now, or never again."""
        chosen = self.used[len(self.settled) :]
        self._settle([piece for piece in chosen if piece.stamp_ms <= before_ms])

    def take_over(self, other: "Track") -> None:
        """Take all evidence of what has turned out to be the same car."""
        self._settle([piece for piece in other.settled if self._spent.isdisjoint(piece.provenance)])
        for provenance, held in other.evidence.items():
            if self.wants(provenance, held.teller, measured=isinstance(held.piece, Measurement)):
                self.add(held)
        self.first_ms = min(self.first_ms, other.first_ms)
        self.last_ms = max(self.last_ms, other.last_ms)
        self.is_confirmed |= other.is_confirmed
        self.names |= other.names
        self.told |= other.told
        self._next_old_ms = min(self._next_old_ms, other._next_old_ms)  # noqa: SLF001 (of the same class)

    @property
    def pieces(self) -> list[Evidence]:
        """All evidence of it, as it came."""
        return self.settled + [held.piece for held in self.evidence.values()]

    def moments(self) -> int:
        """Of how many different moments there is evidence."""
        return len({piece.stamp_ms for piece in self.pieces})

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

    def map_to(self, turn: Array, shift: Array) -> None:
        """Bring everything into another frame (`LocalFrame.mapping_from`)."""
        self.evidence = {
            provenance: replace(held, piece=held.piece.mapped(turn, shift))
            for provenance, held in self.evidence.items()
        }
        self.settled = [piece.mapped(turn, shift) for piece in self.settled]
        self.used = [piece.mapped(turn, shift) for piece in self.used]
        self.estimate = self.estimate.mapped(turn, shift)

    def _settle(self, pieces: Iterable[Evidence]) -> None:
        spent = 0
        for piece in pieces:
            self.settled.append(piece)
            self._spent |= piece.provenance
            spent |= self._mask(piece.provenance)
        if spent:
            self._keep(p for p, mask in self._masks.items() if not mask & spent)

    def _keep(self, provenances: Iterable[Provenance]) -> None:
        self.evidence = {provenance: self.evidence[provenance] for provenance in provenances}
        self._masks = {provenance: self._masks[provenance] for provenance in self.evidence}

    def _mask(self, provenance: Provenance) -> int:
        mask, bits = 0, self._bits
        for identity in provenance:
            bit = bits.get(identity)
            if bit is None:
                bit = bits[identity] = 1 << len(bits)
            mask |= bit
        return mask


def independent(pieces: Iterable[Evidence]) -> list[Evidence]:
    """The most measurements, none twice, in the fewest pieces; the latest among equals."""
    latest_first = sorted(pieces, key=stamp_ms_of, reverse=True)
    chosen = select_independent([piece.provenance for piece in latest_first])
    return [latest_first[index] for index in chosen]


def up_to(most: int, pieces: Iterable[Evidence]) -> list[Evidence]:
    """Those that make `most` measurements together at most, the first ones first."""
    fitting = []
    for piece in pieces:
        if len(piece.provenance) <= most:
            most -= len(piece.provenance)
            fitting.append(piece)
    return fitting


def _is_own_word(teller: bytes, provenance: Provenance) -> bool:
    """Whether `teller` has made this one measurement."""
    return teller == OWN or is_made_by(teller, provenance)
