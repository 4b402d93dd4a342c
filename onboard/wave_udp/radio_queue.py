"""What goes to the radio first, and what no longer goes at all.

A radio unit sends frame by frame, and many keep one queue for all priorities. So the queue stands
here: the unit is given the next frame only when it has had the time to send the last one, and a
warning waits for one frame at most, however many are queued.
"""

import math
from collections import deque
from dataclasses import dataclass

from onboard.observations import Discarded

PRIORITIES = 8
"""User priorities 0 to 7 (IEEE 802.1D), 7 the most urgent."""

FRAME_OVERHEAD_S = 0.000_15
"""Preamble and signal field of 802.11p (40 us), and its mean wait for a free channel."""

MAC_BYTES = 32
"""802.11 QoS data header (26), EtherType (2), frame check sequence (4)."""


@dataclass(frozen=True, slots=True)
class _Queued:
    wsm: bytes
    expires_at: float


class RadioQueue:
    """Bounded, by user priority, first in first out within one."""

    def __init__(self, data_rate_mbit_s: float = 6.0, capacity: int = 64) -> None:
        """Take the radio's data rate, and how many frames may wait."""
        self._byte_s = 8e-6 / data_rate_mbit_s
        self._capacity = capacity
        self._queues: list[deque[_Queued]] = [deque() for _ in range(PRIORITIES)]
        self._free_at = float("-inf")
        self._events: deque[Discarded] = deque()

    def __len__(self) -> int:
        """How many frames wait."""
        return sum(map(len, self._queues))

    def put(self, wsm: bytes, user_priority: int, expires_at: float, now: float) -> None:
        """Queue `wsm`. A full queue loses the oldest of its least urgent frames.

        Raises:
            ValueError: `user_priority` is not 0 to 7.
        """
        if not 0 <= user_priority < PRIORITIES:
            raise ValueError(f"a user priority is 0 to {PRIORITIES - 1} (given {user_priority})")
        self._drop_expired(now)
        self._queues[user_priority].append(_Queued(wsm, expires_at))
        if len(self) > self._capacity:
            least = next(queue for queue in self._queues if queue)
            self._drop(least.popleft(), "queue_full", now)

    def wsms_to_send(self, now: float) -> list[tuple[int, bytes]]:
        """Return the frame that the radio is to be given now, if any, as (user priority, WSM)."""
        self._drop_expired(now)
        if now < self._free_at or not len(self):
            return []
        priority = max(p for p in range(PRIORITIES) if self._queues[p])
        wsm = self._queues[priority].popleft().wsm
        self._free_at = now + FRAME_OVERHEAD_S + (MAC_BYTES + len(wsm)) * self._byte_s
        return [(priority, wsm)]

    def get_timer(self) -> float:
        """Return when the radio is free for the next frame; `math.inf` while none waits."""
        return self._free_at if len(self) else math.inf

    def next_event(self) -> Discarded | None:
        """The oldest drop not yet taken: reason `expired` or `queue_full`."""
        return self._events.popleft() if self._events else None

    def _drop_expired(self, now: float) -> None:
        if not any(self._queues):
            return
        for priority, queue in enumerate(self._queues):
            if any(queued.expires_at <= now for queued in queue):
                fresh = deque[_Queued]()
                for queued in queue:
                    if queued.expires_at > now:
                        fresh.append(queued)
                    else:
                        self._drop(queued, "expired", now)
                self._queues[priority] = fresh

    def _drop(self, queued: _Queued, reason: str, now: float) -> None:
        self._events.append(Discarded(now, "radio", reason, f"{len(queued.wsm)} bytes"))
