"""One file of a recording: MCAP (mcap.dev), which Foxglove opens, with a JSON schema per topic."""

import base64
import contextlib
import fcntl
import json
import os
from functools import cache
from pathlib import Path
from typing import Any, Final

from mcap.writer import CompressionType, Writer
from pydantic import TypeAdapter
from pydantic.errors import PydanticInvalidForJsonSchema, PydanticSchemaGenerationError

from onboard.recorder.header import FORMAT, RecordingHeader
from onboard.recorder.records import CameraImage, RecordedMessage
from onboard.trace.trace_line import as_json, as_record

METADATA: Final = "onboard"
"""Name of the metadata record at the start of each segment."""
IMAGES: Final = "/camera"
_IMAGE_SCHEMA = {
    "title": "foxglove.CompressedImage",
    "type": "object",
    "properties": {
        "timestamp": {
            "type": "object",
            "title": "time",
            "properties": {"sec": {"type": "integer"}, "nsec": {"type": "integer"}},
        },
        "frame_id": {"type": "string"},
        "data": {"type": "string", "contentEncoding": "base64"},
        "format": {"type": "string"},
    },
}
"""Schema of Foxglove, which shows messages of this schema name as images."""


class Segment:
    """A segment that is being written. Every method may raise `OSError`."""

    def __init__(self, path: Path, header: RecordingHeader, number: int) -> None:
        """Create the file, readable by its owner only, and write the header.

        Args:
            path: the new file.
            header: header of the recording.
            number: number of the segment within the drive, from 0.
        """
        descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
        self.path = path
        self._file = os.fdopen(descriptor, "wb")
        fcntl.flock(descriptor, fcntl.LOCK_EX)  # `is_being_written` sees it
        self._channels: dict[str, int] = {}
        self._writer = Writer(self._file, compression=CompressionType.ZSTD)
        try:
            self._writer.start(profile="", library="onboard")
            self._writer.add_metadata(
                METADATA,
                {"format": str(FORMAT), "segment": str(number), "head": header.model_dump_json()},
            )
            self.flush()
            _sync_folder(path.parent)
        except OSError:
            self.abandon()
            path.unlink()
            raise

    @property
    def size_bytes(self) -> int:
        """Size on disk in bytes."""
        return self._file.tell()

    def add(self, record: RecordedMessage) -> None:
        """Append a record; after the next `flush` it is on the disk."""
        stamp_ns = round(record.utc_s * 1e9)
        channel = self._channels.get(record.topic)
        if channel is None:
            channel = self._channels[record.topic] = self._new_channel(record)
        data = as_json(_record(record)).encode()
        self._writer.add_message(channel, stamp_ns, data, publish_time=stamp_ns)

    def flush(self) -> None:
        """Write everything to the disk, safe from a power cut."""
        self._writer.flush()  # type: ignore[no-untyped-call]  # mcap's omission
        os.fsync(self._file.fileno())

    def close(self) -> None:
        """Finish the file with the index that readers need at its end."""
        try:
            self._writer.finish()  # type: ignore[no-untyped-call]  # mcap's omission
            self._file.flush()
            os.fsync(self._file.fileno())
        finally:
            self._file.close()

    def abandon(self) -> None:
        """Close the file unfinished, after a write error."""
        with contextlib.suppress(OSError):  # buffered data does not fit; the file is closed anyway
            self._file.close()

    def _new_channel(self, record: RecordedMessage) -> int:
        schema = schema_of(type(record.value))
        schema_id = self._writer.register_schema(
            schema["title"], "jsonschema", json.dumps(schema).encode()
        )
        return self._writer.register_channel(record.topic, "json", schema_id)


def _record(record: RecordedMessage) -> dict[str, Any]:
    if not isinstance(record.value, CameraImage):
        return as_record(record.value)
    seconds, fraction = divmod(record.utc_s, 1.0)
    return {
        "timestamp": {"sec": int(seconds), "nsec": int(fraction * 1e9)},
        "frame_id": "camera",
        "data": base64.b64encode(record.value.jpeg).decode(),
        "format": "jpeg",
    }


@cache
def schema_of(value_type: type) -> dict[str, Any]:
    """Return the JSON schema of the records of a type."""
    if value_type is CameraImage:
        return _IMAGE_SCHEMA
    try:
        schema = TypeAdapter(value_type).json_schema(mode="serialization")
    except (PydanticInvalidForJsonSchema, PydanticSchemaGenerationError):
        schema = {"title": value_type.__name__, "type": "object", "properties": {}}
    schema["properties"] |= {"kind": {"type": "string"}}
    return schema


def is_being_written(path: Path) -> bool:
    """Whether a black box of this or another process is writing the file.

    Raises:
        OSError: it cannot be opened.
    """
    with path.open("rb") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
        except BlockingIOError:
            return True
    return False


def _sync_folder(folder: Path) -> None:
    """Write the entries of the folder to the disk, safe from a power cut."""
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
