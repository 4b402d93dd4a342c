"""What a scenario expects of alarms, and of what each car knows about the others.

Unlike the entries in `expectations.py`, these look at where the cars truly were (`truth.py`), and
so may speak of cars that are not equipped.
"""

from collections.abc import Iterator
from typing import Literal

from pydantic import Field
from typing_extensions import override

from onboard.risk.alarm import Cause, Level
from sim_rig.run_log.ground_truth import Known, meant_by, perceived_objects, touch_s
from sim_rig.run_log.run_log import Record, RunLog
from sim_rig.scenario.expectation import Expected
from sim_rig.scenario.field_types import CarName, Seconds

Source = Literal["bsm", "sensor", "shared"]
ANY_SOURCE: tuple[Source, ...] = ("bsm", "sensor", "shared")


class AlarmExpected(Expected):
    """A car is warned for a cause, of the right car, and early enough."""

    what: Literal["alarm"]
    car: CarName
    cause: Cause
    level: Level = Level.WARNING
    of: CarName | None = None
    """The car that it is warned of."""
    source: Source | None = None
    """How it knows of that car."""
    from_s: Seconds
    by_s: Seconds
    least_lead_s: float | None = Field(default=None, gt=0.0, le=60.0)
    """Before the two cars touch; neither brakes for the warning."""

    @override
    def cars_named(self) -> Iterator[str]:
        yield self.car
        if self.of is not None:
            yield self.of

    @override
    def cars_telling(self) -> Iterator[str]:
        yield self.car

    @override
    def check(self, log: RunLog) -> Iterator[str]:
        alarms = [
            record
            for record in log.of(self.car, "alarm", self.from_s, self.by_s, cause=self.cause.value)
            if Level(record["level"]).rank >= self.level.rank
        ]
        if not alarms:
            yield f"{self.car} is not warned ({self.cause}) until {self.by_s:g} s"
            return
        of = [self._of(log, record) for record in alarms]
        at_s = [log.at_s(record) for record, right in zip(alarms, of, strict=True) if right]
        if not at_s:
            reasons = [reason["what"] for record in alarms for reason in record["reasons"]]
            yield f"{self.car} is warned of {' and '.join(sorted(set(reasons)))}, not of {self.of}"
        elif self.least_lead_s is not None and self.of is not None:
            touch = touch_s(log, self.car, self.of)
            if touch is None:
                yield f"{self.car} and {self.of} never touch: there is nothing to be ahead of"
            elif touch - at_s[0] < self.least_lead_s:
                yield (
                    f"{self.car} is warned of {self.of} {touch - at_s[0]:.2f} s before they touch,"
                    f" not {self.least_lead_s:g} s"
                )

    def _of(self, log: RunLog, alarm: Record) -> bool:
        """Whether the alarm is about the expected car, known as expected."""
        at_s = log.at_s(alarm)
        for reason in alarm["reasons"]:
            source = reason["what"].partition(":")[2]
            known = meant_by(log, self.car, reason["name"], at_s) if source else None
            if self.of is not None and (known is None or known.meant != self.of):
                continue
            if self.source in (None, source):
                return True
        return False


class NoAlarmExpected(Expected):
    """Some cars raise no alarm for a while."""

    what: Literal["no_alarm"]
    cars: tuple[CarName, ...] = Field(min_length=1)
    causes: tuple[Cause, ...] = tuple(Cause)
    from_level: Level = Level.CAUTION
    """The lowest that must not be reached."""
    from_s: Seconds = 0.0
    until_s: Seconds

    @override
    def cars_named(self) -> Iterator[str]:
        yield from self.cars

    @override
    def check(self, log: RunLog) -> Iterator[str]:
        for car in self.cars:
            for record in log.of(car, "alarm", self.from_s, self.until_s):
                level = Level(record["level"])
                if record["cause"] in self.causes and level.rank >= self.from_level.rank:
                    yield (
                        f"at {log.at_s(record):.2f} s {car} raises a {level} of {record['cause']},"
                        " and must not"
                    )


class KnowledgeExpected(Expected):
    """What a car tells that it knows of another one, for a while."""

    car: CarName
    of: CarName
    from_s: Seconds
    until_s: Seconds

    @override
    def cars_named(self) -> Iterator[str]:
        yield from (self.car, self.of)

    @override
    def cars_telling(self) -> Iterator[str]:
        yield self.car


class KnowsExpected(KnowledgeExpected):
    """Whenever a car tells what it knows, a certain car is among it, and where it truly is."""

    what: Literal["perceives"]
    sources: tuple[Source, ...] = ANY_SOURCE
    within_m: float = Field(default=3.0, gt=0.0, le=6.0)

    @override
    def check(self, log: RunLog) -> Iterator[str]:
        tellings = list(perceived_objects(log, self.car, self.from_s, self.until_s))
        if not tellings:
            yield f"{self.car} tells nothing from {self.from_s:g} s to {self.until_s:g} s"
        for telling in tellings:
            found = [known for known in telling if known.meant == self.of]
            yield from self._compare(found)
            if not found:
                yield f"{self.car} does not know {self.of} in all tellings"
                return

    def _compare(self, found: list[Known]) -> Iterator[str]:
        if len(found) > 1:
            yield f"at {found[0].at_s:.2f} s {self.car} takes {self.of} for {len(found)} cars"
        for known in found:
            if known.source not in self.sources:
                yield f"at {known.at_s:.2f} s {self.car} knows {self.of} by {known.source}"
            if known.off_m > self.within_m:
                yield (
                    f"at {known.at_s:.2f} s {self.car} knows {self.of} {known.off_m:.1f} m"
                    " from where it is"
                )


class KnowsNotExpected(KnowledgeExpected):
    """A car does not know another one.

    That may be the car itself: what others tell of it must not become a car of its own.
    """

    what: Literal["does_not_perceive"]

    @override
    def check(self, log: RunLog) -> Iterator[str]:
        for telling in perceived_objects(log, self.car, self.from_s, self.until_s):
            for known in telling:
                if known.meant == self.of:
                    yield f"at {known.at_s:.2f} s {self.car} knows {self.of} by {known.source}"
