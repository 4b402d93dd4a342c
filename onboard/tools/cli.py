"""The command line of `onboard`: run, check and replay, and the commands of the tools."""

import asyncio
import faulthandler
import logging
import os
import sys
from pathlib import Path
from typing import Annotated

import structlog
import typer

from onboard.brake_request.request_outputs import read_layout
from onboard.errors import UserError
from onboard.obd.dbc_file import read_signals
from onboard.recorder.reader import RecordedDrive
from onboard.replay.replay import OTHER_PROCESSOR, play
from onboard.runtime.service import Service
from onboard.settings import load_settings
from onboard.tools import replay as drive
from onboard.tools.calibrate.cli import calibrate
from onboard.tools.decode.cli import decode
from onboard.tools.doctor.cli import doctor
from onboard.tools.recording_cli import expect, export
from onboard.tools.see.cli import see
from onboard.tools.test_ca.cli import keys
from onboard.tools.version import VersionOption
from onboard.trace.trace_line import as_line
from onboard.vehicle.config import CarConfig

app = typer.Typer(
    help="The in-car daemon that warns the driver, and its tools.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
)

_RAW_OPTIONS = "--can, --clip, --gnss and --pcap"

PRIORITIES = {"critical": 2, "error": 3, "warning": 4, "info": 6, "debug": 7}
"""Severities of syslog (RFC 5424, table 2), by structlog's names."""

OPTIONAL_SECTIONS = (
    "can", "camera", "detector", "gnss", "radio", "brake_request", "hmi", "recorder"
)  # fmt: skip
"""Sections of the configuration without which an edge is not opened."""


@app.callback()
def options(version: VersionOption = False) -> None:
    """Take the options of the program itself; their callbacks act."""


app.add_typer(keys, name="keys")
app.command()(doctor)
app.command()(decode)
app.command()(see)
app.command()(calibrate)
app.command()(export)

ConfigFile = Annotated[Path, typer.Argument(help="The car's configuration, a YAML file.")]


@app.command()
def run(config: ConfigFile) -> None:
    """Run the daemon until it is stopped. SIGHUP reloads its configuration."""
    faulthandler.enable()  # A watchdog's SIGABRT then logs where it hung.
    asyncio.run(Service(config).run())


@app.command()
def check(config: ConfigFile) -> None:
    """Check a configuration: print every mistake, or the edges it uses. Opens no device."""
    loaded = load_settings(config, CarConfig)
    read_signals(loaded.obd.broadcast)
    if loaded.brake_request is not None and loaded.brake_request.can is not None:
        read_layout(loaded.brake_request.can, loaded.brake_request.most_m_s2)
    missing = [name for name in OPTIONAL_SECTIONS if getattr(loaded, name) is None]
    present = [name for name in OPTIONAL_SECTIONS if name not in missing]
    typer.echo(f"{config}: good, car {loaded.car.plate}")
    typer.echo(f"  with {', '.join(present) or 'none'}")
    if missing:
        typer.echo(f"  without {', '.join(missing)}")


@app.command()
def replay(
    box: Annotated[
        list[Path] | None,
        typer.Argument(help="A black box recording: the files of one drive, or their folder."),
    ] = None,
    *,
    can: Annotated[
        Path | None,
        typer.Option(
            help="A CAN log: candump, ASC (of local time, see TZ), BLF, TRC, CSV or SQLite."
        ),
    ] = None,
    clip: Annotated[
        str | None, typer.Option(help="The camera's video, or a folder or glob of images.")
    ] = None,
    gnss: Annotated[
        Path | None,
        typer.Option(
            "--gnss",
            "--nmea",
            help="A GNSS receiver's log: NMEA, gpsd's reports (gpspipe -w), or its own binary"
            " protocol, if gpsdecode is installed.",
        ),
    ] = None,
    pcap: Annotated[
        Path | None, typer.Option(help="A capture of WSMs: pcap or pcapng, as `export` writes.")
    ] = None,
    config: Annotated[
        Path | None,
        typer.Option(help="The car's configuration (camera, keys, ...). No device is opened."),
    ] = None,
    fps: Annotated[
        float | None,
        typer.Option(help="Frames a second, for images, or if the video states a wrong rate."),
    ] = None,
    realtime: Annotated[
        bool,
        typer.Option(
            "--realtime", help="Replay at the speed of the drive instead of as fast as possible."
        ),
    ] = False,
    expected: Annotated[
        bool,
        typer.Option(
            "--expect", help="Only compare with BOX's decisions; exit with 1 if one differs."
        ),
    ] = False,
    within: Annotated[
        float,
        typer.Option(
            min=0.0, help="Relative tolerance of numbers in --expect; 0 compares every bit."
        ),
    ] = OTHER_PROCESSOR,
) -> None:
    """Replay a recorded drive; print observations and decisions, one JSON object a line.

    Give a black box recording (BOX), or any of --can, --clip, --gnss and --pcap together. A clip
    has no time of its own: it starts at the first CAN frame, or else at the first fix or WSM.
    """
    raw = drive.RawRecording(can, clip, fps, gnss, pcap)
    if (box or expected) and raw.sensors():
        raise UserError(f"give either a recording of the black box, or {_RAW_OPTIONS}")
    if expected and not box:
        raise UserError("--expect needs a recording of the black box")
    if not (box or raw.sensors()):
        raise UserError(f"nothing to replay: give a recording, or any of {_RAW_OPTIONS}")
    if expected:
        raise typer.Exit(0 if expect(box or [], within) else 1)
    if box:
        recorded = (event for step in play(RecordedDrive(box)) for event in step.events)
        for event in drive.in_real_time(recorded) if realtime else recorded:
            typer.echo(as_line(event))
        return
    car = load_settings(config, CarConfig) if config is not None else drive.UNCONFIGURED
    events = drive.replay(raw, car)
    for event in drive.in_real_time(events) if realtime else events:
        typer.echo(as_line(event))


def main() -> None:
    """Run the command line; a mistake of the user is one line on stderr and exit code 2."""
    in_journal = "JOURNAL_STREAM" in os.environ
    structlog.configure(
        processors=[
            structlog.processors.add_log_level,
            structlog.processors.TimeStamper(fmt="iso", utc=True),
            structlog.processors.JSONRenderer(),
            *([_with_priority] if in_journal else []),
        ],
        wrapper_class=structlog.make_filtering_bound_logger(logging.INFO),
        logger_factory=structlog.PrintLoggerFactory(sys.stderr),
    )
    try:
        app()
    except UserError as error:
        sys.exit(_complain(error))


def _with_priority(_logger: object, method: str, line: object) -> str:
    """Add the priority that `journalctl -p` reads to a log line (sd-daemon(3))."""
    priority = PRIORITIES.get(method, PRIORITIES["info"])
    return f"<{priority}>{line}"


def _complain(error: UserError) -> int:
    print(error, file=sys.stderr)  # noqa: T201 (for the user, not a log)
    return 2
