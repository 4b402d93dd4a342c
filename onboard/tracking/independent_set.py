"""Which evidence to use, so that no measurement counts twice (section IV-B).

The paper's graph has a vertex for every measurement or estimate, its value the number of
measurements in it, and an edge between two that share a measurement. Wanted is the independent set
of the greatest total value and, among equals, the one of fewest entries (each entry costs a run of
the Kalman filter).

The paper tries solution structures, {4}, {1,3}, {2,2}, ..., from the greatest total downwards. That
is quick because there are few distinct measurements, which makes dynamic programming over the
measurements quicker: each entry is decided on at its earliest measurement, and a state is the set
of later measurements that are taken. Of all choices that lead to one state, only the best is kept.
The paper's order of preference is the order of the totals that are compared.

Entries of one measurement, the great majority, need no decision: they cover what the others leave.
So another entry is worth the measurements that it adds to theirs, and each entry that it saves.

Provenances made to be hard double the states with every measurement. Beyond `_MAX_STATES` only the
best are kept, and only there the result may not be the best; ordinary traffic needs a handful.
"""

import heapq
from collections import defaultdict
from collections.abc import Hashable, Iterable, Sequence
from operator import itemgetter
from typing import NamedTuple, Protocol, TypeVar

from onboard.tracking.evidence import Provenance, stamp_ms_of

_MAX_STATES = 1000


class HasProvenance(Protocol):
    """Evidence, stored or not; it has a `stamp_ms` as well."""

    @property
    def provenance(self) -> Provenance:
        """The measurements in it."""
        ...


PieceT = TypeVar("PieceT", bound=HasProvenance)


class Bits(dict[Hashable, int]):
    """A bit for each measurement, given to it when it is first asked for."""

    def __missing__(self, measurement: Hashable) -> int:
        bit = self[measurement] = 1 << len(self)
        return bit

    def mask(self, provenance: Iterable[Hashable]) -> int:
        """Return the bits of all measurements in a provenance, each of which is in it once."""
        return sum(map(self.__getitem__, provenance))


def select_independent(provenances: Sequence[frozenset[Hashable]]) -> list[int]:
    """Return the indices of the independent set of most measurements and fewest entries.

    Exact up to `_MAX_STATES` undecided combinations. Among several such sets it is the one with the
    earlier entries, so preferred entries come first. Entries without a measurement are never taken.
    """
    bits = Bits()
    return select_independent_masks([bits.mask(provenance) for provenance in provenances])


def select_independent_masks(masks: Sequence[int]) -> list[int]:
    """`select_independent` for provenances given as bit sets."""
    singles: dict[int, int] = {}
    several: list[tuple[int, int]] = []
    for index, mask in enumerate(masks):
        if mask & (mask - 1):
            several.append((index, mask))
        elif mask:
            singles.setdefault(mask, index)
    covered = sum(singles)
    chosen = _choose(several, covered)
    for index in chosen:
        covered &= ~masks[index]
    chosen += [index for mask, index in singles.items() if mask & covered]
    return sorted(chosen)


def independent(evidence: Iterable[PieceT]) -> list[PieceT]:
    """Return the independent set of evidence, the latest among equals."""
    latest_first = sorted(evidence, key=stamp_ms_of, reverse=True)
    chosen = select_independent([piece.provenance for piece in latest_first])
    return [latest_first[index] for index in chosen]


def up_to(max_measurements: int, evidence: Iterable[PieceT]) -> list[PieceT]:
    """Return the first pieces that have at most `max_measurements` measurements together."""
    left = max_measurements
    fitting = []
    for piece in evidence:
        if len(piece.provenance) <= left:
            left -= len(piece.provenance)
            fitting.append(piece)
    return fitting


def _choose(entries: Sequence[tuple[int, int]], covered: int) -> list[int]:
    """Choose among `entries` (index, mask) of several measurements; singles cover `covered`."""
    if not entries:
        return []
    totals = {0: 0}
    """The best total for every set of taken measurements that later entries contain."""
    for step in _steps(entries, covered):
        totals = _decide(step, totals)
    best, last = totals[0], len(entries) - 1
    return [index for at, (index, _) in enumerate(entries) if best >> (last - at) & 1]


class _Step(NamedTuple):
    """One measurement, and the entries that are decided on at it."""

    measurement: int
    """Its bit."""
    starting: list[tuple[int, int]]
    """The entries whose earliest measurement it is: (mask, worth)."""
    later: int
    """The measurements of the entries that are decided on later."""


def _steps(entries: Sequence[tuple[int, int]], covered: int) -> list[_Step]:
    """Return the earliest measurement of each entry, in their order.

    The worth of an entry, and a total, is one number that is compared as a whole: measurements
    gained, then entries saved, then one bit for every entry taken, the earlier the higher.
    """
    shift = len(entries)
    # A measurement gained weighs more than all entries saved, one saved more than all preferences.
    saved = 1 << shift
    gained = saved << 1 + (covered.bit_count() + shift).bit_length()
    by_earliest: dict[int, list[tuple[int, int]]] = defaultdict(list)
    taken_bit = saved
    for _, mask in entries:
        taken_bit >>= 1
        size, known = mask.bit_count(), (mask & covered).bit_count()
        worth = (size - known) * gained + (known - 1) * saved + taken_bit
        by_earliest[mask & -mask].append((mask, worth))
    steps = []
    later = 0
    for earliest in sorted(by_earliest, reverse=True):
        steps.append(_Step(earliest, by_earliest[earliest], later))
        for mask, _ in by_earliest[earliest]:
            later |= mask
    return steps[::-1]


def _decide(step: _Step, totals: dict[int, int]) -> dict[int, int]:
    """Return the totals after taking none or one of the entries that start at this step."""
    measurement, starting, later = step
    decided: dict[int, int] = {}
    for taken, total in totals.items():
        left = taken & later
        if left not in decided or decided[left] < total:
            decided[left] = total
        if taken & measurement:
            continue
        for mask, worth in starting:
            if not mask & taken:
                left, more = (taken | mask) & later, total + worth
                if left not in decided or decided[left] < more:
                    decided[left] = more
    if len(decided) > _MAX_STATES:
        return dict(heapq.nlargest(_MAX_STATES, decided.items(), key=itemgetter(1)))
    return decided
