"""`sim-rig play`: a recorded drive on the wires of a box, and what the box decided."""

import shutil
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console

from onboard.recorder.reader import RecordedDrive
from onboard.replay import replay
from onboard.settings import SettingsError, load_settings
from onboard.tools.replay import UNCONFIGURED, RawRecording
from onboard.tools.replay import replay as replay_raw
from onboard.vehicle.config import CarConfig
from sim_rig.boxes.box_recording import BoxRecording, read_box_recordings
from sim_rig.boxes.played_decisions import (
    BoxDecisions,
    DriveSource,
    NotPlayedError,
    compare_decisions,
)
from sim_rig.boxes.played_drive import (
    PlayedDrive,
    PlayedEntries,
    of_black_box,
    of_raw_recordings,
)
from sim_rig.boxes.player import Played, play
from sim_rig.boxes.settings import BoxSettings
from sim_rig.boxes.trial_keys import make_keys_of_drive
from sim_rig.reporting.report import lateness_table
from sim_rig.reporting.verdict import Outcome
from sim_rig.runs.ladder import sentence
from sim_rig.runs.terminated import run_until_terminated


def black_box_source(paths: Sequence[Path]) -> DriveSource:
    """Return a black box recording; without pictures, it is replayed without what the camera saw.

    Raises:
        UserError: it cannot be read.
    """
    recorded = RecordedDrive(paths)
    drive = of_black_box(recorded)
    replayed = recorded if "camera" in drive.wires else PlayedEntries(paths)
    return DriveSource(
        drive,
        lambda: (event for step in replay.play(replayed) for event in step.events),
        recorded.header,
    )


def raw_source(raw: RawRecording, config: Path | None) -> DriveSource:
    """Return raw recordings; they are replayed with a configuration, as by `onboard replay`.

    Raises:
        UserError: a file cannot be read.
    """
    car = UNCONFIGURED if config is None else load_settings(config, CarConfig)
    return DriveSource(of_raw_recordings(raw), lambda: replay_raw(raw, car))


def play_drive(source: DriveSource, file: Path, out: Path, seconds: float) -> Outcome:
    """Play a drive on the wires of a box, and print what the box decided.

    Args:
        source: the drive.
        file: of the box; its name without `.yaml` is the car's.
        out: folder of the run's folder.
        seconds: how much of the drive is played at most; `math.inf` for all.

    Raises:
        UserError: a file has mistakes, the drive needs a wire that the box has not, or the box is
            not ready.
    """
    car, box = file.stem, load_settings(file, BoxSettings)
    _require_wires(source.drive, box, file)
    if source.header is not None:
        make_keys_of_drive(box.keys / car, source.header)
    folder = out / f"{car}-played"
    folder.mkdir(parents=True, exist_ok=True)
    console = Console(highlight=False)
    if source.drive.left_out:
        kinds = ", ".join(source.drive.left_out)
        console.print(f"not played, since they are on no wire: {kinds}", soft_wrap=True)
    played = run_until_terminated(play(source.drive, car, box, folder, seconds))
    console.print(lateness_table(played.lateness))
    if played.unasked:
        console.print(f"not played, since the box did not ask: {played.unasked} answers")
    if played.why_not_copied is not None:
        return _invalid(f"not judged: {played.why_not_copied}", console)
    assert box.recording is not None  # noqa: S101 (required above)
    recording = next(read_box_recordings(box.recording))
    _copy(recording, folder / "box" / car)
    try:
        found = compare_decisions(car, source, recording, played)
    except NotPlayedError as error:
        return _invalid(f"not judged: {error}", console)
    _print(found, console)
    if late := _late(played):
        return _invalid(f"the rig was late: {late}", console)
    if found.replayed.difference is not None or found.decisions.first is not None:
        console.print("[red]FAILED[/red] the box decided otherwise than the replay")
        return Outcome.FAILED
    console.print("[green]PASSED[/green] the box decided as the replay")
    return Outcome.PASSED


def _require_wires(drive: PlayedDrive, box: BoxSettings, file: Path) -> None:
    if missing := [wire for wire in sorted(drive.wires) if getattr(box, wire) is None]:
        raise SettingsError(
            f"{file}: {', '.join(missing)}: is required, since the drive has inputs of it"
        )
    if box.recording is None:
        raise SettingsError(f"{file}: recording: is required, since it shows what the box decided")


def _late(played: Played) -> str:
    """What was too late; empty if nothing was."""
    return "; ".join(
        f"{each.what} p99 {each.p99_s * 1e3:.0f} ms, limit {each.limit_s * 1e3:.0f} ms"
        for each in played.lateness
        if each.is_too_late
    )


def _invalid(why: str, console: Console) -> Outcome:
    console.print(f"[yellow]INVALID[/yellow] {why}", soft_wrap=True)
    return Outcome.INVALID


def _copy(recording: BoxRecording, folder: Path) -> None:
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    for file in recording.files:
        shutil.copy(file, folder)


def _print(found: BoxDecisions, console: Console) -> None:
    replayed = found.replayed
    alike = f"{replayed.outputs} outputs of the box in {replayed.until_s:.1f} s replay equal"
    console.print(alike if replayed.difference is None else f"{alike}, then differ", soft_wrap=True)
    console.print(f"replay of the drive, and box: {sentence(found.decisions)}", soft_wrap=True)
