"""What a run log has of a box: its black box, with stamps on the rig's clock."""

import shutil
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

from onboard.errors import UserError
from onboard.recorder.header import RecordingHeader
from onboard.security.security_services import CLOCK_TOLERANCE_S
from sim_rig.boxes.box_computer import TimeWithoutPower
from sim_rig.boxes.box_recording import BoxRecording, read_box_recordings
from sim_rig.run_log.clock_offset import ClockError, ClockOffset, clock_offset
from sim_rig.run_log.run_log import Record

FLUSHED_AFTER_S = 1.0
"""A black box is on disk within this time (`onboard/recorder/black_box.py`)."""
_IN_TRANSIT_S = 0.5
"""Frames arrive within this time after they were sent."""
_BEGUN_WITHIN_S = 1.0
"""A drive with a frame of the run's first second is the one that the run began with."""
_MOST_DRIVES = 8
"""Drives that are read, the newest first."""


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
    power_cuts: Sequence[TimeWithoutPower] = ()

    def during(self, frames: Mapping[bytes, float]) -> Iterator[tuple[bytes, float]]:
        """Yield those of `frames` that are of the scenario's time."""
        return ((wsm, at) for wsm, at in frames.items() if self.start_s <= at <= self.end_s)

    def first_at_s(self, drive: BoxRecording) -> float | None:
        """Time of the first frame that a drive shares with the run; `None` if there is none."""
        sent = (at for wsm, at in self.during(self.from_box) if wsm in drive.sent)
        received = (at for wsm, at in self.during(self.to_box) if wsm in drive.received)
        return min((*sent, *received), default=None)

    def is_lost_with_power(self, at_s: float) -> bool:
        """Whether a frame of the box at `at_s` may be missing, since its disk had no power."""
        return any(cut.cut_s - FLUSHED_AFTER_S <= at_s <= cut.restored_s for cut in self.power_cuts)

    def without_power(self) -> list[float]:
        """Return when frames of the box arrived while it must have had no power, s."""
        return [
            at
            for _, at in self.during(self.from_box)
            for cut in self.power_cuts
            if cut.off_s + _IN_TRANSIT_S < at < cut.restored_s
        ]


@dataclass(frozen=True, slots=True)
class BoxLog:
    """The trace of one box."""

    records: Sequence[Record]
    clocks: tuple[ClockOffset, ...]
    """Of each start in the run."""
    why_not_judged: str | None
    """`None` if the trace can be judged."""
    notes: tuple[str, ...] = ()
    """What of the box is not as in a process of its car."""
    build: str | None = None
    """Of its `onboard`; `None` without a recording."""


def box_log(
    recorded: Path,
    seen: FramesOfRun,
    copy_to: Path,
    different: Callable[[RecordingHeader], Iterable[str]] = lambda _header: (),
) -> BoxLog:
    """Read the recording of a box, copy it into the run's folder, and map it to the rig's clock.

    Args:
        recorded: folder of the recording.
        seen: the frames of the run, as the rig saw them.
        copy_to: folder for the recording of this run, for `onboard replay --expect`.
        different: what of a configuration is not as in a process.
    """
    try:
        drives = _drives_of_run(recorded, seen)
    except UserError as error:
        return BoxLog((), (), str(error))
    _copy(drives, copy_to)
    if (why := _why_incomplete(drives, seen)) is not None:
        return BoxLog((), (), why)
    try:
        clocks = tuple(_clock(drive, seen) for drive in drives)
    except ClockError as error:
        return BoxLog((), (), f"its clock cannot be compared: {error}")
    wrong = (
        _wrong_utc(drive, clock, seen.utc_offset_s)
        for drive, clock in zip(drives, clocks, strict=True)
    )
    return BoxLog(
        [
            {**each, "stamp_s": each["stamp_s"] + clock.offset_s}
            for drive, clock in zip(drives, clocks, strict=True)
            for each in drive.records
        ],
        clocks,
        next((why for why in wrong if why is not None), None),
        tuple(different(drives[-1].header)),
        drives[-1].header.software,
    )


