"""Who may transmit when: EDCA, the contention of one station (IEEE 802.11-2016, 10.22.2).

A station listens; when the channel has been free for the category's AIFS, it counts down its
backoff slots while the channel stays free, and transmits. Counting is not simulated slot by slot:
the end is computed, and computed anew when the channel was taken before it came.

A backoff is drawn when a frame is queued on a busy channel, and after each transmission. On a free
channel a frame goes at the next slot boundary. Broadcast frames are not acknowledged, so the
contention window grows only when categories of one station collide with each other.
"""

import math
from collections import deque
from dataclasses import dataclass, field
from enum import IntEnum

import numpy as np

SLOT_S = 13e-6
SIFS_S = 32e-6
EIFS_EXTRA_S = SIFS_S + 88e-6
"""Longer than after a good frame: SIFS and the time of the acknowledgement that might come."""
LIFETIME_S = 0.5
"""A frame that has waited longer is given up (dot11EDCATableMSDULifetime, 500 TU by default; ns-3
has 500 ms)."""
_SAME_S = 1e-10
"""Times that differ by less are the same, whatever floats say."""


class AccessCategory(IntEnum):
    """From the first served to the last."""

    VO = 0
    VI = 1
    BE = 2
    BK = 3

    @classmethod
    def of(cls, user_priority: int) -> "AccessCategory":
        """Of a user priority, 0 to 7 (table 10-1)."""
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
    """Outside the context of a BSS (table 9-138)."""

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
    """One frame at its sender."""

    number: int
    psdu_bytes: int
    queued_s: float


@dataclass(slots=True)
class _Contention:
    """One access category of one station."""

    parameters: _Parameters
    window: int
    queue: deque[QueuedFrame] = field(default_factory=deque)
    slots: int = 0
    from_s: float = 0.0
    """Slots count from here, unless the channel is taken for longer."""

    def starts_s(self, free_s: float) -> float:
        """When counting starts, the channel being free (SIFS included) from `free_s`."""
        return max(self.from_s, free_s + self.parameters.aifsn * SLOT_S)

    def ends_s(self, free_s: float) -> float:
        return self.starts_s(free_s) + self.slots * SLOT_S

    def count_until(self, now: float, free_s: float) -> None:
        """Count down the slots that have gone; the first goes at the end of AIFS."""
        if not self.slots:
            return
        starts_s = self.starts_s(free_s)
        if starts_s <= now:
            gone = min(int((now - starts_s + _SAME_S) / SLOT_S) + 1, self.slots)
            self.slots -= gone
            self.from_s = starts_s + gone * SLOT_S


class Station:
    """One station's four queues.

    In the methods, `free_s` is when the channel is or was free again as this station hears it,
    with SIFS on top, or what takes its place after a frame that could not be read.
    """

    __slots__ = ("_contentions", "_rng", "access_s")

    def __init__(self, rng: np.random.Generator) -> None:
        self._contentions: dict[AccessCategory, _Contention] = {}
        """Of the categories that have had a frame, from the first served to the last."""
        self._rng = rng
        self.access_s = math.inf
        """When it transmits, if the channel stays free; infinity with nothing to send."""

    def enqueue(
        self, frame: QueuedFrame, category: AccessCategory, now: float, free_s: float, busy: bool
    ) -> None:
        """Queue a frame; `busy` says whether the channel is taken now."""
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
        """Work out `access_s` anew."""
        ends_s = [each.ends_s(free_s) for each in self._contentions.values() if each.queue]
        self.access_s = max(now, min(ends_s)) if ends_s else math.inf

    def pause(self, now: float, free_s: float) -> None:
        """The channel is taken from `now` on; `free_s` is from before."""
        for contention in self._contentions.values():
            contention.count_until(now, free_s)

    @property
    def is_at_rest(self) -> bool:
        """Nothing to send, and no backoff left to count."""
        return not any(each.slots or each.queue for each in self._contentions.values())

    def give_up(self, now: float) -> list[QueuedFrame]:
        """Drop the frames that have waited for too long; they are returned."""
        given_up: list[QueuedFrame] = []
        for contention in self._contentions.values():
            queue = contention.queue
            while queue and queue[0].queued_s < now - LIFETIME_S:
                given_up.append(queue.popleft())
        return given_up

    def take(self, now: float, free_s: float) -> QueuedFrame:
        """The frame that is transmitted now: others that are due lose, and draw again."""
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
        """Made when it is first asked for: most stations never use more than one."""
        if category not in self._contentions:
            parameters = _PARAMETERS[category]
            self._contentions[category] = _Contention(parameters, parameters.least_window)
            self._contentions = dict(sorted(self._contentions.items()))
        return self._contentions[category]

    def _draw(self, contention: _Contention) -> int:
        return int(self._rng.integers(contention.window + 1))

    def _align(self, contention: _Contention, now: float, free_s: float) -> None:
        """Slots go on while nobody has anything to send; a frame waits for the next boundary."""
        first_s = free_s + contention.parameters.aifsn * SLOT_S
        contention.from_s = now
        if now > first_s:
            contention.from_s = first_s + (int((now - first_s) / SLOT_S) + 1) * SLOT_S
