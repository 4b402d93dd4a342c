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
"""Name of the metadata record that every segment begins with."""
IMAGES: Final = "/camera"
_PICTURE_SCHEMA = {
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
"""Foxglove's own schema, by whose name it knows a picture."""


class Segment:
    """A file that is being written. Everything may raise `OSError`."""

    def __init__(self, path: Path, head: RecordingHeader, number: int) -> None:
        """Make the file, readable by its owner only, with all that a reader must know first."""
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
                {"format": str(FORMAT), "segment": str(number), "head": head.model_dump_json()},
            )
            self.flush()
            _sync_folder(path.parent)
        except OSError:
            self.abandon()
            path.unlink()
            raise

    @property
    def size_bytes(self) -> int:
        """As it is on disk."""
        return self._file.tell()

    def add(self, note: RecordedMessage) -> None:
        """Append a note; it is safe after the next `flush`."""
        stamp_ns = round(note.utc_s * 1e9)
        channel = self._channels.get(note.topic)
        if channel is None:
            channel = self._channels[note.topic] = self._new_channel(note)
        data = as_json(_record(note)).encode()
        self._writer.add_message(channel, stamp_ns, data, publish_time=stamp_ns)

    def flush(self) -> None:
        """Bring everything onto the disk, so that a power cut does not take it."""
        self._writer.flush()  # type: ignore[no-untyped-call]  # mcap's omission
        os.fsync(self._file.fileno())

    def close(self) -> None:
        """Finish the file: what readers need to find their way in it comes at its end."""
        try:
            self._writer.finish()  # type: ignore[no-untyped-call]  # mcap's omission
            self._file.flush()
            os.fsync(self._file.fileno())
        finally:
            self._file.close()

    def abandon(self) -> None:
        """Close the file as it is, on a disk that takes no more."""
        with contextlib.suppress(OSError):  # what was buffered does not fit; closed it is
            self._file.close()

    def _new_channel(self, note: RecordedMessage) -> int:
        schema = schema_of(type(note.value))
        schema_id = self._writer.register_schema(
            schema["title"], "jsonschema", json.dumps(schema).encode()
        )
        return self._writer.register_channel(note.topic, "json", schema_id)


def _record(note: RecordedMessage) -> dict[str, Any]:
    if not isinstance(note.value, CameraImage):
        return as_record(note.value)
    seconds, fraction = divmod(note.utc_s, 1.0)
    return {
        "timestamp": {"sec": int(seconds), "nsec": int(fraction * 1e9)},
        "frame_id": "camera",
        "data": base64.b64encode(note.value.jpeg).decode(),
        "format": "jpeg",
    }


@cache
def schema_of(value_type: type) -> dict[str, Any]:
    """The JSON schema of what a value of this type is written as."""
    if value_type is CameraImage:
        return _PICTURE_SCHEMA
    try:
        schema = TypeAdapter(value_type).json_schema(mode="serialization")
    except (PydanticInvalidForJsonSchema, PydanticSchemaGenerationError):
        schema = {"title": value_type.__name__, "type": "object", "properties": {}}
    schema["properties"] |= {"kind": {"type": "string"}}
    return schema


def is_being_written(path: Path) -> bool:
    """Whether a black box, in this process or another, has the file open.

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
    """Make a new name in the folder safe."""
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
