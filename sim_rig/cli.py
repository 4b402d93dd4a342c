"""Commands of the rig: list and run scenarios, run studies, show a run.

What a command needs is imported when it runs: `--help` and `list` take no second, and without the
extra `rig` they work.
"""

import errno
import math
import os
import sys
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from itertools import takewhile
from pathlib import Path
from typing import Annotated

import typer

from onboard.errors import UserError
from onboard.tools.command_line import VersionOption, command_line, output_on_a_disk
from onboard.wave_udp.settings import RadioProfile
from sim_rig.scenario.catalogue import scenario_titles
from sim_rig.studies.campaigns.catalogue import (
    check_studies,
    run_study,
    setting_names,
    study_names,
    study_settings,
)

app = command_line(
    "Test rig for `onboard`: simulates the car's sensors, the radio and the other cars."
)


@app.callback()
def options(version: VersionOption = False) -> None:
    """Take the options of the program itself; their callbacks act."""


def _scenarios(incomplete: str) -> list[str]:
    """Return the scenarios that the shell offers."""
    return _beginning(incomplete, scenario_titles())


@app.command("list")
def list_scenarios() -> None:
    """List the scenarios that come with the rig, with their titles."""
    for name, title in scenario_titles().items():
        typer.echo(f"{name:16} {title}")


@app.command()
def run(
    scenario: Annotated[
        str,
        typer.Argument(
            help="A name that `list` shows, or a YAML file.",
            autocompletion=_scenarios,
        ),
    ],
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
            "--watch",
            help="Open the engineer's page in a browser, and keep it until Ctrl-C; of a run in"
            " virtual time, the cars from above.",
        ),
    ] = False,
    box: Annotated[
        list[str] | None,
        typer.Option(
            metavar="CAR=FILE",
            help="A car that is hardware, with the file of its wires; repeat it.",
        ),
    ] = None,
    virtual_others: Annotated[
        bool,
        typer.Option(
            "--virtual-others",
            help="With --box: no other car is a process; the rig steps their cores in real time.",
        ),
    ] = False,
    profile: Annotated[
        RadioProfile | None,
        typer.Option(help="Messages and headers of all cars, instead of the scenario's own."),
    ] = None,
) -> None:
    """Run a scenario and print a report.

    Exit with 1 if an expectation failed, and with 3 if nothing can be said: rig or daemons were
    measured to be late, or a box could not be judged.
    """
    from sim_rig.runs.command import run_scenario  # noqa: PLC0415 (see above)

    with _writing(out):
        outcome = run_scenario(
            scenario,
            out,
            virtual=virtual,
            seed=seed,
            watch=watch,
            boxes=box or (),
            virtual_others=virtual_others,
            profile=profile,
        )
    raise typer.Exit(outcome)


@app.command()
def ladder(
    scenario: Annotated[
        str,
        typer.Argument(
            help="A name that `list` shows, or a YAML file.",
            autocompletion=_scenarios,
        ),
    ],
    *,
    out: Annotated[Path, typer.Option(help="Folder for traces, logs and pictures.")] = Path("out"),
    box: Annotated[
        list[str] | None,
        typer.Option(
            metavar="CAR=FILE",
            help="A car that is hardware, with the file of its wires; repeat it."
            " A car's second file is for one more rung, and so on.",
        ),
    ] = None,
) -> None:
    """Run a scenario on each rung: virtual time, processes, boxes.

    Compares what was decided.
    Exit with 1 if an expectation failed on a rung, and with 3 if a box could not be judged.
    """
    from sim_rig.runs.ladder import climb  # noqa: PLC0415 (see above)

    with _writing(out):
        outcome = climb(scenario, out, box or ())
    raise typer.Exit(outcome)


