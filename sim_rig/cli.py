"""Commands of the rig: list and run scenarios, run studies, show a run of a study."""

import asyncio
import errno
import os
import shutil
import signal
import sys
import time
import webbrowser
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import takewhile
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from onboard.errors import UserError
from onboard.settings import parse_yaml
from sim_rig.engineer.page_process import ENGINEER
from sim_rig.processes.gpsd import gpsd_program
from sim_rig.reporting.report import failures, print_report, print_verdict
from sim_rig.reporting.timeline import draw_timeline
from sim_rig.run_log.run_log import RunLog
from sim_rig.runs.live import LiveTestbench
from sim_rig.runs.virtual import run_virtual
from sim_rig.scenario.schema import Scenario, load_scenario, scenario_names
from sim_rig.studies.campaign import Workers
from sim_rig.studies.catalogue import check_study, run_study, study_names

app = typer.Typer(
    help="Test rig for `onboard`: simulates the car's sensors, the radio and the other cars.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)


@app.command("list")
def list_scenarios() -> None:
    """List the scenarios that come with the rig, with their titles."""
    for name in scenario_names():
        typer.echo(f"{name:16} {load_scenario(name).title}")


@app.command()
def run(
    scenario: Annotated[str, typer.Argument(help="A name that `list` shows, or a YAML file.")],
    *,
    virtual: Annotated[
        bool,
        typer.Option(
            "--virtual", help="Simulated time instead of real processes: fast and repeatable."
        ),
    ] = False,
    seed: Annotated[
        int | None, typer.Option(min=0, help="Random seed, instead of the scenario's own.")
    ] = None,
    out: Annotated[Path, typer.Option(help="Folder for traces, logs and pictures.")] = Path("out"),
    watch: Annotated[
        bool,
        typer.Option(
            "--watch", help="Open the engineer's page in a browser, and keep it until Ctrl-C."
        ),
    ] = False,
) -> None:
    """Run a scenario and print a report; exit with 1 if an expectation failed."""
    loaded = load_scenario(scenario)
    console = Console(highlight=False)
    console.print(f"[bold]{loaded.title}[/bold]", soft_wrap=True)
    if not virtual and (why := _only_virtual(loaded)) is not None:
        console.print(f"{why}: in virtual time")
        virtual = True
    folder = out / f"{Path(scenario).stem}-{'virtual' if virtual else 'live'}"
    chosen = loaded.seed if seed is None else seed
    began = time.monotonic()
    with _writing(folder):
        log = (
            _run_virtual(loaded, chosen, folder)
            if virtual
            else _run_live(loaded, chosen, folder, watch)
        )
        took_s = time.monotonic() - began
        log.write(folder)
        draw_timeline(loaded, log, folder / "timeline.png")
    print_report(loaded, log, console)
    console.print(
        f"{loaded.duration_s:g} s in {took_s:.1f} s, seed {chosen}; traces,"
        f" recordings and picture in {folder}"
    )
    print_verdict(loaded, log, console)
    failed = bool(failures(loaded, log))
    load, cores = os.getloadavg()[0], os.cpu_count() or 1
    if failed and not virtual and load > cores:
        console.print(
            f"This machine was busy (load {load:.1f}, {cores} cores), and real time does not wait:"
            " run it again when it is not, or with --virtual.",
            soft_wrap=True,
        )
    raise typer.Exit(1 if failed else 0)


@app.command(context_settings={"ignore_unknown_options": True})
def study(
    names: Annotated[
        list[str],
        typer.Argument(
            metavar="NAME... [--SETTING VALUE]...",
            help=f"One or more of: {', '.join(study_names())}. Then settings of theirs: --cars 40.",
        ),
    ],
    out: Annotated[Path, typer.Option(help="Folder for tables and figures.")] = Path("out/studies"),
    settings: Annotated[
        Path | None, typer.Option(help="YAML file of settings, for studies of many runs.")
    ] = None,
    workers: Annotated[
        int, typer.Option(min=1, help="How many processes, for studies of many runs.")
    ] = os.cpu_count() or 1,
    dask: Annotated[
        str | None, typer.Option(help="Address of a Dask scheduler, to use a cluster instead.")
    ] = None,
) -> None:
    """Reproduce tables and figures of the papers from simulated drives."""
    named = list(takewhile(lambda word: not word.startswith("-"), names))
    given = _settings_given(names[len(named) :])
    for name in named:
        check_study(name)
    for name in named:
        with _writing(out / name):
            found = run_study(name, out / name, settings, Workers(workers, dask), given)
        typer.echo(f"{name}: {found}")
        typer.echo(f"  in {out / name}")


@app.command()
def show(
    folder: Annotated[
        Path, typer.Argument(help="The folder of a study: out/studies/mvs-figure9 or mvs-figure3.")
    ],
    number: Annotated[
        int, typer.Argument(min=0, help="The number of the run, as in its runs.jsonl.")
    ],
    out: Annotated[Path, typer.Option(help="The HTML file to write.")] = Path("out/run.html"),
) -> None:
    """Write one run of a study as an HTML page: the cars from above, with play, pause and step."""
    from sim_rig.studies.show import show_run  # noqa: PLC0415 (only this command needs it)

    with _writing(out):
        out.parent.mkdir(parents=True, exist_ok=True)
        summary = show_run(folder, number, out)
    typer.echo(summary)
    typer.echo(f"  in {out}")


@contextmanager
def _writing(place: Path) -> Iterator[None]:
    """Report a disk that is full or not writable as an error of the user."""
    try:
        yield
    except OSError as error:
        if error.errno not in _OF_THE_DISK:
            raise
        raise UserError(
            f"{error.filename or place}: cannot be written: {error.strerror}"
        ) from error


_OF_THE_DISK = (
    errno.EACCES, errno.EDQUOT, errno.EEXIST, errno.EFBIG, errno.EIO, errno.EISDIR,
    errno.ENAMETOOLONG, errno.ENOENT, errno.ENOSPC, errno.ENOTDIR, errno.EPERM, errno.EROFS,
)  # fmt: skip


def _settings_given(words: list[str]) -> dict[str, object]:
    """Parse settings: `--spacing-m 10` and `--spacing-m=10` set `spacing_m`."""
    split = [
        part for word in words for part in (word.split("=", 1) if word.startswith("--") else [word])
    ]
    names, values = split[::2], split[1::2]
    for name in names:
        if not name.startswith("--") or len(names) != len(values):
            raise UserError(f"settings are given as --name value (given {' '.join(words)!r})")
        if names.count(name) > 1:
            raise UserError(f"the setting {name} is given twice")
    return {
        name[2:].replace("-", "_"): parse_yaml(value, name)
        for name, value in zip(names, values, strict=True)
    }


def _run_virtual(scenario: Scenario, seed: int, folder: Path) -> RunLog:
    shutil.rmtree(folder / "box", ignore_errors=True)
    return run_virtual(scenario, seed, folder / "box")


def _only_virtual(scenario: Scenario) -> str | None:
    """Reason why the scenario cannot run live on this machine; `None` if it can."""
    if scenario.gnss is not None and gpsd_program() is None:
        return "gpsd is not installed (Debian: gpsd)"
    return None


def _run_live(scenario: Scenario, seed: int, folder: Path, watch: bool) -> RunLog:
    async def run_testbench() -> RunLog:
        task = asyncio.current_task()
        assert task is not None  # noqa: S101 (inside of asyncio.run there is one)
        # SIGTERM must end the daemons, too.
        asyncio.get_running_loop().add_signal_handler(signal.SIGTERM, task.cancel)
        async with LiveTestbench(scenario, seed, folder) as testbench:
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

    try:
        return asyncio.run(run_testbench())
    except asyncio.CancelledError:
        raise typer.Exit(128 + signal.SIGTERM) from None


def main() -> None:
    """Run the command line; an error of the user is one line on stderr and exit code 2."""
    try:
        app()
    except UserError as error:
        typer.echo(error, err=True)
        sys.exit(2)
