"""Reads segments back: whole ones, and those that were cut off, up to their end."""

import json
import struct
import zlib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import zstandard
from mcap.exceptions import InvalidMagic, McapError
from mcap.records import Channel, McapRecord, Message, Metadata
from mcap.stream_reader import CRCValidationError, StreamReader

from onboard.errors import UserError
from onboard.recorder.header import FORMAT, RecordingHeader
from onboard.recorder.segment import METADATA
from onboard.settings import parse_settings

LARGEST_RECORD = 64 * 2**20
"""A length beyond this is a broken one; chunks are some 100 KiB, or 1 MiB with pictures."""
_CUT = (McapError, CRCValidationError, struct.error, zstandard.ZstdError, zlib.error, ValueError)
"""What the library says of bytes that are not there, or not what was written."""


class RecordingError(UserError):
    """The recording cannot be read or used; the message names the file."""


@dataclass(frozen=True, slots=True)
class Entry:
    """One message."""

    topic: str
    utc_s: float
    data: bytes
    """JSON."""

    @property
    def record(self) -> dict[str, Any]:
        """The fields."""
        record: dict[str, Any] = json.loads(self.data)
        return record


def raw_records(path: Path) -> Iterator[McapRecord]:
    """Every record of the file, up to where it was cut off or damaged.

    Raises:
        BoxError: it cannot be opened, or is no MCAP.
    """
    try:
        with path.open("rb") as file:
            reader = StreamReader(file, validate_crcs=True, record_size_limit=LARGEST_RECORD)
            try:
                yield from reader.records
            except InvalidMagic as error:
                if file.tell() <= len(_MAGIC):
                    raise RecordingError(f"{path}: no MCAP file") from error
            except _CUT:
                return
    except OSError as error:
        raise RecordingError(f"{path}: {error.strerror}") from error


_MAGIC = b"\x89MCAP0\r\n"


def is_finished(path: Path) -> bool:
    """Whether the file ends as its writer meant it to.

    Raises:
        OSError: it cannot be read.
    """
    with path.open("rb") as file:
        file.seek(max(0, path.stat().st_size - len(_MAGIC)))
        return file.read() == _MAGIC


class RecordedDrive:
    """A recording: one segment, or several of one drive."""

    def __init__(self, paths: Iterable[Path]) -> None:
        """Read the heads of `paths`: segments in any order, or a folder of them.

        Raises:
            BoxError: there are none, they are not of one drive, or not of a format that is read.
        """
        files = [file for path in paths for file in _segments_in(path)]
        headed = sorted(((*_head_of(file), file) for file in files), key=lambda each: each[0])
        if not headed:
            raise RecordingError("no recording there: a segment is called <drive>-<number>.mcap")
        self.head: RecordingHeader = headed[0][1]
        self.files = [file for _, _, file in headed]
        drives = sorted({head.drive for _, head, _ in headed})
        if len(drives) > 1:
            raise RecordingError(
                f"segments of several drives; name those of one: {', '.join(drives)}"
            )
        numbers = [number for number, _, _ in headed]
        self.begins_late = numbers[0] > 0
        """Whether segments before the first one are missing."""
        self.missing = [n for n in range(numbers[0], numbers[-1]) if n not in numbers]
        """Segments that are missing in between."""

    def entries(self) -> Iterator[Entry]:
        """Every message, in the order in which it was written."""
        for file in self.files:
            channels: dict[int, str] = {}
            for record in raw_records(file):
                if isinstance(record, Channel):
                    channels[record.id] = record.topic
                elif isinstance(record, Message):
                    yield Entry(channels[record.channel_id], record.log_time / 1e9, record.data)


def _segments_in(path: Path) -> list[Path]:
    return sorted(path.glob("*.mcap")) if path.is_dir() else [path]


def _head_of(file: Path) -> tuple[int, RecordingHeader]:
    for record in raw_records(file):
        if isinstance(record, Metadata) and record.name == METADATA:
            written = record.metadata.get("format")
            if written != str(FORMAT):
                raise RecordingError(
                    f"{file}: was written in format {written}, and this software reads {FORMAT}"
                )
            try:
                number, tree = int(record.metadata["segment"]), json.loads(record.metadata["head"])
            except (KeyError, ValueError) as error:
                raise RecordingError(f"{file}: its head is damaged: {error}") from error
            return number, parse_settings(tree, RecordingHeader, str(file))
        if isinstance(record, Message):
            break
    raise RecordingError(f"{file}: no recording of onboard's, or cut off before it began")
