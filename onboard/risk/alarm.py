"""What the driver is to be told, why, and from which observations."""

from dataclasses import dataclass
from enum import StrEnum
from typing import ClassVar


class Cause(StrEnum):
    """Why; at most one alarm of each at a time."""

    LCCA = "lcca"
    """A car ahead in the warning group brakes hard (LCCA)."""
    FCW = "fcw"
    EEBL = "eebl"
    """A car ahead on the own path says so by BSM (EEBL)."""
    IMA = "ima"


class Level(StrEnum):
    """How urgent."""

    NONE = "none"
    CAUTION = "caution"
    WARNING = "warning"

    @property
    def rank(self) -> int:
        """0, 1, 2."""
        return tuple(Level).index(self)


@dataclass(frozen=True, slots=True)
class AlarmReason:
    """An observation that an alarm rests on."""

    what: str
    """The `kind` of the observation."""
    name: str
    """Of the car that it is about, or of the source."""
    age_s: float
    """When the alarm was raised."""


@dataclass(frozen=True, slots=True)
class Assessment:
    """What is seen of one cause at one moment, before any hysteresis."""

    level: Level
    value: float
    """Braking needed in m/s^2, or P_C."""
    reasons: tuple[AlarmReason, ...]


@dataclass(frozen=True, slots=True)
class Alarm:
    """The level of one cause has changed; `NONE` ends the alarm."""

    kind: ClassVar[str] = "alarm"
    stamp_s: float
    cause: Cause
    level: Level
    value: float
    """Braking needed in m/s^2 (P_C from 0 to 1 for crossing paths) when the level changed."""
    reasons: tuple[AlarmReason, ...]
    """What raised it; empty when it ends."""


NOTHING = Assessment(Level.NONE, 0.0, ())


class Hysteresis:
    """One cause: up after `confirm_s` of a higher level, down after `release_s` of lower ones."""

    def __init__(self, cause: Cause, confirm_s: float, release_s: float) -> None:
        self._cause = cause
        self._confirm_s = confirm_s
        self._release_s = release_s
        self._level = Level.NONE
        self._higher_since: dict[Level, float] = {}
        self._held_at: dict[Level, float] = {}

    def receive(self, seen: Assessment, now: float) -> Alarm | None:
        """Take what is seen now; returns the alarm if its level changes."""
        for level in (Level.CAUTION, Level.WARNING):
            if seen.level.rank >= level.rank:
                self._higher_since.setdefault(level, now)
                self._held_at[level] = now
            else:
                self._higher_since.pop(level, None)
        confirmed = max(
            (at for at, since in self._higher_since.items() if now - since >= self._confirm_s),
            key=lambda at: at.rank,
            default=Level.NONE,
        )
        if confirmed.rank > self._level.rank:
            self._level = confirmed
            return Alarm(now, self._cause, confirmed, seen.value, seen.reasons)
        if self._level is Level.NONE or now - self._held_at[self._level] < self._release_s:
            return None
        lasting = max(
            (at for at, when in self._held_at.items() if now - when < self._release_s),
            key=lambda at: at.rank,
            default=Level.NONE,
        )
        self._level = lasting
        reasons = seen.reasons if lasting is not Level.NONE else ()
        return Alarm(now, self._cause, lasting, seen.value, reasons)
