"""The interface of all cores: state machines without I/O that are given inputs and the time."""

import math

from onboard.trace.trace_line import Event


class Core:
    """A core without timers and events; a subclass overrides what it has."""

    def get_timer(self) -> float:
        """Return when `handle_timer` is next due; `math.inf` when nothing is planned."""
        return math.inf

    def handle_timer(self, now: float) -> None:
        """Do what is due at `now`."""

    def next_event(self) -> Event | None:
        """Remove and return the oldest event; `None` when there is none."""
        return None
