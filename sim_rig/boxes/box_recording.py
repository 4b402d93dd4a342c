"""The black box of a box, read after a run as the trace of its car."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from onboard.errors import UserError
from onboard.recorder.header import RecordingHeader
from onboard.recorder.reader import RecordedDrive
from onboard.recorder.retention import KEPT, segments_in
from onboard.recorder.segment import IMAGES, LOCATIONS
from sim_rig.run_log.run_log import Record

_WSM_IN, _WSM_OUT, _STEP = "/in/wsm", "/out/wsm", "/in/step"
_UNTRACED = frozenset({"wsm", "can", "step", "identity", "brake_button", "program_message"})
"""Kinds that a recording has and a trace has not."""


@dataclass(frozen=True, slots=True)
class BoxRecording:
    """One drive, from a start of the daemon to its end, on the box's clock."""

    files: tuple[Path, ...]
    header: RecordingHeader
    records: list[Record]
    """What its trace would have; names in place of plates."""
    sent: dict[bytes, float]
    """When the box sent each WSM first, s."""
    received: dict[bytes, float]
    """When the box received each WSM first, s."""
    utc_offset_s: float | None
    """UTC minus the clock of the cores at the end of the drive, s; `None` if never known."""


def read_box_recordings(folder: Path) -> Iterator[BoxRecording]:
    """Yield the drives in `folder`, the newest first; each is read when it is asked for.

    Raises:
        UserError: there is none, or one cannot be read.
    """
    files = sorted(segments_in(folder))
    if not files:
        raise UserError(f"{folder}: no recording; the box needs `recorder.folder`")
    for drive in sorted({_drive_of(file) for file in files}, reverse=True):
        yield _read(tuple(file for file in files if _drive_of(file) == drive))


def _read(files: tuple[Path, ...]) -> BoxRecording:
    records: list[Record] = []
    sent: dict[bytes, float] = {}
    received: dict[bytes, float] = {}
    utc_offset_s = None
    drive = RecordedDrive(files)
    for entry in drive.entries():
        record = entry.record
        if entry.topic in (_WSM_IN, _WSM_OUT):
            frames = received if entry.topic == _WSM_IN else sent
            frames.setdefault(bytes.fromhex(record["data"]), record["stamp_s"])
        elif entry.topic == _STEP and record["utc_s"] is not None:
            utc_offset_s = record["utc_s"] - record["stamp_s"]
        elif entry.topic not in (IMAGES, LOCATIONS) and record["kind"] not in _UNTRACED:
            records.append(record)
    return BoxRecording(files, drive.header, records, sent, received, utc_offset_s)


def _drive_of(file: Path) -> str:
    """Name of the drive: `<drive>-<number>.mcap`, or `<drive>-<number>-kept.mcap`."""
    return file.stem.removesuffix(KEPT).rpartition("-")[0]
