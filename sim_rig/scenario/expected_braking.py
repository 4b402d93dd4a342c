"""Expected requests to brake, and contacts that do not happen."""

from collections.abc import Iterator
from typing import Literal

from pydantic import Field
from typing_extensions import override

from sim_rig.run_log.ground_truth import touch_s
from sim_rig.run_log.run_log import RunLog
from sim_rig.scenario.expectation import Expected
from sim_rig.scenario.field_types import CarName, Seconds


class BrakeRequestExpected(Expected):
    """A car's daemon requests braking in an interval, and not before."""

    what: Literal["brake_request"]
    car: CarName
    from_s: Seconds
    by_s: Seconds
    at_least_m_s2: float = Field(default=0.1, gt=0.0, le=20.0)
    """Of the hardest braking requested by `by_s`."""

    @override
    def cars_used(self) -> Iterator[str]:
        yield self.car

    @override
    def check(self, log: RunLog) -> Iterator[str]:
        found = list(log.of(self.car, "brake_request", until_s=self.by_s))
        hardest_m_s2 = max((each["deceleration_m_s2"] for each in found), default=0.0)
        if hardest_m_s2 < self.at_least_m_s2:
            yield (
                f"{self.car} requests at most {hardest_m_s2:.1f} m/s^2 by {self.by_s:g} s, not"
                f" {self.at_least_m_s2:g}"
            )
        elif log.at_s(found[0]) < self.from_s:
            yield f"{self.car} requests braking at {log.at_s(found[0]):.2f} s, and must not yet"


class NoContactExpected(Expected):
    """Two cars never touch."""

    what: Literal["no_contact"]
    car: CarName
    of: CarName

    @override
    def cars_used(self) -> Iterator[str]:
        yield from (self.car, self.of)

    @override
    def cars_traced(self) -> Iterator[str]:
        yield from ()

    @override
    def check(self, log: RunLog) -> Iterator[str]:
        touch = touch_s(log, self.car, self.of)
        if touch is not None:
            yield f"{self.car} and {self.of} touch at {touch:.1f} s"
