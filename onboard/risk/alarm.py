"""Alarms: cause, level, the observations behind them, and hysteresis."""

from dataclasses import dataclass
from enum import StrEnum
from typing import ClassVar

from onboard.tracking.perceived_object import PerceivedObject

RELEASE_S = 1.0
"""Time for which a lower level must last before an alarm goes down to it: alarms do not flicker."""


class Cause(StrEnum):
    """Cause of an alarm."""

    LCCA = "lcca"
    """A member ahead in the warning group brakes hard (LCCA)."""
    FCW = "fcw"
    """Forward collision warning: the gap to the lead vehicle closes too fast."""
    EEBL = "eebl"
    """Emergency electronic brake lights: a remote vehicle ahead reports hard braking."""
    IMA = "ima"
    """Intersection movement assist: paths cross, and P_C is high."""
    LTA = "lta"
    """Left turn assist: the host turns left across the path of an oncoming vehicle."""


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
    """Required deceleration in m/s^2, or P_C."""
    reasons: tuple[AlarmReason, ...]
    vehicle: str = ""
    """Name of the vehicle that it is about; empty for a cause with one alarm at a time."""


@dataclass(frozen=True, slots=True)
class Alarm:
    """Change of the level of one cause, or of one vehicle; `NONE` ends the alarm."""

    kind: ClassVar[str] = "alarm"
    stamp_s: float
    cause: Cause
    level: Level
    value: float
    """Required deceleration in m/s^2 (for IMA and LTA, P_C from 0 to 1) when the level changed."""
    reasons: tuple[AlarmReason, ...]
    """Observations that raised it; empty when it ends."""
    vehicle: str = ""
    """Name of the vehicle that it is about; empty for a cause with one alarm at a time."""


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

    def receive(self, assessment: Assessment, now: float) -> Alarm | None:
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