@app.command()
def play(
    recording: Annotated[
        list[Path] | None,
        typer.Argument(help="A black box recording: the files of one drive, or their folder."),
    ] = None,
    *,
    box: Annotated[
        Path, typer.Option(help="The file of a box; its name without .yaml is the car's.")
    ],
    can: Annotated[Path | None, typer.Option(help="A CAN log: candump, ASC, BLF, TRC.")] = None,
    clip: Annotated[
        str | None, typer.Option(help="The camera's video, or a folder or glob of images.")
    ] = None,
    fps: Annotated[
        float | None,
        typer.Option(help="Frames a second, for images, or if the video states a wrong rate."),
    ] = None,
    gnss: Annotated[
        Path | None, typer.Option(help="A GNSS receiver's log: NMEA, or gpsd's reports.")
    ] = None,
    pcap: Annotated[Path | None, typer.Option(help="A capture of WSMs: pcap or pcapng.")] = None,
    config: Annotated[
        Path | None,
        typer.Option(help="The box's configuration, to replay logs and clips with."),
    ] = None,
    seconds: Annotated[
        float, typer.Option(min=0.0, help="How much of the drive is played at most.")
    ] = math.inf,
    out: Annotated[Path, typer.Option(help="Folder for recordings and logs.")] = Path("out"),
) -> None:
    """Play a recorded drive on a box's wires, and compare decisions.

    Give a black box recording, or any of --can, --clip, --gnss and --pcap together. Exit with 1 if
    the box decided otherwise than a replay, and with 3 if it could not be judged.
    """
    from onboard.tools.replay import RawRecording  # noqa: PLC0415 (see above)
    from sim_rig.runs.play import black_box_source, play_drive, raw_source  # noqa: PLC0415

    raw = RawRecording(can, clip, fps, gnss, pcap)
    if bool(recording) == bool(raw.sensors()):
        raise UserError(
            "give either a recording of the black box, or any of --can, --clip, --gnss and --pcap"
        )
    source = black_box_source(recording) if recording else raw_source(raw, config)
    with _writing(out):
        outcome = play_drive(source, box, out, seconds)
    raise typer.Exit(outcome)


@app.command()
def score(
    scenarios: Annotated[
        list[str] | None,
        typer.Argument(
            help="Names that `list` shows, or YAML files; without any, all.",
            autocompletion=_scenarios,
        ),
    ] = None,
    *,
    box: Annotated[
        Path | None,
        typer.Option(
            help="The file of a box, which drives as the car with its plate; without one, this"
            " build drives all cars, in virtual time."
        ),
    ] = None,
    out: Annotated[Path, typer.Option(help="Folder for the table and the runs.")] = Path(
        "out/score"
    ),
) -> None:
    """Run all scenarios with a box: one table, and one number.

    Exit with 1 if a scenario failed, and with 3 if one could not be judged.
    """
    from sim_rig.studies.score.score import score_scenarios  # noqa: PLC0415 (see above)

    with _writing(out):
        outcome = score_scenarios(box, scenarios or (), out)
    raise typer.Exit(outcome)


@app.command()
def doctor(
    file: Annotated[
        Path, typer.Argument(help="The file of a box; its name without .yaml is the car's.")
    ],
    out: Annotated[Path, typer.Option(help="Folder for traces and logs.")] = Path("out"),
) -> None:
    """Let a box follow one car, and test both ways of each wire.

    Exit with 1 if something is missing.
    """
    from onboard.tools.doctor.cli import print_finding  # noqa: PLC0415 (see above)
    from onboard.tools.doctor.finding import FindingLevel  # noqa: PLC0415
    from sim_rig.runs.doctor import examine_box  # noqa: PLC0415

    with _writing(out):
        findings = examine_box(file, out)
    for finding in findings:
        print_finding(finding)
    raise typer.Exit(any(finding.level is FindingLevel.MISSING for finding in findings))


