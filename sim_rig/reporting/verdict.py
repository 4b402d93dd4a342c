"""Verdict of a run: what failed, and what cannot be judged and why."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from enum import IntEnum
from itertools import product

from sim_rig.run_log.run_log import RunLog
from sim_rig.scenario.expectation import Expected
from sim_rig.scenario.schema import Scenario


class Outcome(IntEnum):
    """Outcome of a run; the value is the exit code of `sim-rig run` (2: an error of the user)."""

    PASSED = 0
    FAILED = 1
    INVALID = 3


def worst(outcomes: Iterable[Outcome]) -> Outcome:
    """Return the outcome of several runs: one that could not be judged hides no failure.

    Args:
        outcomes: of the runs, one at least.
    """
    return max(outcomes, key=[Outcome.PASSED, Outcome.INVALID, Outcome.FAILED].index)


@dataclass(frozen=True, slots=True)
class Verdict:
    """All sentences of a verdict."""

    failures: tuple[str, ...]
    """One for each deviation from the expectations."""
    invalid: tuple[str, ...]
    """One for each reason why a box, or an expectation, could not be judged."""
    was_late: bool
    """Whether the rig, or in a run that did not meet all expectations a daemon, was too late."""
    not_judged: tuple[str, ...] = ()
    """One for each expectation that a box without a recording cannot be judged by."""

    @property
    def outcome(self) -> Outcome:
        """Lateness makes the run invalid, else one failure makes it fail."""
        if self.failures and not self.was_late:
            return Outcome.FAILED
        return Outcome.INVALID if self.invalid else Outcome.PASSED


def verdict(scenario: Scenario, log: RunLog) -> Verdict:
    """Judge a run.

    An expectation is judged with the clock of each box at both ends of its uncertainty too; where
    the results differ, nothing can be said. A late rig makes the run of a box invalid. Of a run on
    the rig's computer alone, what was met in spite of lateness counts; what was not met is excused
    by pictures, radio, ECUs or daemons that were measured to be late, and by nothing else: neither
    the load of the computer nor that of the run itself says that anything came late.
    """
    failures: list[str] = []
    invalid = [f"{car}: not judged: {why}" for car, why in log.unjudged.items()]
    not_judged: list[str] = []
    for number, entry in enumerate(scenario.expect):
        judged = set(entry.cars_judged())
        if log.unjudged.keys() & judged:
            continue
        if (silent := log.by_messages & judged) and not entry.needs_messages_only:
            silent_cars = ", ".join(sorted(silent))
            not_judged.append(f"expect.{number} ({entry.what}): {silent_cars} has no recording")
            continue
        results = [list(entry.check(possible)) for possible in _possible(log, entry)]
        if all(bool(found) == bool(results[0]) for found in results):
            failures += results[0]
        else:
            sentence = next(found[0] for found in results if found)
            invalid.append(f"the clock is not known well enough to say whether {sentence}")
    if not_judged and len(not_judged) == len(scenario.expect):
        invalid.append("no expectation can be judged by the messages of a box")
    late = list(_lateness(log, is_failed=bool(failures)))
    return Verdict(tuple(failures), (*invalid, *late), bool(late), tuple(not_judged))


def _lateness(log: RunLog, *, is_failed: bool) -> Iterator[str]:
    """Yield a sentence for everything whose lateness keeps the run from being judged."""
    rig = log.lateness if is_failed or _has_boxes(log) else ()
    daemons = log.daemon_lateness if is_failed else ()
    for subject, lines in (("the rig was", rig), ("the daemons were", daemons)):
        for each in lines:
            if each.is_too_late:
                yield (
                    f"{subject} late: {each.what} p99 {each.p99_s * 1e3:.0f} ms, limit"
                    f" {each.limit_s * 1e3:.0f} ms, {each.misses} of {each.n} missed"
                )


def _possible(log: RunLog, entry: Expected) -> Iterator[RunLog]:
    """Yield the log, and as it would be with clocks at the ends of their uncertainties."""
    yield log
    cars = [car for car in log.clocks if car in set(entry.cars_judged())]
    for signs in product((-1.0, 1.0), repeat=len(cars)):
        moved = log
        for car, sign in zip(cars, signs, strict=True):
            uncertainty_s = max(clock.uncertainty_s for clock in log.clocks[car])
            moved = moved.shifted(car, sign * uncertainty_s)
        if cars:
            yield moved


def _has_boxes(log: RunLog) -> bool:
    return bool(log.clocks or log.unjudged or log.by_messages)
