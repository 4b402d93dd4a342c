"""Compares what a box decided while a drive was played with what a replay of that drive decides."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from itertools import takewhile
from pathlib import Path

from onboard.errors import UserError
from onboard.recorder.header import RecordingHeader
from onboard.recorder.inputs import as_input
from onboard.recorder.reader import RecordedDrive
from onboard.recorder.segment import IMAGES
from onboard.replay import replay
from onboard.step import ReceivedWsm
from onboard.trace.trace_line import Event, as_record
from sim_rig.boxes.box_recording import BoxRecording
from sim_rig.boxes.played_drive import (
    WIRES,
    PlayedDrive,
    Received,
    own_ids,
    start_on_clock_of,
)
from sim_rig.boxes.player import Played
from sim_rig.run_log.first_difference import RunComparison, compare
from sim_rig.run_log.run_log import Record, RunLog

WITHIN_S = 0.5
"""Times of one decision may differ by this: the box has other phases of requests and images."""
_OF_THE_WIRES = frozenset({"sensor_lost", "sensor_recovered"})
"""Kinds that tell of wires: before a drive is played, nothing is on them."""


@dataclass(frozen=True, slots=True)
class DriveSource:
    """A drive, and how it is replayed."""

    drive: PlayedDrive
    replay: Callable[[], Iterator[Event]]
    """Yields the events of a replay of what is played."""
    header: RecordingHeader | None = None
    """Of a black box recording."""


@dataclass(frozen=True, slots=True)
class BoxDecisions:
    """Outcome of the comparison."""

    replayed: replay.ReplayComparison
    """Of the box's recording with its replay."""
    decisions: RunComparison
    """Of a replay of the drive with what the box decided."""


class NotPlayedError(UserError):
    """The recording of the box is of another drive, vehicle or seed than what was played."""


def compare_decisions(
    car: str,
    source: DriveSource,
    recording: BoxRecording,
    played: Played,
) -> BoxDecisions:
    """Compare; the wires' own states count in neither.

    Args:
        car: name of the box.
        source: the drive.
        recording: what the box recorded.
        played: what was played.

    Raises:
        NotPlayedError: the recording is of another drive, or the box has another seed.
        UserError: it cannot be read or replayed.
    """
    box_start_s = start_on_clock_of(_received(recording.files), played.first)
    if box_start_s is None:
        raise NotPlayedError(
            f"no input of the drive has arrived, by the box's recording {recording.header.drive}"
        )
    ids = source.drive.own_ids
    if ids and not ids & own_ids(RecordedDrive(recording.files)):
        raise NotPlayedError("`car.plate` or `security.plate_digest` of the box is not the drive's")
    _require_seed(source, recording.header)
    start_s = source.drive.start_s
    events = takewhile(lambda each: each.stamp_s <= start_s + played.until_s, source.replay())
    of_source = _log(car, map(as_record, events), start_s, played.until_s)
    of_box = _log(car, recording.records, box_start_s, played.until_s)
    return BoxDecisions(
        replay.compare(RecordedDrive(recording.files)), compare(of_source, of_box, WITHIN_S)
    )


def _require_seed(source: DriveSource, box: RecordingHeader) -> None:
    """Raise `NotPlayedError` if the box has asked under other numbers than the drive's vehicle."""
    drive = source.header
    if drive is not None and "camera" in source.drive.wires and box.seed != drive.seed:
        seed = drive.seed[0]
        raise NotPlayedError(
            f"the answers in the drive are to the questions of `seed: {seed}`, which the box's"
            " configuration must have"
        )


def _log(car: str, records: Iterable[Record], start_s: float, until_s: float) -> RunLog:
    kept = [
        record
        for record in records
        if record["kind"] not in _OF_THE_WIRES and record["stamp_s"] <= start_s + until_s
    ]
    return RunLog(start_s, {car: kept}, [], {})


def _received(files: Iterable[Path]) -> Iterator[Received]:
    """Yield the inputs of a recording; those of a camera as what it saw."""
    for entry in RecordedDrive(files).entries():
        wire = WIRES.get(entry.topic) if entry.topic != IMAGES else None
        if entry.topic in ("/in/lead", "/in/plate"):
            wire = "camera"
        if wire is None:
            continue
        value = as_input(entry)
        yield Received(wire, value.data if isinstance(value, ReceivedWsm) else value, value.stamp_s)
