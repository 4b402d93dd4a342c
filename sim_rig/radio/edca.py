"""EDCA: channel access of one station (IEEE 802.11-2016, 10.22.2).

When the channel has been free for the AIFS of the category, the station counts down its backoff
slots while the channel stays free, and transmits. The end of the backoff is computed, not simulated
slot by slot, and computed again when the channel becomes busy before it.

A backoff is drawn when a frame is queued on a busy channel, and after each transmission. On a free
channel a frame is sent at the next slot boundary. Broadcast frames are not acknowledged, so the
contention window grows only by internal collisions between the categories of a station.
"""

import math
from collections import deque
from dataclasses import dataclass, field
from enum import IntEnum

import numpy as np

SLOT_S = 13e-6
SIFS_S = 32e-6
EIFS_EXTRA_S = SIFS_S + 88e-6
"""Extra wait after a corrupt frame: SIFS and the duration of an acknowledgement."""
LIFETIME_S = 0.5
"""A frame that has waited longer is dropped (dot11EDCATableMSDULifetime, 500 TU by default; ns-3
has 500 ms)."""
_SAME_S = 1e-10
"""Tolerance for rounding: times that differ by less are equal."""


class AccessCategory(IntEnum):
    """Access category, in order of priority."""

    VO = 0
    VI = 1
    BE = 2
    BK = 3

    @classmethod
    def of(cls, user_priority: int) -> "AccessCategory":
        """Access category of a user priority, 0 to 7 (table 10-1)."""
        return _OF_USER_PRIORITY[user_priority]


_OF_USER_PRIORITY = (
    AccessCategory.BE,
    AccessCategory.BK,
    AccessCategory.BK,
    AccessCategory.BE,
    AccessCategory.VI,
    AccessCategory.VI,
    AccessCategory.VO,
    AccessCategory.VO,
)


@dataclass(frozen=True, slots=True)
class _Parameters:
    """EDCA parameters outside the context of a BSS (table 9-138)."""

    aifsn: int
    least_window: int
    most_window: int


_PARAMETERS = (
    _Parameters(2, 3, 7),
    _Parameters(3, 7, 15),
    _Parameters(6, 15, 1023),
    _Parameters(9, 15, 1023),
)


@dataclass(slots=True)
class QueuedFrame:
    """A frame in a queue of its sender."""

    number: int
    psdu_bytes: int
    queued_s: float


@dataclass(slots=True)
class _Contention:
    """Queue and backoff of one access category of a station."""

    parameters: _Parameters
    window: int
    queue: deque[QueuedFrame] = field(default_factory=deque)
    slots: int = 0
    from_s: float = 0.0
    """Backoff slots count from this time, or later if the channel is busy."""

    def starts_s(self, free_s: float) -> float:
        """Start of the countdown if the channel is free (including SIFS) from `free_s`."""
        return max(self.from_s, free_s + self.parameters.aifsn * SLOT_S)

    def ends_s(self, free_s: float) -> float:
        return self.starts_s(free_s) + self.slots * SLOT_S

    def count_until(self, now: float, free_s: float) -> None:
        """Count down the slots that have passed; the first ends with AIFS."""
        if not self.slots:
            return
        starts_s = self.starts_s(free_s)
        if starts_s <= now:
            gone = min(int((now - starts_s + _SAME_S) / SLOT_S) + 1, self.slots)
            self.slots -= gone
            self.from_s = starts_s + gone * SLOT_S


class Station:
    """The four queues of one station.

    In all methods, `free_s` is the end of the last busy period at this station plus SIFS, or plus
    EIFS less AIFS after a corrupt frame.
    """

    __slots__ = ("_contentions", "_rng", "access_s")

    def __init__(self, rng: np.random.Generator) -> None:
        self._contentions: dict[AccessCategory, _Contention] = {}
        """Contentions in order of priority; only categories that had a frame."""
        self._rng = rng
        self.access_s = math.inf
        """Time of the next transmission if the channel stays free; infinite without a frame."""

    def enqueue(
        self, frame: QueuedFrame, category: AccessCategory, now: float, free_s: float, busy: bool
    ) -> None:
        """Queue a frame.

        Args:
            frame: the frame.
            category: its access category.
            now: time, s.
            free_s: see the class.
            busy: whether the channel is busy now.
        """
        contention = self._contention(category)
        contention.queue.append(frame)
        if len(contention.queue) > 1:
            return
        contention.count_until(now, free_s)
        if contention.slots == 0:
            if busy:
                contention.slots = self._draw(contention)
            else:
                self._align(contention, now, free_s)
        self.plan(now, free_s)

    def plan(self, now: float, free_s: float) -> None:
        """Compute `access_s` again."""
        ends_s = [each.ends_s(free_s) for each in self._contentions.values() if each.queue]
        self.access_s = max(now, min(ends_s)) if ends_s else math.inf

    def pause(self, now: float, free_s: float) -> None:
        """Pause all backoffs: the channel is busy from `now` on; `free_s` is of the time before."""
        for contention in self._contentions.values():
            contention.count_until(now, free_s)

    @property
    def is_at_rest(self) -> bool:
        """Whether there is neither a frame to send nor a running backoff."""
        return not any(each.slots or each.queue for each in self._contentions.values())

    def drop_expired(self, now: float) -> list[QueuedFrame]:
        """Drop and return the frames whose lifetime has ended."""
        dropped: list[QueuedFrame] = []
        for contention in self._contentions.values():
            queue = contention.queue
            while queue and queue[0].queued_s < now - LIFETIME_S:
                dropped.append(queue.popleft())
        return dropped

    def take(self, now: float, free_s: float) -> QueuedFrame:
        """Return the frame to transmit now; other due categories have an internal collision."""
        due = [
            each
            for each in self._contentions.values()
            if each.queue and each.ends_s(free_s) <= now + _SAME_S
        ]
        winner, *losers = due
        for contention in self._contentions.values():
            contention.count_until(now, free_s)
        for loser in losers:
            loser.window = min(2 * loser.window + 1, loser.parameters.most_window)
            loser.slots, loser.from_s = self._draw(loser), now
        self.access_s = math.inf
        frame = winner.queue.popleft()
        winner.window = winner.parameters.least_window
        winner.slots = self._draw(winner)
        return frame

    def _contention(self, category: AccessCategory) -> _Contention:
        """Queue of a category, created at its first use: most stations use one only."""
        if category not in self._contentions:
            parameters = _PARAMETERS[category]
            self._contentions[category] = _Contention(parameters, parameters.least_window)
            self._contentions = dict(sorted(self._contentions.items()))
        return self._contentions[category]

    def _draw(self, contention: _Contention) -> int:
        return int(self._rng.integers(contention.window + 1))

    def _align(self, contention: _Contention, now: float, free_s: float) -> None:
        """Start at the next slot boundary, counted from the end of AIFS on a free channel."""
        first_s = free_s + contention.parameters.aifsn * SLOT_S
        contention.from_s = now
        if now > first_s:
            contention.from_s = first_s + (int((now - first_s) / SLOT_S) + 1) * SLOT_S
