"""Where the decisions of two runs of one scenario first differ, car by car and kind by kind.

Kinds are compared separately, so that an alarm of one run does not hide that the group is the same.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import groupby, zip_longest

from sim_rig.run_log.run_log import Record, RunLog


@dataclass(frozen=True, slots=True)
class Decision:
    """A decision of a car: a change in its group, hard braking, a warning, an alarm."""

    at_s: float
    """Since the start of the scenario."""
    car: str
    what: str


@dataclass(frozen=True, slots=True)
class DecisionPair:
    """What two runs decided in turn; `None` where a run has no further one of that car."""

    one: Decision | None
    other: Decision | None

    @property
    def at_s(self) -> float:
        """The earlier time of the two."""
        return min(each.at_s for each in (self.one, self.other) if each is not None)


@dataclass(frozen=True, slots=True)
class RunComparison:
    """Two runs side by side."""

    decisions: int
    """Those that both made, within the tolerance, up to the first difference of each kind."""
    differences: tuple[DecisionPair, ...]
    """The first difference of each car and kind, in what was decided, or in when by more than the
    tolerance; the earliest first."""
    latest: DecisionPair | None
    """Of the decisions that both made, the one whose times differ most."""

    @property
    def first(self) -> DecisionPair | None:
        """The earliest difference; `None` if there is none."""
        return next(iter(self.differences), None)


def compare(one: RunLog, other: RunLog, within_s: float) -> RunComparison:
    """Compare the runs; cars without a trace in both are left out.

    Args:
        one: a run.
        other: another run of the same scenario.
        within_s: times of one decision may differ by this.
    """
    differences: list[DecisionPair] = []
    same: list[DecisionPair] = []
    for car in one.traces.keys() & other.traces.keys():
        of_one, of_other = _by_kind(one, car), _by_kind(other, car)
        for kind in of_one.keys() | of_other.keys():
            for pair in zip_longest(of_one.get(kind, ()), of_other.get(kind, ())):
                difference = DecisionPair(*pair)
                if not _is_one(difference, within_s):
                    differences.append(difference)
                    break
                same.append(difference)
    return RunComparison(
        len(same),
        tuple(sorted(differences, key=lambda each: each.at_s)),
        max(same, key=_apart_s, default=None),
    )


def _is_one(difference: DecisionPair, within_s: float) -> bool:
    if difference.one is None or difference.other is None:
        return False
    return difference.one.what == difference.other.what and _apart_s(difference) <= within_s


def _apart_s(difference: DecisionPair) -> float:
    assert difference.one is not None  # noqa: S101 (both are there where times are compared)
    assert difference.other is not None  # noqa: S101
    return abs(difference.one.at_s - difference.other.at_s)


def _by_kind(log: RunLog, car: str) -> dict[str, list[Decision]]:
    """Decisions of one car, by the kind of their records, and alarms by their cause."""
    decisions = sorted(_decisions(log, car), key=lambda each: each[0])
    return {
        kind: [decision for _, decision in some]
        for kind, some in groupby(decisions, key=lambda each: each[0])
    }


def _decisions(log: RunLog, car: str) -> Iterator[tuple[str, Decision]]:
    """Those of one car from the start of the scenario on; cautions depend on noise and are none."""
    is_braking = False
    for record in log.traces[car]:
        if record["kind"] == "hard_brake":
            begins, is_braking = not is_braking, not record["is_over"]
            if not (begins and is_braking):
                continue
        what, at_s = _what(log, record), log.at_s(record)
        if what is not None and at_s >= 0.0:
            yield _kind(record), Decision(at_s, car, what)


def _kind(record: Record) -> str:
    is_alarm = record["kind"] == "alarm"
    return f"alarm: {record['cause']}" if is_alarm else str(record["kind"]).partition("_")[0]


def _what(log: RunLog, record: Record) -> str | None:
    what: str | None = None
    match record:
        case {"kind": "transition", "cause": "refresh"}:
            pass
        case {"kind": "transition", "state": "member", "group_number": number, "leader_id": leader}:
            what = f"member {number} behind {log.name(leader)}"
        case {"kind": "transition", "state": state}:
            what = str(state)
        case {"kind": "hard_brake"}:
            what = "brakes hard"
        case {"kind": "warning", "origin_id": origin}:
            what = f"warned by {log.name(origin)}"
        case {"kind": "alarm", "cause": cause, "level": "warning"}:
            what = f"alarm: {cause}"
        case {"kind": "sensor_lost" | "sensor_recovered" as kind, "sensor": sensor}:
            what = f"{sensor} {kind.removeprefix('sensor_')}"
    return what
