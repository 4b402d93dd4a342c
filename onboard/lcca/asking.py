"""Whose inquiries are answered: of one that may be behind and near, and not too often.

An answer is larger than an inquiry, and joins a vehicle ID to a certificate. Asked by the temporary
ID of its BSMs, a vehicle gives away an ID that the asker cannot have read: only who is behind and
near by its own BSMs gets it.
"""

from collections import OrderedDict

ANSWERS_PER_S, ANSWERS_AT_ONCE = 2.0, 3
"""Answers to one signer in the long run, under however many IDs it asks, and at once: the first one
may be lost."""
ALL_ANSWERS_PER_S, ALL_ANSWERS_AT_ONCE = 20.0, 20
"""Answers to all: ten vehicles that ask as often as they may."""
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


class AnswerLimit:
    """How many answers are sent, to each asker and in all."""

    def __init__(self) -> None:
        self._due_at: OrderedDict[bytes, float] = OrderedDict()
        """By asker: when all its answers were due, had they come at `ANSWERS_PER_S`."""
        self._all_due_at = float("-inf")

    def take(self, asker: bytes, now: float) -> bool:
        """Return whether an answer may be sent now, and count it."""
        due_at = max(self._due_at.get(asker, now), now)
        all_due_at = max(self._all_due_at, now)
        if due_at - now > (ANSWERS_AT_ONCE - 1) / ANSWERS_PER_S:
            return False
        if all_due_at - now > (ALL_ANSWERS_AT_ONCE - 1) / ALL_ANSWERS_PER_S:
            return False
        self._all_due_at = all_due_at + 1.0 / ALL_ANSWERS_PER_S
        self._due_at[asker] = due_at + 1.0 / ANSWERS_PER_S
        self._due_at.move_to_end(asker)
        if len(self._due_at) > MAX_ASKERS:
            self._due_at.popitem(last=False)
        return True
