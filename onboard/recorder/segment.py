"""One file of a recording: MCAP (mcap.dev), which Foxglove opens, with a JSON schema per topic."""

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

from onboard.observations import Position
from onboard.recorder import foxglove
from onboard.recorder.header import FORMAT, RecordingHeader
from onboard.recorder.records import CameraImage, RecordedMessage
from onboard.trace.trace_line import as_json, as_record

METADATA: Final = "onboard"
"""Name of the metadata record at the start of each segment."""
IMAGES: Final = "/camera"
LOCATIONS: Final = "/location"
"""Topics for viewers, in Foxglove's schemas; a replay does not read them."""


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
        if isinstance(record.value, CameraImage):
            image = foxglove.compressed_image(record.value.jpeg, record.utc_s)
            self._add(record.topic, foxglove.SCHEMAS[foxglove.IMAGE], image, stamp_ns)
            return
        self._add(record.topic, schema_of(type(record.value)), as_record(record.value), stamp_ns)
        if isinstance(record.value, Position):
            fix = foxglove.location_fix(record.value, record.utc_s)
            self._add(LOCATIONS, foxglove.SCHEMAS[foxglove.LOCATION], fix, stamp_ns)

    def _add(
        self, topic: str, schema: dict[str, Any], message: dict[str, Any], stamp_ns: int
    ) -> None:
        channel = self._channels.get(topic)
        if channel is None:
            channel = self._channels[topic] = self._new_channel(topic, schema)
        data = as_json(message).encode()
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

    def _new_channel(self, topic: str, schema: dict[str, Any]) -> int:
        schema_id = self._writer.register_schema(
            schema["title"], "jsonschema", json.dumps(schema).encode()
        )
        return self._writer.register_channel(topic, "json", schema_id)


@cache
def schema_of(value_type: type) -> dict[str, Any]:
    """Return the JSON schema of the records of a type."""
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
