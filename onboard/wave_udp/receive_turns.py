"""How long one step receives frames, and what share of time unknown signers get, without I/O."""

import math
from collections.abc import Callable, Iterator

from onboard.wave_udp.receive_queue import ReceiveQueue

RADIO_TURN_S = 0.000_7
"""Time in which one step receives BSMs whatever other wires have: three or four BSMs."""

LONGEST_TURN_S = 0.002
"""Time in which one step receives BSMs while no wire has input."""

GATHER_S = 0.02
"""Time for which BSMs without an event wait for others, a fifth of their interval: a step for each
would be half of the steps. Each step takes those that wait."""

UNKNOWN_SIGNERS_SHARE = 0.25
"""Share of time for frames of signers that were not verified before: some 1,500 a second. The rest
is for all else, however many arrive."""


class ReceiveTurns:
    """Hands out the frames of a queue, each after the one before has been handled."""

    def __init__(
        self,
        queue: ReceiveQueue,
        clock: Callable[[], float],
        has_input: Callable[[], bool] = lambda: True,
    ) -> None:
        """Take turns at `queue`.

        Args:
            queue: the frames that wait.
            clock: the time in s, read before and after each frame.
            has_input: whether a wire has input, which may be more urgent.
        """
        self._has_input = has_input
        self._queue = queue
        self._clock = clock
        self._known_at = math.inf
        self._unknown_at = -math.inf

    def put(self, wsm: bytes, *, at_once: bool = False) -> None:
        """Queue a received frame.

        Args:
            wsm: the frame.
            at_once: whether none may wait for others.
        """
        self._queue.put(wsm)
        if at_once or self._queue.is_pressing:
            self._known_at = -math.inf
        elif self._known_at == math.inf and self._queue.has_known:
            self._known_at = self._clock() + GATHER_S

    def get_timer(self) -> float:
        """Return when frames that wait are to be taken; `math.inf` without any."""
        known_at = self._known_at if self._queue.has_known else math.inf
        return min(known_at, self._unknown_at) if self._queue.has_unknown else known_at

    def take(self, now: float) -> Iterator[bytes]:
        """Yield all group messages of known signers; without any, other frames for one turn.

        That is `RADIO_TURN_S`, or longer while no wire has input. So what follows from a group
        message is sent and shown before further BSMs are verified.
        Unknown signers have their own share of time.

        Args:
            now: when the step began.
        """
        turn_s = 0.0 if self._queue.has_urgent else RADIO_TURN_S
        while True:
            wsm = self._queue.take(only_urgent=self._is_over(now, turn_s))
            if wsm is None:
                break
            yield wsm
        self._known_at = -math.inf if self._queue.has_known else math.inf
        yield from self._take_unknown(turn_s)

    def _is_over(self, began_at: float, turn_s: float) -> bool:
        """Whether the turn of other frames than group messages is over."""
        spent_s = self._clock() - began_at
        if turn_s == 0.0 or spent_s < turn_s:
            return spent_s >= turn_s
        return spent_s >= LONGEST_TURN_S or self._has_input()

    def _take_unknown(self, turn_s: float) -> Iterator[bytes]:
        """Yield frames of unknown signers for `turn_s`, at least one, if they are due."""
        began_at = ended_at = self._clock()
        if began_at < self._unknown_at:
            return
        while ended_at <= began_at + turn_s and (wsm := self._queue.take_unknown()) is not None:
            yield wsm
            ended_at = self._clock()
        self._unknown_at = ended_at + (ended_at - began_at) * (1.0 / UNKNOWN_SIGNERS_SHARE - 1.0)
