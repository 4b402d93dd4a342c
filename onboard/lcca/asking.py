"""Whose inquiries are answered: of one that may be behind and near, and not too often; and joins.

An answer is larger than an inquiry, and joins a vehicle ID to a certificate. Asked by the temporary
ID of its BSMs, a vehicle gives away an ID that the asker cannot have read: who is ahead or far by
its own BSMs does not get it. Whose place is unknown does: a vehicle without GNSS may be behind, and
whoever lies about its place gets the ID anyway.
"""

import math
from collections import OrderedDict

from typing_extensions import override

ANSWERS_PER_S, ANSWERS_AT_ONCE = 2.0, 3
"""Answers to one signer in the long run, under however many IDs it asks, and at once: the first one
may be lost."""
ALL_ANSWERS_PER_S, ALL_ANSWERS_AT_ONCE = 20.0, 20
"""First answers to all askers, and further ones: ten vehicles that ask as often as they may."""
REPLIES_PER_S, REPLIES_AT_ONCE = 15.0, 15
"""Joins taken of one signer: it refreshes twice a second, retries ten times, and names each
warning that it has received in a join of its own. Not limited in all: followers would get none."""
WITHOUT_S = 0.5
"""An answer after so much longer than its interval is a first one again: one a second is."""
MAX_ASKERS = 64
"""Askers whose last answers are remembered."""
NEAR_M = 200.0
"""Beyond it nobody asks: at 60 m/s, gaps of `ASK_HEADWAY_S` are shorter."""
BESIDE_M = 20.0
"""So far ahead an asker may seem that is behind: positions are late."""

Offset = tuple[float, float, float]
"""Ahead, right, and the sigma of either, in m."""


def is_near(offset_m: Offset) -> bool:
    """Whether a vehicle may be in the range of a camera that reads the own plate."""
    ahead_m, right_m, sigma_m = offset_m
    return max(abs(ahead_m), abs(right_m)) <= NEAR_M + 3.0 * sigma_m


def is_behind(offset_m: Offset) -> bool:
    """Whether a vehicle may be behind."""
    ahead_m, _, sigma_m = offset_m
    return ahead_m <= BESIDE_M + 3.0 * sigma_m


class _Budget:
    """So many answers a second in the long run, and so many at once."""

    def __init__(self, per_s: float, at_once: int) -> None:
        self._per_s = per_s
        self._at_once = at_once
        self.due_at = -math.inf
        """When all answers were due, had they come at that rate."""

    def has_left(self, now: float) -> bool:
        """Whether an answer may be sent."""
        return self.due_at - now <= (self._at_once - 1) / self._per_s

    def take(self, now: float) -> None:
        """Count an answer."""
        self.due_at = max(self.due_at, now) + 1.0 / self._per_s


class ReplyLimit:
    """How many replies are sent to each signer."""

    def __init__(self, per_s: float = REPLIES_PER_S, at_once: int = REPLIES_AT_ONCE) -> None:
        self._per_s, self._at_once = per_s, at_once
        self._askers: OrderedDict[bytes, _Budget] = OrderedDict()

    def take(self, asker: bytes, now: float) -> bool:
        """Return whether a reply may be sent now, and count it."""
        own = self._budget(asker)
        if not own.has_left(now):
            return False
        self._take(asker, own, now)
        return True

    def _budget(self, asker: bytes) -> _Budget:
        return self._askers.get(asker) or _Budget(self._per_s, self._at_once)

    def _take(self, asker: bytes, own: _Budget, now: float) -> None:
        own.take(now)
        self._askers[asker] = own
        self._askers.move_to_end(asker)
        if len(self._askers) > MAX_ASKERS:
            self._askers.popitem(last=False)


class AnswerLimit(ReplyLimit):
    """How many answers are sent, to each asker and in all."""

    def __init__(self) -> None:
        super().__init__(ANSWERS_PER_S, ANSWERS_AT_ONCE)
        self._first = _Budget(ALL_ANSWERS_PER_S, ALL_ANSWERS_AT_ONCE)
        """Of those that got none lately: others that ask often take nothing from it."""
        self._further = _Budget(ALL_ANSWERS_PER_S, ALL_ANSWERS_AT_ONCE)

    @override
    def take(self, asker: bytes, now: float) -> bool:
        own = self._budget(asker)
        of_all = self._first if now >= own.due_at + WITHOUT_S else self._further
        if not own.has_left(now) or not of_all.has_left(now):
            return False
        self._take(asker, own, now)
        of_all.take(now)
        return True
