"""Converts time stamps of another clock, of a GNSS receiver or detector, to the host's clock.

Stamped data arrives late by computation, transmission and scheduling. The smallest lateness of the
last seconds is taken as its constant part; the rest is jitter, which does not enter the converted
stamp. UTC of the host's own clock is not used, since nothing guarantees that it is set.
"""

import math

PERIOD_S = 30.0
"""The smallest lateness is that of the last one to two periods; clocks drift by 1 ms in one."""

LARGEST_STEP_S = 2.0
"""A larger change is no lateness: the other clock was set, or the receiver got its leap seconds."""

LATE_S, SET_S = 0.5, 5.0
"""If all stamps of so long a time are later by more, the other clock was set: a queue is emptied in
between. A receiver that learns of one leap second seems late by one second."""

EARLY_S = 0.05
"""A stamp that is less late than all others by more counts only once another one agrees with it: a
single one may be dated ahead, and all true ones after it would seem late."""


class RemoteClock:
    """Estimates the offset between the two clocks from the data itself."""

    def __init__(self, latency_s: float) -> None:
        """Start without data; `latency_s` is the smallest time from stamp to arrival."""
        self._latency_s = latency_s
        self._period_ends_at = -math.inf
        self._last_least_s = math.inf
        self._least_s = math.inf
        self._early_s = math.inf
        """Lateness of a stamp that no other has agreed with yet."""
        self._late_since = math.inf
        self._least_since_s = math.inf
        """Since when all stamps are late, and the smallest lateness since then."""

    def receive_stamp(self, remote_s: float | None, now: float) -> float:
        """Update the offset, and return a stamp on the host's clock.

        Args:
            remote_s: the stamp on the other clock; without one, the arrival counts.
            now: the arrival, on the host's clock.
        """
        if remote_s is None:
            return now - self._latency_s
        difference_s = now - remote_s
        least_s = min(self._least_s, self._last_least_s)
        if abs(difference_s - least_s) > LARGEST_STEP_S:
            self._last_least_s = self._least_s = self._early_s = least_s = math.inf
            self._late_since = self._least_since_s = math.inf
        elif self._receive_lateness(difference_s - least_s, difference_s, now):
            self._last_least_s, self._least_s = math.inf, self._least_since_s
            least_s = self._least_s
        if now >= self._period_ends_at:
            self._last_least_s, self._least_s, self._early_s = self._least_s, math.inf, math.inf
            self._period_ends_at = now + PERIOD_S
        if math.isfinite(least_s) and difference_s < least_s - EARLY_S:
            alone, self._early_s = abs(difference_s - self._early_s) > EARLY_S, difference_s
            if alone:
                return now - self._latency_s
        self._least_s = min(self._least_s, difference_s)
        return remote_s + min(self._least_s, self._last_least_s) - self._latency_s

    def _receive_lateness(self, late_s: float, difference_s: float, now: float) -> bool:
        """Take by how much a stamp is late; return whether all have been for `SET_S`."""
        if late_s <= LATE_S:
            self._late_since = self._least_since_s = math.inf
            return False
        self._late_since = min(self._late_since, now)
        self._least_since_s = min(self._least_since_s, difference_s)
        return now - self._late_since >= SET_S
