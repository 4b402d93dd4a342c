"""Frames from the radio that wait for the cores, still without I/O.

A crowd can send more than one processor verifies. Then the few messages of the warning group must
not wait behind hundreds of BSMs: they come first, and none of them is given up. Of the others the
newest count, since each sender says the same again a tenth of a second later.
"""

from collections import deque

from onboard.messages.declaration import DecodeError
from onboard.wave_udp import wsmp

MOST_WAITING = 256
"""BSMs: a tenth of a second of what one core verifies. More of them would only be older."""
MOST_URGENT = 4096
"""No trial has so many cars; whoever sends more wants the car to have no memory left."""


class ReceiveQueue:
    """Urgent frames in their order, then the others in theirs."""

    def __init__(self, urgent_psid: int) -> None:
        """Frames under `urgent_psid` go before all others."""
        self._urgent_psid = urgent_psid
        self._urgent: deque[bytes] = deque(maxlen=MOST_URGENT)
        self._others: deque[bytes] = deque(maxlen=MOST_WAITING)
        self._shed = 0

    def __bool__(self) -> bool:
        return bool(self._urgent or self._others)

    def put(self, wsm: bytes) -> None:
        """A frame came."""
        queue = self._urgent if self._is_urgent(wsm) else self._others
        self._shed += len(queue) == queue.maxlen
        queue.append(wsm)

    def take(self, *, only_urgent: bool = False) -> bytes | None:
        """The frame that is next; `None` when there is none."""
        if self._urgent:
            return self._urgent.popleft()
        return self._others.popleft() if self._others and not only_urgent else None

    def take_shed(self) -> int:
        """How many frames have been given up since the last call."""
        shed, self._shed = self._shed, 0
        return shed

    def _is_urgent(self, wsm: bytes) -> bool:
        try:
            return wsmp.decode(wsm).psid == self._urgent_psid
        except DecodeError:
            return False  # the cores say what is wrong with it, when there is time
