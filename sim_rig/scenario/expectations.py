"""Expected results of a scenario, each with the check of a run log.

The `check` of an entry yields one sentence for each deviation.
"""

from collections.abc import Iterator, Mapping
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator
from typing_extensions import override

from onboard.observations import Sensor
from sim_rig.run_log.run_log import Record, RunLog
from sim_rig.scenario.expectation import Expected
from sim_rig.scenario.expected_alarms import (
    AlarmExpected,
    NoAlarmExpected,
    NotPerceivedExpected,
    PerceivedExpected,
    SignalExpected,
)
from sim_rig.scenario.expected_braking import BrakeRequestExpected, NoContactExpected
from sim_rig.scenario.field_types import CarName, Seconds


class StateExpected(Expected):
    """A car has a state in its warning group at `by_s`, and keeps it until `until_s`."""

    what: Literal["state"]
    car: CarName
    by_s: Seconds
    until_s: Seconds | None = None
    """End of the interval without a change; by default only `by_s` is checked."""
    state: Literal["regular", "leader", "member"]
    group_number: int | None = Field(default=None, ge=1)
    leader: CarName | None = None

    @override
    def cars_used(self) -> Iterator[str]:
        yield self.car
        if self.leader is not None:
            yield self.leader

    @override
    def check(self, log: RunLog) -> Iterator[str]:
        before = list(log.of(self.car, "transition", until_s=self.by_s))
        if before:
            yield from self._compare(log, before[-1], self.by_s)
        elif self.state != "regular":
            yield f"{self.car} is still regular at {self.by_s:g} s, not {self.state}"
        if self.until_s is not None:
            for record in log.of(self.car, "transition", self.by_s, self.until_s):
                yield from self._compare(log, record, log.at_s(record))

    def _compare(self, log: RunLog, record: Record, at_s: float) -> Iterator[str]:
        found = f"at {at_s:.2f} s {self.car} is {record['state']}"
        if record["state"] != self.state:
            yield f"{found}, not {self.state}"
            return
        if self.group_number is not None and record["group_number"] != self.group_number:
            yield f"{found} with number {record['group_number']}, not {self.group_number}"
        leader = log.name(record["leader_id"])
        if self.leader is not None and leader != self.leader:
            yield f"{found} led by {leader}, not {self.leader}"


class WarningExpected(Expected):
    """A car brakes hard; some cars raise an LCCA warning in time, others raise none."""

    what: Literal["warning"]
    braking: CarName
    at_s: tuple[Seconds, ...] = Field(min_length=1)
    """Times at which the brake is applied."""
    window_s: float = Field(default=3.0, gt=0.0, le=60.0)
    """Warnings and discards up to this long after `at_s` belong to that braking."""
    within_s: Mapping[CarName, float] = {}
    """For each car to be warned: the latest warning after `at_s`."""
    not_warned: tuple[CarName, ...] = ()
    discarded: Mapping[CarName, str] = {}
    """For each car that discards the warning: the reason."""

    @model_validator(mode="after")
    def _has_a_car(self) -> Self:
        if not (self.within_s or self.not_warned or self.discarded):
            raise ValueError("needs within_s, not_warned or discarded: without, it never fails")
        return self

    @override
    def cars_used(self) -> Iterator[str]:
        yield self.braking
        yield from self.within_s
        yield from self.not_warned
        yield from self.discarded

    @override
    def cars_judged(self) -> Iterator[str]:
        yield from (each for each in self.cars_used() if each != self.braking)

    @override
    def check(self, log: RunLog) -> Iterator[str]:
        for at_s in self.at_s:
            yield from self._check_one(log, at_s)

    def _check_one(self, log: RunLog, at_s: float) -> Iterator[str]:
        brake = f"{self.braking} braking at {at_s:g} s"
        for car, limit_s in self.within_s.items():
            delays_s = [log.at_s(record) - at_s for record in self.warnings(log, car, at_s)]
            if not delays_s:
                yield f"{car} is not warned of {brake}"
            elif delays_s[0] > limit_s:
                yield f"{car} is warned of {brake} after {delays_s[0]:.3f} s, not {limit_s:g} s"
        for car in self.not_warned:
            if any(self.warnings(log, car, at_s)):
                yield f"{car} is warned of {brake}, and must not"
        for car, reason in self.discarded.items():
            if not any(log.of(car, "discarded", at_s, at_s + self.window_s, reason=reason)):
                yield f"{car} discards nothing as {reason} upon {brake}"

    def warnings(self, log: RunLog, car: str, at_s: float) -> Iterator[Record]:
        """Yield the warnings of one car about one braking.

        Args:
            log: the run log.
            car: name of the warned car.
            at_s: time of the braking since the start of the scenario, s.
        """
        for record in log.of(car, "warning", at_s, at_s + self.window_s):
            if log.name(record["origin_id"]) == self.braking:
                yield record


