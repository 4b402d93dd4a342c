"""How long one step receives frames, and what share of time unknown signers get, without I/O."""

import math
from collections.abc import Callable, Iterator

from onboard.wave_udp.receive_queue import ReceiveQueue

RADIO_TURN_S = 0.000_7
"""Time in which one step receives BSMs before the wires are polled again: three or four BSMs."""

UNKNOWN_SIGNERS_SHARE = 0.25
"""Share of time for frames of signers that were not verified before: some 1,500 a second. The rest
is for all else, however many arrive."""


class ReceiveTurns:
    """Hands out the frames of a queue, each after the one before has been handled."""

    def __init__(self, queue: ReceiveQueue, clock: Callable[[], float]) -> None:
        """Take turns at `queue`.

        Args:
            queue: the frames that wait.
            clock: the time in s, read before and after each frame.
        """
        self._queue = queue
        self._clock = clock
        self._unknown_at = -math.inf

    def get_timer(self) -> float:
        """Return when frames of unknown signers that wait may be taken; `math.inf` without any."""
        return self._unknown_at if self._queue.has_unknown else math.inf

    def take(self, now: float) -> Iterator[bytes]:
        """Yield all group messages of known signers; without any, other frames for `RADIO_TURN_S`.

        So what follows from a group message is sent and shown before further BSMs are verified.
        Unknown signers have their own share of time.

        Args:
            now: when the step began.
        """
        turn_s = 0.0 if self._queue.has_urgent else RADIO_TURN_S
        while True:
            wsm = self._queue.take(only_urgent=self._clock() >= now + turn_s)
            if wsm is None:
                break
            yield wsm
        yield from self._take_unknown(turn_s)

    def _take_unknown(self, turn_s: float) -> Iterator[bytes]:
        """Yield frames of unknown signers for `turn_s`, at least one, if they are due."""
        began_at = ended_at = self._clock()
        if began_at < self._unknown_at:
            return
        while ended_at <= began_at + turn_s and (wsm := self._queue.take_unknown()) is not None:
            yield wsm
            ended_at = self._clock()
        self._unknown_at = ended_at + (ended_at - began_at) * (1.0 / UNKNOWN_SIGNERS_SHARE - 1.0)
