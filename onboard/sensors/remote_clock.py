"""Moves the time of another clock, a GNSS receiver's or a detector's, onto the car's.

What it sends is stamped by itself, and arrives late by computing, lines, programs between and this
machine: always some, sometimes more. The least lateness seen lately is the constant part; what is
beyond it is jitter and does not enter the stamp. The machine's own UTC is not used, since nothing
guarantees that it is set.
"""

import math

PERIOD_S = 30.0
"""The least lateness is that of the last one to two periods; clocks drift by 1 ms in one."""

LARGEST_STEP_S = 2.0
"""More is no lateness: the other clock was set, or its receiver learnt its leap seconds."""


class RemoteClock:
    """Learns the difference between the two clocks from the stream itself."""

    def __init__(self, latency_s: float) -> None:
        """`latency_s` is the constant part: from the stamp to the arrival, at best."""
        self._latency_s = latency_s
        self._period_ends_at = -math.inf
        self._last_least_s = math.inf
        self._least_s = math.inf

    def stamp_s(self, other_s: float | None, now: float) -> float:
        """When what was stamped `other_s`, and arrived at `now`, was so, on the car's clock."""
        if other_s is None:
            return now - self._latency_s
        difference_s = now - other_s
        if abs(difference_s - min(self._least_s, self._last_least_s)) > LARGEST_STEP_S:
            self._last_least_s = self._least_s = math.inf
        if now >= self._period_ends_at:
            self._last_least_s, self._least_s = self._least_s, math.inf
            self._period_ends_at = now + PERIOD_S
        self._least_s = min(self._least_s, difference_s)
        return other_s + min(self._least_s, self._last_least_s) - self._latency_s
