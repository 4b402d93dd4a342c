"""Outgoing frames by user priority, without I/O.

Many radio units have one queue for all priorities. The queue is therefore here: the unit gets the
next frame only after the time it takes to send the last one, so that a warning waits for one frame
at most, however many are queued.
"""

import math
from collections import deque
from dataclasses import dataclass
from typing import Protocol

from onboard.observations import Discarded

PRIORITIES = 8
"""User priorities 0 to 7 (IEEE 802.1D); 7 is sent first."""

CHANNEL_WAIT_S = 0.000_11
"""Mean wait for a free channel, before a frame is on the air."""

PREAMBLE_S = 0.000_04
"""Preamble and signal field of 802.11p."""

MAC_BYTES = 32
"""Octets of the 802.11 QoS data header (26), EtherType (2) and frame check sequence (4)."""


DATA_RATE_MBIT_S = 6.0


class Gate(Protocol):
    """Congestion control: when a frame may be sent."""

    def opens_at(self, user_priority: int) -> float:
        """Return from when on a frame of a priority may be sent; none earlier for a lower one."""

    def receive_sent(self, size_bytes: int, user_priority: int, now: float) -> None:
        """Take that a frame is sent at `now`."""


@dataclass(frozen=True, slots=True)
class _Queued:
    wsm: bytes
    expires_at: float


class RadioQueue:
    """A bounded queue by user priority, first in first out within one."""

    def __init__(
        self,
        data_rate_mbit_s: float = DATA_RATE_MBIT_S,
        capacity: int = 64,
        gate: Gate | None = None,
    ) -> None:
        """Pace frames by the radio's data rate and `gate`; at most `capacity` frames wait."""
        self._data_rate_mbit_s = data_rate_mbit_s
        self._capacity = capacity
        self._gate = gate
        self._queues: list[deque[_Queued]] = [deque() for _ in range(PRIORITIES)]
        self._free_at = float("-inf")
        self._events: deque[Discarded] = deque()

    def __len__(self) -> int:
        """Return the number of frames that wait."""
        return sum(map(len, self._queues))

    def waiting(self, least_priority: int) -> int:
        """Return the number of frames that wait with this user priority or a higher one."""
        return sum(map(len, self._queues[least_priority:]))

    def put(self, wsm: bytes, user_priority: int, expires_at: float, now: float) -> None:
        """Queue a frame. A full queue drops the oldest of its frames of lowest priority.

        Args:
            wsm: the frame.
            user_priority: 0 to 7.
            expires_at: time from which it is dropped instead of sent.
            now: the present time.

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

    def wsms_to_send(self, now: float, least_priority: int = 0) -> list[tuple[int, bytes]]:
        """Return the frame to give to the radio now, if any, as (user priority, WSM).

        Args:
            now: the present time.
            least_priority: user priority below which a frame stays in the queue.
        """
        self._drop_expired(now)
        if now < self._free_at or not any(self._queues):
            return []
        priority = self._highest_priority()
        if priority < least_priority or now < self._opens_at(priority):
            return []
        wsm = self._queues[priority].popleft().wsm
        self._free_at = now + CHANNEL_WAIT_S + airtime_s(len(wsm), self._data_rate_mbit_s)
        if self._gate is not None:
            self._gate.receive_sent(len(wsm), priority, now)
        return [(priority, wsm)]

    def get_timer(self) -> float:
        """Return when the next frame may be sent; `math.inf` while none waits."""
        if not any(self._queues):
            return math.inf
        return max(self._free_at, self._opens_at(self._highest_priority()))

    def _highest_priority(self) -> int:
        return max(p for p in range(PRIORITIES) if self._queues[p])

    def _opens_at(self, user_priority: int) -> float:
        return -math.inf if self._gate is None else self._gate.opens_at(user_priority)

    def next_event(self) -> Discarded | None:
        """Return the oldest dropped frame not yet taken: reason `expired` or `queue_full`."""
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


def airtime_s(size_bytes: int, data_rate_mbit_s: float = DATA_RATE_MBIT_S) -> float:
    """Return how long a frame of `size_bytes` after the 802.11 header is on the air."""
    return PREAMBLE_S + (MAC_BYTES + size_bytes) * (8e-6 / data_rate_mbit_s)