class NoWarningExpected(Expected):
    """Some cars raise no LCCA warning in an interval."""

    what: Literal["no_warning"]
    cars: tuple[CarName, ...] = Field(min_length=1)
    from_s: Seconds
    until_s: Seconds

    @override
    def cars_used(self) -> Iterator[str]:
        yield from self.cars

    @override
    def check(self, log: RunLog) -> Iterator[str]:
        for car in self.cars:
            for record in log.of(car, "warning", self.from_s, self.until_s):
                yield f"at {log.at_s(record):.2f} s {car} raises a warning, and must not"


class SensorExpected(Expected):
    """A sensor is reported as lost, or as recovered, in time."""

    what: Literal["sensor_lost", "sensor_recovered"]
    car: CarName
    sensor: Sensor
    from_s: Seconds
    """When the sensor fails, or works again."""
    within_s: float = Field(gt=0.0, le=60.0)

    @override
    def cars_used(self) -> Iterator[str]:
        yield self.car

    @override
    def check(self, log: RunLog) -> Iterator[str]:
        reports = log.of(self.car, self.what, self.from_s, sensor=self.sensor.value)
        first = next(reports, None)
        if first is None:
            yield f"{self.car} never reports {self.what} of its {self.sensor}"
        elif log.at_s(first) - self.from_s > self.within_s:
            yield (
                f"{self.car} reports {self.what} of its {self.sensor}"
                f" {log.at_s(first) - self.from_s:.2f} s after {self.from_s:g} s,"
                f" later than {self.within_s:g} s"
            )


class CountedExpected(Expected):
    """How often something happens in an interval."""

    from_s: Seconds
    until_s: Seconds
    at_least: int = Field(default=0, ge=0)
    at_most: int | None = Field(default=None, ge=0)

    @model_validator(mode="after")
    def _has_a_limit(self) -> Self:
        if self.at_least == 0 and self.at_most is None:
            raise ValueError("needs at_least above 0, or at_most: without, it never fails")
        return self


class CountExpected(CountedExpected):
    """Number of records in the traces of some cars together."""

    what: Literal["sent", "received", "discarded"]
    cars: tuple[CarName, ...] = Field(min_length=1)
    message: str | None = None
    """The type of message, for `sent` and `received`."""
    reason: str | None = None
    """For `discarded`."""

    @override
    def cars_used(self) -> Iterator[str]:
        yield from self.cars

    @property
    @override
    def needs_messages_only(self) -> bool:
        return self.what == "sent"

    @override
    def check(self, log: RunLog) -> Iterator[str]:
        wanted = {"message": self.message, "reason": self.reason}
        fields = {name: value for name, value in wanted.items() if value is not None}
        count = sum(
            1
            for car in self.cars
            for _ in log.of(car, self.what, self.from_s, self.until_s, **fields)
        )
        what = " ".join([self.what, *fields.values()])
        if count < self.at_least:
            yield f"{what}: {count} times by {', '.join(self.cars)}, at least {self.at_least}"
        if self.at_most is not None and count > self.at_most:
            yield f"{what}: {count} times by {', '.join(self.cars)}, at most {self.at_most}"


class DeliveredExpected(CountedExpected):
    """Number of frames that the rig delivers from one car to another."""

    what: Literal["delivered"]
    sender: CarName
    car: CarName
    """The receiver."""
    user_priority: int | None = Field(default=None, ge=0, le=7)
    """Count only this user priority; BSMs have 5, or 7 with an event flag."""

    @override
    def cars_used(self) -> Iterator[str]:
        yield self.sender
        yield self.car

    @override
    def cars_judged(self) -> Iterator[str]:
        yield from ()

    @override
    def check(self, log: RunLog) -> Iterator[str]:
        count = sum(
            1
            for record in log.rig
            if record["kind"] == "delivered"
            and (record["car"], record["sender"]) == (self.car, self.sender)
            and self.user_priority in {None, record["user_priority"]}
            and self.from_s <= log.at_s(record) <= self.until_s
        )
        found = f"{self.car} receives {count} frames of {self.sender}"
        if count < self.at_least:
            yield f"{found}, at least {self.at_least}"
        if self.at_most is not None and count > self.at_most:
            yield f"{found}, at most {self.at_most}"


Expectation = Annotated[
    StateExpected
    | WarningExpected
    | NoWarningExpected
    | SensorExpected
    | CountExpected
    | DeliveredExpected
    | AlarmExpected
    | NoAlarmExpected
    | SignalExpected
    | PerceivedExpected
    | NotPerceivedExpected
    | BrakeRequestExpected
    | NoContactExpected,
    Field(discriminator="what"),
]
