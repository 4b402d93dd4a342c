"""One run of a scenario, live or in virtual time, with its files and its report on the terminal."""

import asyncio
import os
import shutil
import signal
import time
import webbrowser
from collections.abc import Callable, Sequence
from pathlib import Path

import typer
from rich.console import Console

from onboard.errors import UserError
from onboard.wave_udp.settings import RadioProfile
from sim_rig.boxes.settings import load_boxes
from sim_rig.engineer.page_process import ENGINEER
from sim_rig.processes.gpsd import gpsd_program
from sim_rig.reporting.report import print_report, print_verdict
from sim_rig.reporting.scenario_from_above import show_scenario
from sim_rig.reporting.timeline import draw_timeline
from sim_rig.reporting.verdict import Outcome, verdict
from sim_rig.run_log.run_log import RunLog
from sim_rig.runs.live import LiveTestbench
from sim_rig.runs.terminated import run_until_terminated
from sim_rig.runs.virtual import run_virtual
from sim_rig.scenario.schema import Scenario, load_scenario


def run_scenario(
    scenario: str,
    out: Path,
    *,
    virtual: bool,
    seed: int | None,
    watch: bool,
    boxes: Sequence[str] = (),
    virtual_others: bool = False,
    profile: RadioProfile | None = None,
) -> Outcome:
    """Run a scenario, and write traces, recordings and picture into a folder of `out`.

    Args:
        scenario: its name or file.
        out: folder of the run's folder.
        virtual: in virtual time; also where it cannot run live.
        seed: instead of the scenario's own.
        watch: show the engineer's page until Ctrl-C; of virtual time, the run from above.
        boxes: `CAR=FILE` for each car that is a box.
        virtual_others: the rig steps all other cars itself, in real time.
        profile: messages and headers of all cars, instead of the scenario's own.

    Returns:
        Whether all expectations were met.

    Raises:
        UserError: there is no such scenario, or it or a box's file has mistakes.
        OSError: the folder cannot be written.
    """
    loaded = load_scenario(scenario, profile)
    if boxes and virtual:
        raise UserError("--box: a box needs real time; leave --virtual out")
    if virtual_others and not boxes:
        raise UserError("--virtual-others: needs --box; without a box, --virtual is faster")
    hardware = load_boxes(boxes, loaded)
    console = Console(highlight=False)
    console.print(f"[bold]{loaded.title}[/bold]", soft_wrap=True)
    if not virtual and not hardware and (why := only_virtual(loaded)) is not None:
        console.print(f"{why}: in virtual time")
        virtual = True
    folder = out / f"{Path(scenario).stem}-{'virtual' if virtual else 'live'}"
    chosen = loaded.seed if seed is None else seed

    def prepare(folder: Path) -> RunLog | LiveTestbench:
        if virtual:
            return run_in_virtual_time(loaded, chosen, folder)
        return LiveTestbench(loaded, chosen, folder, hardware, virtual_others=virtual_others)

    _, outcome = run_and_report(loaded, chosen, prepare, folder, console, watch=watch)
    if virtual and watch:
        page = folder / "run.html"
        show_scenario(folder, page)
        webbrowser.open(page.resolve().as_uri())
    else:
        console.print(f"The run from above: sim-rig show {folder}", soft_wrap=True)
    return outcome


def run_in_virtual_time(scenario: Scenario, seed: int, folder: Path) -> RunLog:
    """Run in virtual time; the recordings go into `folder`, in place of earlier ones."""
    shutil.rmtree(folder / "box", ignore_errors=True)
    return run_virtual(scenario, seed, folder / "box")


def run_and_report(
    scenario: Scenario,
    seed: int,
    prepare: Callable[[Path], RunLog | LiveTestbench],
    folder: Path,
    console: Console,
    *,
    watch: bool = False,
) -> tuple[RunLog, Outcome]:
    """Run a scenario, write its files and print its report.

    Args:
        scenario: the scenario.
        seed: of the run.
        prepare: runs it in virtual time, or returns the testbench of a live run.
        folder: for traces, recordings and picture.
        console: where to print.
        watch: show the engineer's page until Ctrl-C.

    Raises:
        OSError: the folder cannot be written.
    """
    began = time.monotonic()
    prepared = prepare(folder)
    log = _run_live(prepared, watch) if isinstance(prepared, LiveTestbench) else prepared
    took_s = time.monotonic() - began
    log.write(folder)
    draw_timeline(scenario, log, folder / "timeline.png")
    print_report(scenario, log, console)
    console.print(
        f"{scenario.duration_s:g} s in {took_s:.1f} s, seed {seed}; traces,"
        f" recordings and picture in {folder}"
    )
    judged = verdict(scenario, log)
    print_verdict(judged, len(scenario.expect), console)
    if judged.was_late:
        console.print(
            f"Load of this machine: {os.getloadavg()[0]:.1f}, cores: {os.cpu_count()}. Run it again"
            " when it has less to do, or with --virtual",
            soft_wrap=True,
        )
    return log, judged.outcome


def only_virtual(scenario: Scenario) -> str | None:
    """Reason why the scenario cannot run live on this machine; `None` if it can."""
    if scenario.gnss is not None and gpsd_program() is None:
        return "gpsd is not installed (Debian: gpsd)"
    return None


def _run_live(prepared: LiveTestbench, watch: bool) -> RunLog:
    async def run_testbench() -> RunLog:
        async with prepared as testbench:
            for name, address in testbench.pages.items():
                typer.echo(f"  {name:8} {address}")
            if watch:
                webbrowser.open(testbench.pages[ENGINEER])
            await testbench.run()
            if watch:
                typer.echo("The scenario has ended; the engineer's page stays until Ctrl-C.")
                ended = asyncio.Event()
                asyncio.get_running_loop().add_signal_handler(signal.SIGINT, ended.set)
                await ended.wait()
        return testbench.log()

    return run_until_terminated(run_testbench())
