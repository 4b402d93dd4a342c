"""The shape of a safety application: what it assesses is an alarm of one cause."""

from abc import ABC, abstractmethod
from collections.abc import Iterable
from typing import ClassVar

from onboard.observations import Discarded
from onboard.risk.alarm import Assessment, Cause
from onboard.risk.settings import RiskSettings
from onboard.risk.situation import Situation
from onboard.trace.trace_line import Event

Assessed = Iterable[Assessment | Discarded]
"""Of each danger an assessment, in any order; and what could not be used."""


class Application(ABC):
    """One application; `alarm_table.py` says how its alarms are shown and used."""

    cause: ClassVar[Cause]
    """Of its alarms."""
    takes: ClassVar[tuple[type[Event], ...]] = ()
    """Types of observations and events that it is given as they arrive, between assessments."""

    @abstractmethod
    def __init__(self, settings: RiskSettings) -> None:
        """Start at the beginning of a drive, with the thresholds in `settings`."""

    @abstractmethod
    def assess(self, situation: Situation) -> Assessed:
        """Assess all dangers of its kind, at 10 Hz."""

    def receive_event(self, event: Event, situation: Situation) -> Assessed:
        """Take one of `takes`, and assess again what it changes.

        Args:
            event: what has arrived.
            situation: at its arrival, without positions: `assess` alone is given these.
        """
        raise NotImplementedError(f"{type(self).__name__} takes no {event.kind}")
