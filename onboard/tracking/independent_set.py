"""Which evidence to use, so that no measurement counts twice (section IV-B).

The paper's graph has a vertex for every measurement or estimate, its value the number of
measurements in it, and an edge between two that share a measurement. Wanted is the independent set
of the greatest total value and, among equals, the one of fewest entries (each entry costs a run of
the Kalman filter).

The paper tries solution structures, {4}, {1,3}, {2,2}, ..., from the greatest total downwards. Its
reason why that is quick, few distinct measurements, makes something quicker possible: settle one
measurement after the other. An entry is decided on at its earliest measurement, and of everything
decided so far only one thing matters for what follows: which of the later measurements are taken.
All choices that agree in that are one state, of which the best is kept. The paper's order of
preference is the order of the totals that are compared.

Entries of one measurement, the great majority, need no decision: whatever the others leave, they
cover. So another entry is worth the measurements that it adds to theirs, and each that it spares.

Provenances made for it double the states with every measurement. Beyond `_MOST_STATES` only the
best so far are kept, and only there something better may be missed; honest cars need a handful.
"""

import heapq
from collections import defaultdict
from collections.abc import Hashable, Iterable, Sequence
from operator import itemgetter
from typing import NamedTuple

from onboard.tracking.evidence import Evidence, stamp_ms_of

_MOST_STATES = 1000


def select_independent(provenances: Sequence[frozenset[Hashable]]) -> list[int]:
    """Return the indices of the independent set of most measurements and fewest entries.

    That is exact up to `_MOST_STATES` undecided combinations; more are only made on purpose.
    Among several such sets the one is taken that contains the earlier entries, so put those first
    that should be preferred. Entries without a measurement are never taken.
    """
    bits: dict[Hashable, int] = {}
    masks = []
    for provenance in provenances:
        mask = 0
        for measurement in provenance:
            bit = bits.get(measurement)
            if bit is None:
                bit = bits[measurement] = 1 << len(bits)
            mask |= bit
        masks.append(mask)
    return select_independent_masks(masks)


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


def _choose(entries: Sequence[tuple[int, int]], covered: int) -> list[int]:
    """Choose among `entries` (index, mask) of several measurements; singles cover `covered`."""
    totals = {0: 0}
    """The best total for every set of taken measurements that later entries contain."""
    for step in _steps(entries, covered):
        totals = _settle(step, totals)
    best, last = totals[0], len(entries) - 1
    return [index for at, (index, _) in enumerate(entries) if best >> (last - at) & 1]


class _Step(NamedTuple):
    """One measurement, and what may be decided on there."""

    measurement: int
    """Its bit."""
    starting: list[tuple[int, int]]
    """The entries whose earliest measurement it is: (mask, worth)."""
    later: int
    """The measurements of the entries that are decided on later."""


def _steps(entries: Sequence[tuple[int, int]], covered: int) -> list[_Step]:
    """The earliest measurement of each entry, in their order.

    What an entry is worth, and a total, is one number that is compared as a whole: measurements
    gained, then entries spared, then one bit for every entry taken, the earlier the higher.
    """
    shift = len(entries)
    # A measurement gained weighs more than all entries spared, and one spared than all preferences.
    spared = 1 << shift
    gained = spared << 1 + (covered.bit_count() + shift).bit_length()
    by_earliest: dict[int, list[tuple[int, int]]] = defaultdict(list)
    taken_bit = spared
    for _, mask in entries:
        taken_bit >>= 1
        size, known = mask.bit_count(), (mask & covered).bit_count()
        worth = (size - known) * gained + (known - 1) * spared + taken_bit
        by_earliest[mask & -mask].append((mask, worth))
    steps = []
    later = 0
    for earliest in sorted(by_earliest, reverse=True):
        steps.append(_Step(earliest, by_earliest[earliest], later))
        for mask, _ in by_earliest[earliest]:
            later |= mask
    return steps[::-1]


def _settle(step: _Step, totals: dict[int, int]) -> dict[int, int]:
    """What `totals` becomes by the best decision: to take none of those that start here, or one."""
    measurement, starting, later = step
    settled: dict[int, int] = {}
    for taken, total in totals.items():
        left = taken & later
        if left not in settled or settled[left] < total:
            settled[left] = total
        if taken & measurement:
            continue
        for mask, worth in starting:
            if not mask & taken:
                left, more = (taken | mask) & later, total + worth
                if left not in settled or settled[left] < more:
                    settled[left] = more
    if len(settled) > _MOST_STATES:
        return dict(heapq.nlargest(_MOST_STATES, settled.items(), key=itemgetter(1)))
    return settled
