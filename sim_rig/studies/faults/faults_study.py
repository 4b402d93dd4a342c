"""Effect of each fault: missed and false warnings, time to detection, and time to recovery.

Three cars drive in one lane, green ahead of red ahead of blue. Green brakes once before the fault,
three times during it and twice after it. All runs are in virtual time.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from statistics import fmean
from typing import Annotated, Any

from pydantic import AfterValidator, Field

from onboard.settings import Settings, parse_settings
from sim_rig.run_log.run_log import RunLog
from sim_rig.runs.virtual import run_virtual
from sim_rig.scenario.schema import Scenario
from sim_rig.scenario.setting_types import Several
from sim_rig.studies.campaigns.study import Axes, Case, Results, Study
from sim_rig.studies.faults.fault_cases import CASES, FROM_S, FaultCase

BRAKES_S = (7.0, 14.0, 19.0, 24.0, 34.0, 39.0)
END_S = 43.0
WARNED_WITHIN_S = 2.0
"""Time after the braking within which a warning counts; the rig's scenarios without faults allow
0.8 s."""
BRAKING_LASTS_S = 4.5
"""A warning or alarm later than this after a braking is false."""
POSITIONS = {"green": ("leader", 1), "red": ("member", 2), "blue": ("member", 3)}


def _fault(name: str) -> str:
    names = dict.fromkeys(case.fault for case in CASES)
    if name not in names:
        raise ValueError(f"no fault {name!r}; there are: {', '.join(names)}")
    return name


class FaultsSettings(Settings):
    """One run of the study."""

    seeds: Several[Annotated[int, Field(ge=0)]] = (1, 2, 3)
    """Each case is run with each of them."""
    cases: tuple[Annotated[str, AfterValidator(_fault)], ...] = ()
    """Names of faults; empty for all."""


@dataclass(frozen=True, slots=True)
class FaultOutcome:
    """Result of one run."""

    missed: float
    """Share of the warnings due during the fault that were missed."""
    missed_after: float
    """The same after the fault."""
    false: int
    """Warnings, and alarms of the highest level, without hard braking."""
    shown_s: float | None
    """Time from the fault to the first report of a lost sensor by the faulty car."""
    recovered_s: float | None
    """Time from the end of the fault until all group positions and sensors are as before; None if
    they are not when the run ends."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FaultyDrive(Case):
    """One case with one seed."""

    of: FaultCase
    seed: int


def axes(settings: FaultsSettings) -> Axes:
    """Every case of the selected faults, with every seed."""
    return {
        "of": [each for each in CASES if not settings.cases or each.fault in settings.cases],
        "seed": settings.seeds,
    }


@dataclass(frozen=True, slots=True)
class FaultLine:
    """One line of the table: a case with all seeds."""

    fault: str
    severity: str
    car: str
    missed: float
    missed_after: float
    false: float
    shown_s: float | str
    """Of the slowest run; runs without a value do not count."""
    recovered_s: float | str
    """Of the slowest run that recovered."""
    not_recovered: int


def run(_settings: FaultsSettings, case: FaultyDrive) -> FaultOutcome:
    """Run one case with one seed."""
    return outcome_of(run_virtual(scenario_of(case.of), case.seed), case.of)


def scenario_of(case: FaultCase) -> Scenario:
    """The scenario of a case."""
    leader_brakings = [
        ((at, 15.0), (at + 1.0, 9.0), (at + 1.6, 9.0), (at + 3.6, 15.0)) for at in BRAKES_S
    ]
    follower_brakings = [((at + 0.5, 15.0), (at + 2.5, 9.0), (at + 4.7, 15.0)) for at in BRAKES_S]
    leader, follower = (
        [point for braking in each for point in braking]
        for each in (leader_brakings, follower_brakings)
    )
    tree: dict[str, Any] = {
        "title": "Three cars brake in one lane, and one of them has a fault.",
        "seed": 1,
        "duration_s": END_S,
        "signed": case.signed,
        "radio": {"reach_m": 300.0} | case.radio,
        "gnss": {},
        "cars": {
            "green": {"plate": "GN417KB", "lane": 1, "start_m": 100.0, "speed_m_s": leader},
            "red": {"plate": "RD288HX", "lane": 1, "start_m": 83.5, "speed_m_s": follower},
            "blue": {"plate": "BL635TN", "lane": 1, "start_m": 67.0, "speed_m_s": follower},
        },
        "faults": [
            {"car": case.car, "from_s": FROM_S, "until_s": case.until_s} | fault
            for fault in case.faults
        ],
        "expect": [],
    }
    return parse_settings(tree, Scenario, case.fault)


