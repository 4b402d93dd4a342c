"""The alarms of one cause that are on: one at a time, or one for each vehicle."""

from collections.abc import Iterable, Iterator
from dataclasses import replace
from heapq import nlargest
from operator import attrgetter

from onboard.risk.alarm import NOTHING, RELEASE_S, Alarm, Assessment, Cause, Hysteresis, Level

MOST_VEHICLES = 4
"""Vehicles of one cause that are assessed as alarms at a time: a driver cannot look at more."""


class OneAlarm:
    """One alarm at a time, about the most urgent danger."""

    def __init__(self, cause: Cause) -> None:
        """Start without an alarm; `cause` is that of all alarms."""
        self._hysteresis = Hysteresis(cause, RELEASE_S)

    def kept(self, admitted: Iterable[Assessment]) -> list[Assessment]:
        """Return the first of the assessments, `NOTHING` without any; no other is drawn."""
        return [next(iter(admitted), NOTHING)]

    def receive_assessments(self, kept: Iterable[Assessment], now: float) -> Iterator[Alarm]:
        """Take what `kept` has returned; yields the alarm if its level changes."""
        for assessment in kept:
            alarm = self._hysteresis.receive_assessment(assessment, now)
            if alarm is not None:
                yield alarm


class VehicleAlarms:
    """An alarm for each vehicle: a second threat is not hidden behind the first."""

    def __init__(self, cause: Cause) -> None:
        """Start without alarms; `cause` is that of all alarms."""
        self._cause = cause
        self._of: dict[str, Hysteresis] = {}
        """By name of the vehicle; those without an alarm are dropped."""

    def kept(self, admitted: Iterable[Assessment]) -> list[Assessment]:
        """Return all assessments."""
        return list(admitted)

    def receive_assessments(self, kept: Iterable[Assessment], now: float) -> Iterator[Alarm]:
        """Take the assessments of all vehicles, at most one of each; vehicles without one are safe.

        Yields:
            The alarms whose level changes, the most urgent first.
        """
        raised = [each for each in kept if each.level is not Level.NONE]
        if not raised and not self._of:
            return
        worst = nlargest(MOST_VEHICLES, raised, key=attrgetter("urgency"))
        present = {each.vehicle: each for each in worst}
        for vehicle in [*present, *(name for name in self._of if name not in present)]:
            hysteresis = self._of.setdefault(vehicle, Hysteresis(self._cause, RELEASE_S))
            alarm = hysteresis.receive_assessment(present.get(vehicle, NOTHING), now)
            if alarm is None:
                continue
            if alarm.level is Level.NONE:
                del self._of[vehicle]
            yield replace(alarm, vehicle=vehicle)