@app.command(context_settings={"ignore_unknown_options": True, "help_option_names": []})
def study(
    context: typer.Context,
    names: Annotated[
        list[str],
        typer.Argument(
            metavar="NAME... [--SETTING VALUE]...",
            autocompletion=lambda incomplete: _beginning(incomplete, study_names()),
            help=f"One or more of: {', '.join(study_names())}. Then settings of theirs, as"
            " --runs 5: NAME --help lists them.",
        ),
    ],
    *,
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
    if {"-h", "--help"} & set(names):
        typer.echo(_help_of(names, context))
        return
    from sim_rig.studies.campaigns.campaign import Workers  # noqa: PLC0415 (see above)

    named = list(takewhile(lambda word: not word.startswith("-"), names))
    check_studies(named)
    given = _settings_given(names[len(named) :], named)
    for name in named:
        with _writing(out / name):
            found = run_study(name, out / name, settings, Workers(workers, dask), given)
        typer.echo(f"{name}: {found}")
        typer.echo(f"  in {out / name}")


@app.command()
def show(
    folder: Annotated[
        Path,
        typer.Argument(
            help="The folder of a scenario's run (out/fig4-virtual), or of the study mvs-figure9 or"
            " mvs-figure3."
        ),
    ],
    number: Annotated[
        int | None, typer.Argument(min=0, help="Of a study, the run's number in its runs.jsonl.")
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(help="The HTML file to write.", show_default="run.html in the run's folder"),
    ] = None,
) -> None:
    """Write a run as an HTML page: the cars from above. It has play, pause and step."""
    page = out or folder / ("run.html" if number is None else f"run-{number}.html")
    with _writing(page):
        if out is not None:
            out.parent.mkdir(parents=True, exist_ok=True)
        if number is None:
            from sim_rig.reporting.scenario_from_above import (  # noqa: PLC0415 (see above)
                show_scenario,
            )

            summary = show_scenario(folder, page)
        else:
            from sim_rig.studies.mvs.show import show_run  # noqa: PLC0415 (see above)

            summary = show_run(folder, number, page)
    typer.echo(summary)
    typer.echo(f"  in {page}")


@app.command("map")
def store_map(
    scenario: Annotated[
        str,
        typer.Argument(
            help="A name that `list` shows, or a YAML file; it has a `signal`.",
            autocompletion=_scenarios,
        ),
    ],
    *,
    form: Annotated[
        str,
        typer.Option(help="rsu41: a file; ntcip1218: arguments of Net-SNMP's snmpset."),
    ] = "ntcip1218",
    channel: Annotated[int, typer.Option(min=1, max=255, help="Radio channel.")] = 183,
    index: Annotated[int, typer.Option(min=1, max=255, help="Row of the unit's table.")] = 1,
    days: Annotated[int, typer.Option(min=1, max=365, help="How long it is sent.")] = 1,
) -> None:
    """Print what makes a road-side unit repeat a MAP."""
    from sim_rig.road_side.store_and_repeat import UnitForm, stored_map  # noqa: PLC0415 (see above)
    from sim_rig.scenario.schema import load_scenario  # noqa: PLC0415 (see above)

    if form not in list(UnitForm):
        raise UserError(f"--form: {form} is not one of {', '.join(UnitForm)}")
    now_s = time.time()
    loaded = load_scenario(scenario)
    try:
        text = stored_map(
            loaded,
            UnitForm(form),
            channel=channel,
            index=index,
            start_s=now_s,
            stop_s=now_s + days * 86_400.0,
        )
    except UserError as error:
        raise UserError(f"{scenario}: {error}") from error
    typer.echo(text, nl=False)


def _beginning(incomplete: str, names: Iterable[str]) -> list[str]:
    """Return the names that the shell offers."""
    return [name for name in names if name.startswith(incomplete)]


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


def _help_of(names: list[str], context: typer.Context) -> str:
    """Describe the settings of the studies named before --help, or else the command."""
    named = list(takewhile(lambda word: not word.startswith("-"), names))
    settings = [study_settings(name) for name in named]
    return "\n".join(settings) or context.get_help()


def _settings_given(words: list[str], studies: list[str]) -> dict[str, object]:
    """Parse settings of `studies`: `--spacing-m 10` and `--spacing-m=10` set `spacing_m`."""
    from onboard.settings import parse_yaml  # noqa: PLC0415 (see above)

    split = [
        part for word in words for part in (word.split("=", 1) if word.startswith("--") else [word])
    ]
    names, values = split[::2], split[1::2]
    for name in names:
        if not name.startswith("--") or len(names) != len(values):
            known = "".join(
                f"; {each} has {', '.join(setting_names(each)) or 'none'}" for each in studies
            )
            raise UserError(
                f"settings are given as --name value (given {' '.join(words)!r}){known}"
            )
        if names.count(name) > 1:
            raise UserError(f"the setting {name} is given twice")
    return {
        name[2:].replace("-", "_"): parse_yaml(value, name)
        for name, value in zip(names, values, strict=True)
    }


_EXTRAS = {"libsumo": "sumo", "scipy": "studies", "statsmodels": "studies"}
"""The extra of a package that is not in `rig`."""


def main() -> None:
    """Run the command line; an error of the user is one line on stderr and exit code 2.

    A package of an extra that is not installed is such an error.
    """
    try:
        with output_on_a_disk():
            app()
    except UserError as error:
        typer.echo(error, err=True)
        sys.exit(2)
    except ModuleNotFoundError as error:
        missing = (error.name or "").partition(".")[0]
        if missing in {"", "onboard", "sim_rig"}:
            raise
        how = f"pip install 'onboard[{_EXTRAS.get(missing, 'rig')}]' (in a clone: make .venv/ready)"
        typer.echo(f"sim-rig needs {missing}: {how}", err=True)
        sys.exit(2)