def outcome_of(log: RunLog, case: FaultCase) -> FaultOutcome:
    """Evaluate one run of a case."""
    during = [at for at in BRAKES_S if FROM_S <= at < case.until_s]
    after = [at for at in BRAKES_S if at >= case.until_s]
    lost = [log.at_s(record) for record in log.of(case.car, "sensor_lost", from_s=FROM_S)]
    restored_s = max(_restored_s(log, name) for name in POSITIONS)
    return FaultOutcome(
        missed=_missed(log, during),
        missed_after=_missed(log, after),
        false=sum(1 for _ in _false(log)),
        shown_s=lost[0] - FROM_S if lost else None,
        recovered_s=None if restored_s >= END_S else max(0.0, restored_s - case.until_s),
    )


def _missed(log: RunLog, brakes_s: Sequence[float]) -> float:
    due = [(car, at) for car in ("red", "blue") for at in brakes_s]
    warned = (any(log.of(car, "warning", at, at + WARNED_WITHIN_S)) for car, at in due)
    return 1.0 - fmean(map(float, warned))


def _false(log: RunLog) -> Iterator[float]:
    """Times of the false warnings and alarms."""
    for car in POSITIONS:
        for record in log.of(car, "warning"):
            subject = log.name(record["origin_id"])
            if subject != "green" or not _brakes_at(log.at_s(record)):
                yield log.at_s(record)
        for record in log.of(car, "alarm", level="warning"):
            if not _brakes_at(log.at_s(record)):
                yield log.at_s(record)


def _brakes_at(at_s: float) -> bool:
    return any(brake_s <= at_s < brake_s + BRAKING_LASTS_S for brake_s in BRAKES_S)


def _restored_s(log: RunLog, car: str) -> float:
    """When the last wrong group position or lost sensor was restored; `END_S` if it never was."""
    ends = [FROM_S]
    for kinds, is_wrong in (
        (("transition",), partial(_has_wrong_position, car)),
        (("sensor_lost", "sensor_recovered"), _is_loss),
    ):
        state: dict[str, bool] = {}
        for record in log.traces[car]:
            if record["kind"] in kinds and log.at_s(record) >= FROM_S:
                subject = record.get("sensor", "")
                was_wrong, state[subject] = state.get(subject, False), is_wrong(record)
                if was_wrong and not state[subject]:
                    ends.append(log.at_s(record))
        if any(state.values()):
            return END_S
    return max(ends)


def _has_wrong_position(car: str, record: Any) -> bool:
    return (record["state"], record["group_number"]) != POSITIONS[car]


def _is_loss(record: Any) -> bool:
    return bool(record["kind"] == "sensor_lost")


def table(settings: FaultsSettings, rows: Sequence[FaultOutcome]) -> list[FaultLine]:
    """A line for each case."""
    seeds, cases = len(settings.seeds), axes(settings)["of"]
    return [_line(case, rows[at * seeds : (at + 1) * seeds]) for at, case in enumerate(cases)]


def _line(case: FaultCase, runs: Sequence[FaultOutcome]) -> FaultLine:
    return FaultLine(
        fault=case.fault,
        severity=case.severity,
        car=case.car if case.faults else "all",
        missed=fmean(run.missed for run in runs),
        missed_after=fmean(run.missed_after for run in runs),
        false=fmean(run.false for run in runs),
        shown_s=_slowest(run.shown_s for run in runs),
        recovered_s=_slowest(run.recovered_s for run in runs),
        not_recovered=sum(run.recovered_s is None for run in runs),
    )


def _slowest(values_s: Iterable[float | None]) -> float | str:
    return max((value_s for value_s in values_s if value_s is not None), default="")


def summary(results: Results[FaultsSettings, FaultOutcome, FaultLine]) -> str:
    """How many cases have neither missed nor false warnings."""
    lines = results.table
    harmless = sum(line.missed == line.missed_after == line.false == 0 for line in lines)
    return f"{len(lines)} cases, {harmless} of them without a missed or a false warning"


STUDY = Study(
    name="faults",
    sentence="What each fault of radio, sensors, clock and computer costs in warnings and time.",
    settings=FaultsSettings,
    axes=axes,
    case=FaultyDrive,
    run=run,
    row=FaultOutcome,
    table=table,
    line=FaultLine,
    summary=summary,
)
