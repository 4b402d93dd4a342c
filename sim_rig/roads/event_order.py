"""A fair order of possible events: each pair of cars once before any twice, all kinds of crash.

The pairs are divided into strata by the angle between their headings and by their closing speed,
and the strata take turns, so that the many alike do not stand for the few that differ. Within a
stratum the recordings take turns, and red-light runners that set off with those that do not stop.
"""

import math
from collections.abc import Callable, Hashable, Iterable, Sequence
from itertools import zip_longest
from typing import NamedTuple, TypeVar

import numpy as np

from sim_rig.roads.events import EventSituation

ANGLE_LIMITS_RAD = tuple(map(math.radians, (30.0, 75.0, 105.0)))
"""Between the strata of crossing angles: same direction, acute, right-angled, and oncoming."""
CLOSING_LIMITS_M_S = (10.0, 20.0)
"""Between the strata of closing speeds."""
ItemT = TypeVar("ItemT")


class EventCandidate(NamedTuple):
    """A possible event in one of several recordings."""

    recording: int
    """Index of the recording."""
    situation: EventSituation

    @property
    def pair(self) -> tuple[int, str, str]:
        """The two cars; cars of different recordings differ."""
        return self.recording, *self.situation.pair

    @property
    def stratum(self) -> tuple[int, int]:
        """Indices of its angle and of its closing speed between the limits."""
        angle = int(np.searchsorted(ANGLE_LIMITS_RAD, self.situation.angle_rad, "right"))
        closing_m_s = self.situation.closing_speed_m_s
        return angle, int(np.searchsorted(CLOSING_LIMITS_M_S, closing_m_s, "right"))


class FairOrder:
    """An endless sequence of events, of which any so many in a row as there are pairs differ."""

    def __init__(self, candidates: Iterable[EventCandidate], rng: np.random.Generator) -> None:
        """Put the candidates in order.

        Args:
            candidates: at least one.
            rng: source of the order of pairs, and of the candidates of a pair.
        """
        by_pair = _grouped(candidates, lambda each: each.pair)
        shuffled = [_shuffled(by_pair[at], rng) for at in rng.permutation(len(by_pair))]
        strata = _grouped(shuffled, lambda pair: pair[0].stratum)
        self.pairs: Sequence[Sequence[EventCandidate]] = _in_turn(
            _in_turn(_grouped(strata_pairs, _origin)) for strata_pairs in strata
        )
        """The candidates of each pair, in order."""

    def __getitem__(self, number: int) -> EventCandidate:
        """Event `number`, from 0 on; the pairs come again in the same order."""
        again, at = divmod(number, len(self.pairs))
        of_pair = self.pairs[at]
        return of_pair[again % len(of_pair)]


def _origin(pair: Sequence[EventCandidate]) -> tuple[int, bool]:
    return pair[0].recording, pair[0].situation.event.sets_off


def _grouped(items: Iterable[ItemT], key: Callable[[ItemT], Hashable]) -> list[list[ItemT]]:
    """Groups of items with equal keys, each in the given order."""
    groups: dict[Hashable, list[ItemT]] = {}
    for item in items:
        groups.setdefault(key(item), []).append(item)
    return list(groups.values())


def _shuffled(items: Sequence[ItemT], rng: np.random.Generator) -> list[ItemT]:
    return [items[at] for at in rng.permutation(len(items))]


def _in_turn(groups: Iterable[Sequence[ItemT]]) -> list[ItemT]:
    """One item of each group in turn, until all are taken."""
    return [item for turn in zip_longest(*groups) for item in turn if item is not None]
