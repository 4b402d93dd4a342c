"""Every scenario that a box can drive, judged from outside, as one table and one number.

A box drives as the car with its plate, and the rig steps the others in real time. Without a box the
cores of this build drive all cars in virtual time. The number is the share of the scenarios that
passed, with Wilson's 95 % interval; those that could not be judged do not count.
"""

import csv
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass, fields
from functools import partial
from pathlib import Path

from rich.console import Console

from onboard.errors import UserError
from onboard.settings import SettingsError, load_settings
from sim_rig.boxes.contact import BoxNotReadyError
from sim_rig.boxes.settings import BoxSettings, load_boxes
from sim_rig.reporting.verdict import Outcome, verdict, worst
from sim_rig.run_log.run_log import RunLog
from sim_rig.runs.command import run_and_report, run_in_virtual_time
from sim_rig.runs.live import LiveTestbench
from sim_rig.scenario.catalogue import scenario_names
from sim_rig.scenario.schema import Scenario, load_scenario
from sim_rig.studies.campaigns.intervals import wilson


@dataclass(frozen=True, slots=True)
class ScoredScenario:
    """A row of the table."""

    scenario: str
    outcome: str
    """`passed`, `failed`, `invalid`, or `left out`, if the box cannot drive it."""
    expectations: int
    """Those that were judged."""
    why: str
    """The first reason, unless it passed."""


def score_scenarios(box: Path | None, names: Sequence[str], out: Path) -> Outcome:
    """Run the scenarios, print a line for each and the number, and write `score.csv` into `out`.

    The table has each row as soon as it is judged: whoever interrupts keeps it.

    Args:
        box: the file of the box; without one, this build in virtual time.
        names: of scenarios or files; those of the rig if empty.
        out: folder of the runs' folders.

    Raises:
        UserError: a file has mistakes, or there is no scenario that can be judged.
        OSError: the folder cannot be written.
    """
    settings = None if box is None else load_settings(box, BoxSettings)
    console = Console(highlight=False)
    scenarios = {name: load_scenario(name) for name in names or scenario_names()}
    driven_s = sum(scenario.duration_s for scenario in scenarios.values())
    console.print(f"{len(scenarios)} scenarios, at most {driven_s:.0f} s of driving")
    rows: list[ScoredScenario] = []
    out.mkdir(parents=True, exist_ok=True)
    with (out / "score.csv").open("w", newline="", encoding="utf-8") as file:
        table = csv.DictWriter(file, [field.name for field in fields(ScoredScenario)])
        table.writeheader()
        for name, scenario in scenarios.items():
            row = _row(name, scenario, None if settings is None else (settings, str(box)), out)
            rows.append(row)
            console.print(f"{row.scenario:20} {row.outcome:8} {row.why}".rstrip(), soft_wrap=True)
            table.writerow(asdict(row))
            file.flush()
    console.print(sentence(rows), soft_wrap=True)
    return worst(Outcome[row.outcome.upper()] for row in rows if row.outcome != _LEFT_OUT)


_LEFT_OUT = "left out"


def sentence(rows: Iterable[ScoredScenario]) -> str:
    """The number with its interval, and how many scenarios do not count.

    Raises:
        UserError: no scenario was judged.
    """
    outcomes = [row.outcome for row in rows]
    passed, judged = outcomes.count("passed"), outcomes.count("passed") + outcomes.count("failed")
    if not judged:
        raise UserError("no scenario could be judged")
    share, least, most = wilson(passed / judged, judged)
    return (
        f"score {share:.2f} (95 % interval {least:.2f} to {most:.2f}): {passed} of {judged} passed;"
        f" {outcomes.count('invalid')} invalid, {outcomes.count(_LEFT_OUT)} left out"
    )


def _row(
    name: str, scenario: Scenario, box: tuple[BoxSettings, str] | None, out: Path
) -> ScoredScenario:
    folder = out / Path(name).stem
    prepare: Callable[[Path], RunLog | LiveTestbench]
    if box is None:
        prepare = partial(run_in_virtual_time, scenario, scenario.seed)
    else:
        settings, file = box
        cars = [car for car in scenario.equipped if scenario.cars[car].identity == settings.plate]
        if not cars:
            return ScoredScenario(name, _LEFT_OUT, 0, f"no car has the plate {settings.plate}")
        try:
            hardware = load_boxes([f"{cars[0]}={file}"], scenario)
        except SettingsError as error:
            return ScoredScenario(name, _LEFT_OUT, 0, str(error).splitlines()[0])
        prepare = partial(
            LiveTestbench, scenario, scenario.seed, boxes=hardware, virtual_others=True
        )
    try:
        log, outcome = run_and_report(scenario, scenario.seed, prepare, folder, Console(quiet=True))
    except BoxNotReadyError as error:
        return ScoredScenario(name, "invalid", 0, str(error))
    judged = verdict(scenario, log)
    why = next(_reasons(judged.failures, judged.invalid), "")
    return ScoredScenario(
        name, outcome.name.lower(), len(scenario.expect) - len(judged.not_judged), why
    )


def _reasons(*kinds: Iterable[str]) -> Iterator[str]:
    for sentences in kinds:
        yield from sentences
