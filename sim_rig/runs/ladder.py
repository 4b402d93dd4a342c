"""One scenario on each rung: virtual time, processes in real time, and with boxes."""

import csv
from collections import Counter
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from functools import partial
from itertools import pairwise
from pathlib import Path

from rich import box as borders
from rich.console import Console
from rich.table import Table

from onboard.errors import UserError
from sim_rig.boxes.settings import BoxSettings, load_boxes
from sim_rig.reporting.verdict import Outcome, worst
from sim_rig.run_log.first_difference import Decision, DecisionPair, RunComparison, compare
from sim_rig.run_log.latency_ledger import HOPS, ledger
from sim_rig.run_log.run_log import RunLog
from sim_rig.runs.command import only_virtual, run_and_report, run_in_virtual_time
from sim_rig.runs.live import LiveTestbench
from sim_rig.scenario.schema import Scenario, load_scenario

FIGURES = "ladder.csv"
"""File of what the rungs have measured."""
WITHIN_S = 0.5
"""Times of one decision on two rungs may differ by this: images and polls have other phases."""


def climb(scenario: str, out: Path, boxes: Sequence[str]) -> Outcome:
    """Run a scenario on each rung, and print where decisions and latencies first differ.

    What was measured is written to `FIGURES` in `out`.

    Args:
        scenario: its name or file.
        out: folder of the runs' folders.
        boxes: `CAR=FILE` for each car that is a box (`rungs_of_boxes`); the rig steps the others,
            also where those cars are processes. Without boxes, all cars are.

    Returns:
        The worst outcome of a rung.

    Raises:
        UserError: there is no such scenario, it cannot run live, or it or a file has mistakes.
        OSError: a folder cannot be written.
    """
    loaded = load_scenario(scenario)
    if (why := only_virtual(loaded)) is not None:
        raise UserError(f"{scenario}: has the rung of virtual time only: {why}")
    of_boxes = rungs_of_boxes(boxes, loaded)
    rungs: dict[str, Callable[[Path], RunLog | LiveTestbench]] = {
        "virtual": lambda folder: run_in_virtual_time(loaded, loaded.seed, folder),
        "processes": partial(_live, loaded, {}, set().union(*of_boxes.values())),
    }
    for rung, hardware in of_boxes.items():
        rungs[rung] = partial(_live, loaded, hardware, ())
    console = Console(highlight=False)
    console.print(f"[bold]{loaded.title}[/bold]", soft_wrap=True)
    logs: dict[str, RunLog] = {}
    outcomes: list[Outcome] = []
    for rung, prepare in rungs.items():
        console.rule(rung)
        folder = out / f"{Path(scenario).stem}-{rung}"
        logs[rung], outcome = run_and_report(loaded, loaded.seed, prepare, folder, console)
        outcomes.append(outcome)
    console.rule("ladder")
    console.print(_latencies(logs))
    compared = {
        f"{lower} and {higher}": compare(logs[lower], logs[higher], WITHIN_S)
        for lower, higher in pairwise(logs)
    }
    for rungs_of_pair, found in compared.items():
        console.print(f"{rungs_of_pair}: {sentence(found)}", soft_wrap=True)
    with (out / FIGURES).open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(("figure", "value", "unit", "limit"))
        writer.writerows(_figures(dict(zip(logs, outcomes, strict=True)), logs, compared))
    return worst(outcomes)


def rungs_of_boxes(
    given: Sequence[str], scenario: Scenario
) -> dict[str, Mapping[str, BoxSettings]]:
    """Read the files of the boxes of each rung: a car's n-th file is for the n-th rung of boxes.

    Args:
        given: `CAR=FILE` for each box.
        scenario: the scenario whose cars they are.

    Returns:
        the settings by car, by rung: `box`, `box-2`, ...

    Raises:
        SettingsError: a file is missing or does not fit.
    """
    files: dict[str, list[str]] = {}
    rungs: Counter[str] = Counter()
    for each in given:
        car = each.partition("=")[0]
        rungs[car] += 1
        rung = "box" if rungs[car] == 1 else f"box-{rungs[car]}"
        files.setdefault(rung, []).append(each)
    return {rung: load_boxes(boxes, scenario) for rung, boxes in files.items()}


def _live(
    scenario: Scenario,
    hardware: Mapping[str, BoxSettings],
    daemons: Collection[str],
    folder: Path,
) -> LiveTestbench:
    return LiveTestbench(
        scenario,
        scenario.seed,
        folder,
        hardware,
        virtual_others=bool(hardware or daemons),
        daemons=daemons,
    )


def _figures(
    outcomes: Mapping[str, Outcome],
    logs: Mapping[str, RunLog],
    compared: Mapping[str, RunComparison],
) -> Iterator[tuple[str, str, str, str]]:
    """Yield what the rungs have measured, each with its value, unit and limit."""
    for rung, log in logs.items():
        yield f"{rung}: outcome", outcomes[rung].name, "", Outcome.PASSED.name
        for line in ledger(log):
            yield f"{rung}: {line.hop}, p50", f"{line.p50_s * 1e3:.1f}", "ms", ""
        for late in log.lateness:
            limit_ms = f"{late.limit_s * 1e3:.0f}"
            yield f"{rung}: rig late, {late.what}, p99", f"{late.p99_s * 1e3:.1f}", "ms", limit_ms
    for rungs, found in compared.items():
        yield f"{rungs}: same decisions", str(found.decisions), "", ""
        yield f"{rungs}: other decisions", str(len(found.differences)), "", ""


def _latencies(logs: dict[str, RunLog]) -> Table:
    table = Table(title="Latencies, p50 ms", box=borders.SIMPLE, title_justify="left")
    table.add_column("rung")
    for hop in (*HOPS, "chain"):
        table.add_column(hop, justify="right")
    for rung, log in logs.items():
        p50_ms = {line.hop: f"{line.p50_s * 1e3:.1f}" for line in ledger(log)}
        table.add_row(rung, *(p50_ms.get(hop, "") for hop in (*HOPS, "chain")))
    return table


def sentence(found: RunComparison) -> str:
    """Return how far two runs decided the same, and where they first differ."""
    if found.first is None:
        latest = found.latest
        if latest is None or latest.one is None or latest.other is None:
            return "no decisions"
        apart_s = abs(latest.one.at_s - latest.other.at_s)
        return (
            f"the same {found.decisions} decisions; the times of {latest.one.car}'s"
            f" «{latest.one.what}» differ most, by {apart_s:.2f} s"
        )
    different = "; ".join(map(_difference, found.differences))
    return f"{found.decisions} decisions are the same; others differ: {different}"


def _difference(pair: DecisionPair) -> str:
    car = (pair.one or pair.other).car  # type: ignore[union-attr]  # one of the two is there
    return f"at {pair.at_s:.1f} s {car} {_decided(pair.one)} and {_decided(pair.other)}"


def _decided(decision: Decision | None) -> str:
    return "nothing more" if decision is None else f"«{decision.what}» at {decision.at_s:.2f} s"
