"""Alarms of one cause, one for each vehicle: a second threat is not hidden behind the first."""

from collections.abc import Iterable, Iterator
from dataclasses import replace
from heapq import nlargest

from onboard.risk.alarm import NOTHING, RELEASE_S, Alarm, Assessment, Cause, Hysteresis, Level

MOST_VEHICLES = 4
"""Vehicles of one cause that are assessed as alarms at a time: a driver cannot look at more."""


def urgency(assessment: Assessment) -> tuple[int, float]:
    """Return the key by which assessments of one cause are ordered."""
    return assessment.level.rank, assessment.value


class VehicleAlarms:
    """Alarms of one cause, with hysteresis for each vehicle."""

    def __init__(self, cause: Cause) -> None:
        """Start without alarms.

        Args:
            cause: of the alarms.
        """
        self.cause = cause
        self._of: dict[str, Hysteresis] = {}
        """By name of the vehicle; those without an alarm are dropped."""

    def receive(self, assessments: Iterable[Assessment], now: float) -> Iterator[Alarm]:
        """Take the assessments of all vehicles, at most one of each; vehicles without one are safe.

        Yields:
            The alarms whose level changes, the most urgent first.
        """
        raised = (each for each in assessments if each.level is not Level.NONE)
        worst = nlargest(MOST_VEHICLES, raised, key=urgency)
        present = {each.vehicle: each for each in worst}
        for vehicle in [*present, *(name for name in self._of if name not in present)]:
            hysteresis = self._of.setdefault(vehicle, Hysteresis(self.cause, RELEASE_S))
            alarm = hysteresis.receive(present.get(vehicle, NOTHING), now)
            if alarm is None:
                continue
            if alarm.level is Level.NONE:
                del self._of[vehicle]
            yield replace(alarm, vehicle=vehicle)
