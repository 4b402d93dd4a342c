"""CPM schedule: when a CPM may be sent; which vehicles are due is decided where they are known."""

import numpy as np

from onboard.bsm_transmission.due_time import DueTime

MINIMUM_INTERVAL_S = 0.1
"""T_GenCpmMin (TS 103 324 V2.1.1, 6.1.3)."""


class CpmSchedule(DueTime):
    """Comes up every `MINIMUM_INTERVAL_S`."""

    def __init__(self, rng: np.random.Generator, now: float) -> None:
        """See `DueTime`."""
        super().__init__(rng, now, MINIMUM_INTERVAL_S)

    def take_due(self, now: float) -> bool:
        """Return whether it has come; the next follows after `MINIMUM_INTERVAL_S`."""
        if not self.is_due(now):
            return False
        self._due_at = now + MINIMUM_INTERVAL_S
        return True
