"""`onboard replay`: a recorded drive through the cores."""

from pathlib import Path
from typing import Annotated

import typer

from onboard.errors import UserError
from onboard.observations import Speed
from onboard.recorder.reader import RecordedDrive
from onboard.replay.replay import OTHER_PROCESSOR, play
from onboard.settings import load_settings
from onboard.tools import replay as drive
from onboard.tools.recording_cli import expect
from onboard.trace.trace_line import as_line
from onboard.vehicle.config import CarConfig

_RAW_OPTIONS = "--can, --clip, --gnss and --pcap"
_NO_SPEED = (
    "holds no answer of OBD-II to a request for the speed; if the vehicle sends it by itself, name"
    " its DBC file and signals in a configuration (obd.broadcast), and give that with --config"
)


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
    """Replay a recorded drive: print what was observed and decided. One JSON object a line.

    Give a black box recording (BOX), or any of --can, --clip, --gnss and --pcap together. A clip
    has no time of its own: it starts at the first CAN frame, or else at the first fix or WSM.
    """
    raw = drive.RawRecording(can, clip, fps, gnss, pcap)
    if (box or expected) and raw.sensors():
        raise UserError(f"give either a recording of the black box, or {_RAW_OPTIONS}")
    if box and (config or fps):
        raise UserError("--config and --fps are for other recordings: the black box has its own")
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
    has_speed = False
    for event in drive.in_real_time(events) if realtime else events:
        has_speed |= isinstance(event, Speed)
        typer.echo(as_line(event))
    if can is not None and not has_speed:
        typer.echo(f"{can}: {_NO_SPEED}", err=True)
