"""Reads segments: finished ones, and unfinished or damaged ones up to the last valid record."""

import json
import struct
import zlib
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import zstandard
from mcap.exceptions import InvalidMagic, McapError
from mcap.records import Channel, Chunk, McapRecord, Message, Metadata
from mcap.stream_reader import CRCValidationError, StreamReader, breakup_chunk

from onboard.errors import UserError
from onboard.recorder.build import present_build
from onboard.recorder.header import FORMAT, RecordingHeader
from onboard.recorder.migrations import OLDEST, migrated, migrated_header
from onboard.recorder.segment import METADATA
from onboard.settings import SettingsError, parse_settings
from onboard.trace.trace_line import as_json

LARGEST_RECORD = 64 * 2**20
"""Longest valid record in bytes, and longest chunk when decompressed; chunks have about 100 KiB, or
1 MiB with images."""
_CUT = (
    McapError, CRCValidationError, struct.error, zstandard.ZstdError, zlib.error, ValueError,
    MemoryError, OverflowError,
)  # fmt: skip
"""Errors of the library on missing or damaged bytes, also of lengths that no file has."""


class RecordingError(UserError):
    """The recording cannot be read or used; the message names the file."""


@dataclass(frozen=True, slots=True)
class Entry:
    """One record of a recording."""

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
    """Yield the MCAP records of a file, up to where it was cut off or damaged.

    Raises:
        RecordingError: it cannot be opened, is no MCAP file, or has a chunk that is longer than
            `LARGEST_RECORD` when decompressed.
    """
    try:
        with path.open("rb") as file:
            reader = StreamReader(
                file, emit_chunks=True, validate_crcs=True, record_size_limit=LARGEST_RECORD
            )
            try:
                for record in reader.records:
                    if isinstance(record, Chunk):
                        _require_bounded(record, path)
                        yield from breakup_chunk(record, validate_crc=True)
                    else:
                        yield record
            except InvalidMagic as error:
                if file.tell() <= len(_MAGIC):
                    what = "no MCAP file (a CAN log is given with --can)"
                    raise RecordingError(f"{path}: {what}") from error
            except _CUT:
                return
    except OSError as error:
        raise RecordingError(f"{path}: {error.strerror}") from error


def _require_bounded(chunk: Chunk, path: Path) -> None:
    """Refuse a chunk before memory is taken for it: by what it says, and what its frame says."""
    size_bytes = chunk.uncompressed_size
    if chunk.compression == "zstd":
        size_bytes = max(size_bytes, zstandard.frame_content_size(chunk.data))
    elif chunk.compression:
        raise RecordingError(f"{path}: chunks compressed by {chunk.compression}, not by zstd")
    if size_bytes > LARGEST_RECORD:
        raise RecordingError(
            f"{path}: a chunk of {size_bytes} bytes when decompressed; at most {LARGEST_RECORD}"
        )


_MAGIC = b"\x89MCAP0\r\n"


def is_finished(path: Path) -> bool:
    """Whether the file was finished by its writer.

    Raises:
        OSError: it cannot be read.
    """
    with path.open("rb") as file:
        file.seek(max(0, path.stat().st_size - len(_MAGIC)))
        return file.read() == _MAGIC


class RecordedDrive:
    """A recording: one or more segments of one drive."""

    def __init__(self, paths: Iterable[Path]) -> None:
        """Read the headers of `paths`: segments in any order, or a folder of them.

        Raises:
            RecordingError: there is no segment, they are of several drives, or of an unsupported
                format. The message names the drives that are there.
        """
        paths = list(paths)
        files = [file for path in paths for file in _segments_in(path)]
        read = [(*_header_of(file), file) for file in files]
        headers = sorted(((n, header, file) for n, header, _, file in read), key=lambda e: e[0])
        if not headers:
            below = sorted({file.parent for path in paths for file in path.glob("*/*.mcap")})
            there = f"; there are some in {', '.join(map(str, below))}" if below else ""
            raise RecordingError(
                f"{', '.join(map(str, paths)) or 'no files'}: no recording found:"
                f" segments are named <drive>-<number>.mcap{there}"
            )
        self.header: RecordingHeader = headers[0][1]
        self.format = read[0][2]
        """Format in which it was written."""
        self.files = [file for _, _, file in headers]
        drives = Counter(file.with_name(f"{header.drive}-*.mcap") for _, header, file in headers)
        if len({header.drive for _, header, _ in headers}) > 1:
            found = ", ".join(f"{drive} ({drives[drive]})" for drive in sorted(drives))
            raise RecordingError(f"segments of several drives; give those of one: {found}")
        numbers = [number for number, _, _ in headers]
        self.begins_late = numbers[0] > 0
        """Whether segments before the first one are missing."""
        self.missing = [n for n in range(numbers[0], numbers[-1]) if n not in numbers]
        """Numbers of the segments missing in between."""

    def entries(self) -> Iterator[Entry]:
        """Yield every record, in the order of writing."""
        for file in self.files:
            channels: dict[int, str] = {}
            for record in raw_records(file):
                if isinstance(record, Channel):
                    channels[record.id] = record.topic
                elif isinstance(record, Message):
                    topic, data = channels[record.channel_id], record.data
                    if self.format < FORMAT and topic.startswith(("/in/", "/out/", "/box/")):
                        topic, fields = migrated(topic, json.loads(data), self.format, FORMAT)
                        data = as_json(fields).encode()
                    yield Entry(topic, record.log_time / 1e9, data)

    def origin(self) -> str:
        """Return which build wrote the recording, and which reads it."""
        return _origin(self.header.software, self.format)


def _segments_in(path: Path) -> list[Path]:
    return sorted(path.glob("*.mcap")) if path.is_dir() else [path]


def _origin(software: object, written: object) -> str:
    return (
        f"written by onboard {software} in format {written}; this is onboard"
        f" {present_build().name}, which reads formats {OLDEST} to {FORMAT}"
    )


def _header_of(file: Path) -> tuple[int, RecordingHeader, int]:
    for record in raw_records(file):
        if isinstance(record, Metadata) and record.name == METADATA:
            written = record.metadata.get("format", "")
            try:
                number, tree = int(record.metadata["segment"]), json.loads(record.metadata["head"])
            except (KeyError, ValueError) as error:
                raise RecordingError(f"{file}: damaged header: {error}") from error
            software = tree.get("software") if isinstance(tree, dict) else None
            if not written.isdecimal() or not OLDEST <= int(written) <= FORMAT:
                raise RecordingError(f"{file}: {_origin(software, written)}")
            tree = migrated_header(tree, int(written), FORMAT)
            try:
                header = parse_settings(tree, RecordingHeader, str(file))
            except SettingsError as error:
                raise RecordingError(f"{error}; {_origin(software, written)}") from error
            return number, header, int(written)
        if isinstance(record, Message):
            break
    raise RecordingError(f"{file}: not a recording of onboard, or cut off before its header")
