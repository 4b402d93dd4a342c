"""Alarms: cause, level, the observations behind them, and hysteresis."""

from dataclasses import dataclass
from enum import StrEnum
from typing import ClassVar, NewType

from onboard.tracking.perceived_object import PerceivedObject

RELEASE_S = 1.0
"""Time for which a lower level must last before an alarm goes down to it: alarms do not flicker."""


Cause = NewType("Cause", str)
"""Name of an application, which all its alarms have as their cause (`alarm_table.py`)."""

AlarmKey = tuple[Cause, str]
"""Cause, and name of the vehicle; empty for a cause with one alarm at a time."""


class Level(StrEnum):
    """Urgency of an alarm."""

    NONE = "none"
    CAUTION = "caution"
    WARNING = "warning"

    @property
    def rank(self) -> int:
        """0, 1, 2."""
        return _RANKS[self]


_RANKS = {level: rank for rank, level in enumerate(Level)}


@dataclass(frozen=True, slots=True)
class AlarmReason:
    """An observation that an alarm rests on."""

    what: str
    """The `kind` of the observation."""
    name: str
    """Of the vehicle that it is about, or of the source."""
    age_s: float
    """When the alarm was raised."""


@dataclass(frozen=True, slots=True)
class Assessment:
    """Result of one evaluation of one cause, before hysteresis."""

    level: Level
    value: float
    """What its cause measures: required deceleration in m/s^2, or a probability."""
    reasons: tuple[AlarmReason, ...]
    vehicle: str = ""
    """Name of the vehicle that it is about; empty for a cause with one alarm at a time."""
    is_test: bool = False
    """Whether nothing is dangerous: somebody tests the alarm."""

    @property
    def urgency(self) -> tuple[int, bool, float]:
        """The key by which assessments of one cause are ranked."""
        return self.level.rank, not self.is_test, self.value


@dataclass(frozen=True, slots=True)
class Alarm:
    """Change of the level of one cause, or of one vehicle; `NONE` ends the alarm."""

    kind: ClassVar[str] = "alarm"
    stamp_s: float
    cause: Cause
    level: Level
    value: float
    """That of the assessment when the level changed."""
    reasons: tuple[AlarmReason, ...]
    """Observations that raised it; empty when it ends."""
    vehicle: str = ""
    """Name of the vehicle that it is about; empty for a cause with one alarm at a time."""

    @property
    def key(self) -> AlarmKey:
        """Which alarm it changes."""
        return self.cause, self.vehicle


NOTHING = Assessment(Level.NONE, 0.0, ())


def object_reason(other: PerceivedObject, own: PerceivedObject) -> AlarmReason:
    """Return the reason of an alarm about a perceived object; the older of both states counts."""
    return AlarmReason(
        f"{other.kind}:{other.source.value}", other.name, max(other.age_s, own.age_s)
    )


class Hysteresis:
    """One cause: up at once to a higher level, down after `release_s` of lower ones."""

    def __init__(self, cause: Cause, release_s: float) -> None:
        """Start without an alarm.

        Args:
            cause: of its alarms.
            release_s: time for which a lower level must last.
        """
        self._cause = cause
        self._release_s = release_s
        self._level = Level.NONE
        self._last_at: dict[Level, float] = {}
        """When each level or a higher one was last assessed."""

    def receive_assessment(self, assessment: Assessment, now: float) -> Alarm | None:
        """Take an assessment; returns an alarm if the level changes."""
        for level in (Level.CAUTION, Level.WARNING):
            if assessment.level.rank >= level.rank:
                self._last_at[level] = now
        if assessment.level.rank > self._level.rank:
            self._level = assessment.level
            return Alarm(now, self._cause, self._level, assessment.value, assessment.reasons)
        if self._level is Level.NONE or now - self._last_at[self._level] < self._release_s:
            return None
        lasting = max(
            (at for at, when in self._last_at.items() if now - when < self._release_s),
            key=lambda at: at.rank,
            default=Level.NONE,
        )
        self._level = lasting
        reasons = assessment.reasons if lasting is not Level.NONE else ()
        return Alarm(now, self._cause, lasting, assessment.value, reasons)
