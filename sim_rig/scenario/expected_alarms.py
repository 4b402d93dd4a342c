"""Expected alarms and perceived objects of a scenario.

Unlike the entries in `expectations.py`, these compare with ground truth (`ground_truth.py`), and so
may refer to cars that are not equipped.
"""

from collections.abc import Iterator
from typing import Annotated, Literal, Self

from pydantic import AfterValidator, Field, model_validator
from typing_extensions import override

from onboard.risk.alarm import Cause, Level
from onboard.risk.alarm_table import known_cause
from sim_rig.run_log.ground_truth import MatchedObject, match_object, perceived_objects, touch_s
from sim_rig.run_log.run_log import Record, RunLog
from sim_rig.scenario.expectation import Expected
from sim_rig.scenario.field_types import CarName, Seconds

KnownCause = Annotated[Cause, AfterValidator(known_cause)]
Source = Literal["bsm", "sensor", "shared"]
ANY_SOURCE: tuple[Source, ...] = ("bsm", "sensor", "shared")


class AlarmExpected(Expected):
    """A car raises an alarm of one cause, about the right car, and early enough."""

    what: Literal["alarm"]
    car: CarName
    cause: KnownCause
    level: Level = Level.WARNING
    of: CarName | None = None
    """The car that the alarm is about."""
    source: Source | None = None
    """Object source of that car."""
    from_s: Seconds
    by_s: Seconds
    least_lead_s: float | None = Field(default=None, gt=0.0, le=60.0)
    """Least time from the alarm to the contact of the two cars; neither brakes for the alarm. Needs
    `of`."""

    @model_validator(mode="after")
    def _touches_a_car(self) -> Self:
        if self.least_lead_s is not None and self.of is None:
            raise ValueError("least_lead_s needs of: the car that is touched")
        return self

    @override
    def cars_used(self) -> Iterator[str]:
        yield self.car
        if self.of is not None:
            yield self.of

    @override
    def cars_traced(self) -> Iterator[str]:
        yield self.car

    @override
    def check(self, log: RunLog) -> Iterator[str]:
        alarms = [
            record
            for record in log.of(self.car, "alarm", self.from_s, self.by_s, cause=self.cause)
            if Level(record["level"]).rank >= self.level.rank
        ]
        if not alarms:
            yield f"{self.car} raises no {self.level} ({self.cause}) until {self.by_s:g} s"
            return
        of = [self._of(log, record) for record in alarms]
        at_s = [log.at_s(record) for record, right in zip(alarms, of, strict=True) if right]
        if not at_s:
            reasons = [reason["what"] for record in alarms for reason in record["reasons"]]
            yield f"{self.car} is warned of {' and '.join(sorted(set(reasons)))}, not of {self.of}"
        elif self.least_lead_s is not None and self.of is not None:
            touch = touch_s(log, self.car, self.of)
            if touch is None:
                yield f"{self.car} and {self.of} never touch: no lead time"
            elif touch - at_s[0] < self.least_lead_s:
                yield (
                    f"{self.car} is warned of {self.of} {touch - at_s[0]:.2f} s before they touch,"
                    f" not {self.least_lead_s:g} s"
                )

    def _of(self, log: RunLog, alarm: Record) -> bool:
        """Whether the alarm is about the expected car, from the expected source."""
        at_s = log.at_s(alarm)
        for reason in alarm["reasons"]:
            source = reason["what"].partition(":")[2]
            matched = match_object(log, self.car, reason["name"], at_s) if source else None
            if self.of is not None and (matched is None or matched.true_car != self.of):
                continue
            if self.source in (None, source):
                return True
        return False


class NoAlarmExpected(Expected):
    """Some cars raise no alarm in an interval."""

    what: Literal["no_alarm"]
    cars: tuple[CarName, ...] = Field(min_length=1)
    causes: tuple[KnownCause, ...] | None = None
    """All if not given."""
    from_level: Level = Level.CAUTION
    """The lowest forbidden level."""
    from_s: Seconds = 0.0
    until_s: Seconds

    @override
    def cars_used(self) -> Iterator[str]:
        yield from self.cars

    @override
    def check(self, log: RunLog) -> Iterator[str]:
        for car in self.cars:
            for record in log.of(car, "alarm", self.from_s, self.until_s):
                level = Level(record["level"])
                is_meant = self.causes is None or record["cause"] in self.causes
                if is_meant and level.rank >= self.from_level.rank:
                    yield (
                        f"at {log.at_s(record):.2f} s {car} raises a {level} of {record['cause']},"
                        " and must not"
                    )


class SignalExpected(Expected):
    """A car knows at a time what the signal ahead shows, by its road-side unit."""

    what: Literal["signal_ahead"]
    car: CarName
    state: str
    """As in J2735: `stop_and_remain`, `protected_movement_allowed`, ..."""
    at_s: Seconds

    @override
    def cars_used(self) -> Iterator[str]:
        yield self.car

    @override
    def check(self, log: RunLog) -> Iterator[str]:
        # Daemons receive the unit before the scenario begins.
        shown = [each["states"] for each in log.of(self.car, "signal_ahead", until_s=self.at_s)]
        if shown[-1:] != [[self.state]]:
            yield f"{self.car} knows no signal of {self.state} at {self.at_s:g} s, but {shown[-1:]}"


class PerceptionExpected(Expected):
    """Perceived objects of one car that are another car, in an interval."""

    car: CarName
    of: CarName
    from_s: Seconds
    until_s: Seconds

    @override
    def cars_used(self) -> Iterator[str]:
        yield from (self.car, self.of)

    @override
    def cars_traced(self) -> Iterator[str]:
        yield self.car


class PerceivedExpected(PerceptionExpected):
    """Every list of perceived objects of `car` has one object for `of`, at its true position."""

    what: Literal["perceives"]
    sources: tuple[Source, ...] = ANY_SOURCE
    within_m: float = Field(default=3.0, gt=0.0, le=6.0)

    @override
    def check(self, log: RunLog) -> Iterator[str]:
        snapshots = list(perceived_objects(log, self.car, self.from_s, self.until_s))
        if not snapshots:
            yield f"{self.car} traces no objects from {self.from_s:g} s to {self.until_s:g} s"
        for snapshot in snapshots:
            found = [matched for matched in snapshot if matched.true_car == self.of]
            yield from self._compare(found)
            if not found:
                yield f"{self.car} does not always perceive {self.of}"
                return

    def _compare(self, found: list[MatchedObject]) -> Iterator[str]:
        if len(found) > 1:
            yield f"at {found[0].at_s:.2f} s {self.car} has {len(found)} objects for {self.of}"
        for matched in found:
            if matched.source not in self.sources:
                yield f"at {matched.at_s:.2f} s {self.car} perceives {self.of} by {matched.source}"
            if matched.error_m > self.within_m:
                yield (
                    f"at {matched.at_s:.2f} s {self.car} perceives {self.of}"
                    f" {matched.error_m:.1f} m off"
                )


class NotPerceivedExpected(PerceptionExpected):
    """A car has no perceived object for another car.

    `of` may be `car` itself: entries of others about it must not become a perceived object.
    """

    what: Literal["does_not_perceive"]

    @override
    def check(self, log: RunLog) -> Iterator[str]:
        for snapshot in perceived_objects(log, self.car, self.from_s, self.until_s):
            for matched in snapshot:
                if matched.true_car == self.of:
                    at = f"at {matched.at_s:.2f} s"
                    yield f"{at} {self.car} perceives {self.of} by {matched.source}"
