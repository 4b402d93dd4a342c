"""The clock of a live scenario: cars drive up to its start, so that places and speeds agree."""

import math

RUN_UP_S = 3.0
"""Longer than trackers keep measurements (2.0 s): those of cars that waited are gone."""


class ScenarioClock:
    """Time of a scenario, which waits at the beginning of its run-up for its start."""

    def __init__(self, run_up_s: float) -> None:
        """Wait.

        Args:
            run_up_s: time before the start in which the cars drive.
        """
        self.run_up_s = run_up_s
        self.start_s = math.inf
        """When it starts, at least `run_up_s` ahead when it is set; infinite while it waits."""

    def at_s(self, now: float) -> float:
        """Return the time since the start, s; negative before it."""
        return max(now - self.start_s, -self.run_up_s)
