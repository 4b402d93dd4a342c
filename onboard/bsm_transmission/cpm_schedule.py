"""CPM schedule: when a CPM may be sent; which vehicles are due is decided where they are known."""

import math

import numpy as np
from typing_extensions import override

from onboard.core import Core

MINIMUM_INTERVAL_S = 0.1
"""T_GenCpmMin (TS 103 324 V2.1.1, 6.1.3)."""


class CpmSchedule(Core):
    """Comes up every `MINIMUM_INTERVAL_S`."""

    def __init__(self, rng: np.random.Generator, now: float) -> None:
        """Start at a random time in the first interval: cars switched on together differ.

        Args:
            rng: draws that time.
            now: the present time.
        """
        self._rng = rng
        self._due_at = -math.inf
        self.begin_anew(now)

    def begin_anew(self, now: float) -> None:
        """Come up next at a random time: the phase tells nothing of the last pseudonym's."""
        self._due_at = now + float(self._rng.uniform(0.0, MINIMUM_INTERVAL_S))

    def hold_until(self, at: float) -> None:
        """Come up no earlier than at `at`."""
        self._due_at = max(self._due_at, at)

    @override
    def get_timer(self) -> float:
        """Return the next time."""
        return self._due_at

    def take_due(self, now: float) -> bool:
        """Return whether it has come; the next follows after `MINIMUM_INTERVAL_S`."""
        if now < self._due_at:
            return False
        self._due_at = now + MINIMUM_INTERVAL_S
        return True
