"""What a run log has of a box: its black box, with stamps on the rig's clock."""

import asyncio
import shutil
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from onboard.errors import UserError
from onboard.security.security_services import CLOCK_TOLERANCE_S
from sim_rig.boxes.box_recording import BoxRecording, read_box_recording
from sim_rig.boxes.settings import BoxSettings
from sim_rig.run_log.clock_offset import ClockError, ClockOffset, clock_offset
from sim_rig.run_log.run_log import Record

FETCHED_WITHIN_S = 120.0
"""Limit of the command that copies the black box."""
FLUSHED_AFTER_S = 1.0
"""A black box is on disk within this time (`onboard/recorder/black_box.py`)."""


@dataclass(frozen=True, slots=True)
class FramesOfRun:
    """The frames between rig and box in one run, on the rig's clock."""

    from_box: Mapping[bytes, float]
    """When each WSM arrived first, s."""
    to_box: Mapping[bytes, float]
    """When each WSM was first handed over, s."""
    start_s: float
    end_s: float
    utc_offset_s: float
    """UTC minus the rig's clock, s."""

    def during(self, frames: Mapping[bytes, float]) -> Iterator[tuple[bytes, float]]:
        """Yield those of `frames` that are of the scenario's time."""
        return ((wsm, at) for wsm, at in frames.items() if self.start_s <= at <= self.end_s)


@dataclass(frozen=True, slots=True)
class BoxLog:
    """The trace of one box."""

    records: Sequence[Record]
    clock: ClockOffset | None
    why_not_judged: str | None
    """`None` if the trace can be judged."""


async def fetch(car: str, box: BoxSettings) -> None:
    """Run the command that copies the black box, if there is one, `FLUSHED_AFTER_S` after the run.

    Raises:
        UserError: it failed.
    """
    if box.fetch is None:
        return
    box.recording.parent.mkdir(parents=True, exist_ok=True)
    try:
        process = await asyncio.create_subprocess_exec(*box.fetch)
    except OSError as error:
        raise UserError(f"{car}: fetch: {box.fetch[0]}: {error.strerror}") from error
    try:
        code = await asyncio.wait_for(process.wait(), FETCHED_WITHIN_S)
    except TimeoutError:
        process.kill()
        raise UserError(f"{car}: fetch: not done after {FETCHED_WITHIN_S:g} s") from None
    if code != 0:
        raise UserError(f"{car}: fetch: {' '.join(box.fetch)}: exit code {code}")


def box_log(recorded: Path, seen: FramesOfRun, copy_to: Path) -> BoxLog:
    """Read the recording of a box, copy it into the run's folder, and map it to the rig's clock.

    Args:
        recorded: folder of the recording.
        seen: the frames of the run, as the rig saw them.
        copy_to: folder for the recording of this run, for `onboard replay --expect`.
    """
    try:
        recording = read_box_recording(recorded)
    except UserError as error:
        return BoxLog((), None, str(error))
    _copy(recording, copy_to)
    lost = [at for wsm, at in seen.during(seen.from_box) if wsm not in recording.sent]
    if lost:
        spoken = f"from {lost[0] - seen.start_s:.1f} to {lost[-1] - seen.start_s:.1f} s"
        return BoxLog(
            (),
            None,
            f"{len(lost)} frames of the box are not in its recording, {spoken}: it restarted in"
            " the run, its disk was too slow, or this is the recording of another drive",
        )
    try:
        clock = clock_offset(
            [(recording.sent[wsm], at) for wsm, at in seen.during(seen.from_box)],
            [
                (at, recording.received[wsm])
                for wsm, at in seen.during(seen.to_box)
                if wsm in recording.received
            ],
        )
    except ClockError as error:
        return BoxLog((), None, f"its clock cannot be compared: {error}")
    return BoxLog(
        [{**each, "stamp_s": each["stamp_s"] + clock.offset_s} for each in recording.records],
        clock,
        _wrong_utc(recording, clock, seen.utc_offset_s),
    )


def _wrong_utc(recording: BoxRecording, clock: ClockOffset, utc_offset_s: float) -> str | None:
    """Return a sentence if the box's UTC differs so much that its messages are refused."""
    if recording.utc_offset_s is None:
        return "it had no UTC time"
    ahead_s = recording.utc_offset_s - clock.offset_s - utc_offset_s
    if abs(ahead_s) <= CLOCK_TOLERANCE_S:
        return None
    return f"its UTC is {ahead_s:+.1f} s from the rig's; {CLOCK_TOLERANCE_S:g} s are allowed"


def _copy(recording: BoxRecording, folder: Path) -> None:
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    for file in recording.files:
        shutil.copy2(file, folder)