def other_identity(
    records: Iterable[Record], own_ids: Collection[str], start_s: float
) -> str | None:
    """Return a sentence if a box sends under communication IDs that are not of its car.

    Args:
        records: the trace of the box, whose drive may have begun long before the run.
        own_ids: the IDs of its car in the run, hex.
        start_s: stamp of the start of the scenario, s.
    """
    sent = {
        record["content"]["sender_id"]
        for record in records
        if record["kind"] == "sent"
        and record["stamp_s"] >= start_s
        and "sender_id" in record["content"]
    }
    if not sent or sent & set(own_ids):
        return None
    return (
        f"it sends as {', '.join(sorted(sent))}, which is not of the scenario's plate: `car.plate`"
        " or `security.plate_digest` of the box is another"
    )


def _drives_of_run(folder: Path, seen: FramesOfRun) -> list[BoxRecording]:
    """Return the drives that share a frame with the run, in order; the newest one if none does."""
    found: list[BoxRecording] = []
    newest: BoxRecording | None = None
    for drive in islice(read_box_recordings(folder), _MOST_DRIVES):
        newest = newest or drive
        first_s = seen.first_at_s(drive)
        if first_s is not None:
            found.insert(0, drive)
            if first_s < seen.start_s + _BEGUN_WITHIN_S:
                break
    return found or [newest] if newest is not None else []


def _why_incomplete(drives: Sequence[BoxRecording], seen: FramesOfRun) -> str | None:
    """Return a sentence if the drives are not all that the box did in the run."""
    if too_late := seen.without_power():
        return (
            f"{len(too_late)} frames of it arrived after `power.cut` and before `power.restore`,"
            f" {_span(too_late, seen)}: the command does not cut its power"
        )
    starts = [at for at in map(seen.first_at_s, drives[1:]) if at is not None]
    if len(starts) > len(seen.power_cuts):
        asked = f"; asked for: {len(seen.power_cuts)}" if seen.power_cuts else ", unasked"
        return f"it restarted in the run, {_span(starts, seen)}{asked}"
    lost = [
        at
        for wsm, at in seen.during(seen.from_box)
        if not any(wsm in drive.sent for drive in drives) and not seen.is_lost_with_power(at)
    ]
    if not lost:
        return None
    return (
        f"{len(lost)} frames of the box are not in its recording, {_span(lost, seen)}: it restarted"
        " in the run, its disk was too slow, or this is the recording of another drive"
    )


def _span(at_s: Sequence[float], seen: FramesOfRun) -> str:
    first_s, last_s = at_s[0] - seen.start_s, at_s[-1] - seen.start_s
    return f"from {first_s:.1f} to {last_s:.1f} s" if len(at_s) > 1 else f"at {first_s:.1f} s"


def _clock(drive: BoxRecording, seen: FramesOfRun) -> ClockOffset:
    return clock_offset(
        [(drive.sent[wsm], at) for wsm, at in seen.during(seen.from_box) if wsm in drive.sent],
        [
            (at, drive.received[wsm])
            for wsm, at in seen.during(seen.to_box)
            if wsm in drive.received
        ],
    )


def _wrong_utc(recording: BoxRecording, clock: ClockOffset, utc_offset_s: float) -> str | None:
    """Return a sentence if the box's UTC differs so much that its messages are refused."""
    if recording.utc_offset_s is None:
        return "it had no UTC time"
    ahead_s = recording.utc_offset_s - clock.offset_s - utc_offset_s
    if abs(ahead_s) <= CLOCK_TOLERANCE_S:
        return None
    return f"its UTC is {ahead_s:+.1f} s from the rig's; {CLOCK_TOLERANCE_S:g} s are allowed"


def _copy(recordings: Sequence[BoxRecording], folder: Path) -> None:
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    for recording in recordings:
        for file in recording.files:
            shutil.copy2(file, folder)
