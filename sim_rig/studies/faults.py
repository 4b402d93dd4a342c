"""What each fault costs, mild and severe: warnings missed and false, time to show and to recover.

Three cars drive in one lane, green before red before blue, and green brakes: once before the fault,
three times while it lasts, twice when it is over. Everything runs in virtual time.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from statistics import fmean
from typing import Annotated, Any

from pydantic import AfterValidator, Field

from onboard.settings import Settings, parse_settings
from sim_rig.run_log.run_log import RunLog
from sim_rig.runs.virtual import run_virtual
from sim_rig.scenario.schema import Scenario
from sim_rig.scenario.setting_types import Several
from sim_rig.studies.campaign import Row, Workers, run_campaign
from sim_rig.studies.fault_cases import CASES, FROM_S, UNTIL_S, FaultCase
from sim_rig.studies.results import write_results

BRAKES_S = (7.0, 14.0, 19.0, 24.0, 34.0, 39.0)
END_S = 43.0
WARNED_WITHIN_S = 2.0
"""Of the brake's being applied; the rig's own scenarios allow 0.8 s on a good day."""
BRAKING_LASTS_S = 4.5
"""A warning or alarm later than this after a brake is about nothing that happened."""
PLACES = {"green": ("leader", 1), "red": ("member", 2), "blue": ("member", 3)}
COLUMNS = (
    "fault",
    "severity",
    "car",
    "missed",
    "missed_after",
    "false",
    "shown_s",
    "recovered_s",
    "not_recovered",
)


def _fault(name: str) -> str:
    names = dict.fromkeys(case.fault for case in CASES)
    if name not in names:
        raise ValueError(f"no fault {name!r}; there are: {', '.join(names)}")
    return name


class FaultsSettings(Settings):
    """One run of the study."""

    seeds: Several[Annotated[int, Field(ge=0)]] = (1, 2, 3)
    cases: tuple[Annotated[str, AfterValidator(_fault)], ...] = ()
    """Names of faults; all if none is named."""


@dataclass(frozen=True, slots=True)
class FaultOutcome:
    """What came of one run."""

    missed: float
    """Part of the warnings due while the fault lasted."""
    missed_after: float
    """Part of those due when it was over."""
    false: int
    """Warnings and urgent alarms while nobody braked hard."""
    shown_s: float | None
    """From the fault to the first report of a lost sensor by the faulty car."""
    recovered_s: float | None
    """From its end until every place and sensor is as it was; `None`: not before the end."""


def run(out_dir: Path, settings: FaultsSettings | None, workers: Workers) -> str:
    """Run the matrix and write its table."""
    chosen = settings or FaultsSettings()
    cases = cases_of(chosen)
    numbers = range(len(cases) * len(chosen.seeds))
    rows = run_campaign(run_case, chosen, numbers, out_dir / "runs", workers)
    table = list(_table(cases, rows, len(chosen.seeds)))
    write_results(out_dir, COLUMNS, table, chosen)
    harmless = sum(row[3] == row[4] == row[5] == 0 for row in table)
    return f"{len(table)} cases, {harmless} of them without a missed or a false warning"


def cases_of(settings: FaultsSettings) -> list[FaultCase]:
    """The cases that are asked for."""
    return [case for case in CASES if not settings.cases or case.fault in settings.cases]


def run_case(settings: FaultsSettings, number: int) -> Row:
    """One case with one seed."""
    case_number, seed_number = divmod(number, len(settings.seeds))
    case = cases_of(settings)[case_number]
    outcome = outcome_of(run_virtual(scenario_of(case), settings.seeds[seed_number]), case.car)
    return {
        "missed": outcome.missed,
        "missed_after": outcome.missed_after,
        "false": outcome.false,
        "shown_s": outcome.shown_s,
        "recovered_s": outcome.recovered_s,
    }


def scenario_of(case: FaultCase) -> Scenario:
    """The drive, with the fault of the case."""
    dips = [((at, 15.0), (at + 1.0, 9.0), (at + 1.6, 9.0), (at + 3.6, 15.0)) for at in BRAKES_S]
    echoes = [((at + 0.5, 15.0), (at + 2.5, 9.0), (at + 4.7, 15.0)) for at in BRAKES_S]
    first, follows = ([point for dip in each for point in dip] for each in (dips, echoes))
    tree: dict[str, Any] = {
        "title": "Three cars brake in one lane, and one of them has a fault.",
        "seed": 1,
        "duration_s": END_S,
        "signed": case.signed,
        "radio": {"reach_m": 300.0} | case.radio,
        "gnss": {},
        "cars": {
            "green": {"plate": "GN417KB", "lane": 1, "start_m": 100.0, "speed_m_s": first},
            "red": {"plate": "RD288HX", "lane": 1, "start_m": 83.5, "speed_m_s": follows},
            "blue": {"plate": "BL635TN", "lane": 1, "start_m": 67.0, "speed_m_s": follows},
        },
        "faults": [
            {"car": case.car, "from_s": FROM_S, "until_s": UNTIL_S} | fault for fault in case.faults
        ],
        "expect": [],
    }
    return parse_settings(tree, Scenario, case.fault)


def outcome_of(log: RunLog, car: str) -> FaultOutcome:
    """Measure one run; `car` has the fault."""
    during = [at for at in BRAKES_S if FROM_S <= at < UNTIL_S]
    after = [at for at in BRAKES_S if at >= UNTIL_S]
    lost = [log.at_s(record) for record in log.of(car, "sensor_lost", from_s=FROM_S)]
    whole_s = max(_broken_until_s(log, name) for name in PLACES)
    return FaultOutcome(
        missed=_missed(log, during),
        missed_after=_missed(log, after),
        false=sum(1 for _ in _false(log)),
        shown_s=lost[0] - FROM_S if lost else None,
        recovered_s=None if whole_s >= END_S else max(0.0, whole_s - UNTIL_S),
    )


def _missed(log: RunLog, brakes_s: Sequence[float]) -> float:
    due = [(car, at) for car in ("red", "blue") for at in brakes_s]
    warned = (any(log.of(car, "warning", at, at + WARNED_WITHIN_S)) for car, at in due)
    return 1.0 - fmean(map(float, warned))


def _false(log: RunLog) -> Iterator[float]:
    """When somebody is warned of nothing."""
    for car in PLACES:
        for record in log.of(car, "warning"):
            about = log.name(record["origin_id"])
            if about != "green" or not _brakes_at(log.at_s(record)):
                yield log.at_s(record)
        for record in log.of(car, "alarm", level="warning"):
            if not _brakes_at(log.at_s(record)):
                yield log.at_s(record)


def _brakes_at(at_s: float) -> bool:
    return any(brake_s <= at_s < brake_s + BRAKING_LASTS_S for brake_s in BRAKES_S)


def _broken_until_s(log: RunLog, car: str) -> float:
    """When the last thing came right that was not as it should be; `END_S` if it never did."""
    ends = [FROM_S]
    for kinds, is_wrong in (
        (("transition",), partial(_is_out_of_place, car)),
        (("sensor_lost", "sensor_recovered"), _is_loss),
    ):
        state: dict[str, bool] = {}
        for record in log.traces[car]:
            if record["kind"] in kinds and log.at_s(record) >= FROM_S:
                about = record.get("sensor", "")
                was_wrong, state[about] = state.get(about, False), is_wrong(record)
                if was_wrong and not state[about]:
                    ends.append(log.at_s(record))
        if any(state.values()):
            return END_S
    return max(ends)


def _is_out_of_place(car: str, record: Any) -> bool:
    return (record["state"], record["group_number"]) != PLACES[car]


def _is_loss(record: Any) -> bool:
    return bool(record["kind"] == "sensor_lost")


def _table(cases: Sequence[FaultCase], rows: Sequence[Row], seeds: int) -> Iterator[list[Any]]:
    for number, case in enumerate(cases):
        runs = rows[number * seeds : (number + 1) * seeds]
        yield [
            case.fault,
            case.severity,
            case.car if case.faults else "all",
            fmean(run["missed"] for run in runs),
            fmean(run["missed_after"] for run in runs),
            fmean(run["false"] for run in runs),
            _slowest(runs, "shown_s"),
            _slowest(runs, "recovered_s"),
            sum(run["recovered_s"] is None for run in runs),
        ]


def _slowest(runs: Sequence[Row], name: str) -> float | str:
    """The longest of all runs; a run in which it never came counts elsewhere."""
    known = [run[name] for run in runs if run[name] is not None]
    return max(known) if known else ""
