"""When the next message of one kind is due: what the schedules of BSMs, CAMs and CPMs share."""

import numpy as np
from typing_extensions import override

from onboard.core import Core


class DueTime(Core):
    """A time that congestion control defers, and a critical event brings forward."""

    def __init__(self, rng: np.random.Generator, now: float, interval_s: float) -> None:
        """Start at a random time in the first interval: cars switched on together differ.

        Args:
            rng: draws that time.
            now: the present time.
            interval_s: the least one.
        """
        self._rng = rng
        self._is_critical = False
        self._least_interval_s = interval_s
        self._draw(now, interval_s)

    def begin_anew(self, now: float) -> None:
        """Be due next at a random time: the phase tells nothing of the last pseudonym's."""
        self._draw(now, self._least_interval_s)

    def _draw(self, now: float, within_s: float) -> None:
        self._due_at = now + float(self._rng.uniform(0.0, within_s))

    def receive_event_flags(self, is_critical: bool, now: float) -> None:
        """Take whether a critical event is present; the start of one makes a message due."""
        if is_critical and not self._is_critical:
            self._due_at = now
        self._is_critical = is_critical

    def hold_until(self, at: float) -> None:
        """Be due no earlier than at `at`, unless there is a critical event."""
        if not self._is_critical:
            self._due_at = max(self._due_at, at)

    def is_due(self, now: float) -> bool:
        """Whether it has come."""
        return self._due_at <= now

    @override
    def get_timer(self) -> float:
        """Return when the next message is due."""
        return self._due_at
