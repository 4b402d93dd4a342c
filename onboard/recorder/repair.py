"""Finishes segments that a power cut left without an index, so that any MCAP reader opens them."""

import contextlib
import os
from collections.abc import Iterable
from pathlib import Path
from typing import BinaryIO

from mcap.records import Channel, McapRecord, Message, Metadata, Schema
from mcap.writer import CompressionType, Writer

from onboard.recorder.reader import RecordingError, is_finished, raw_records
from onboard.recorder.retention import segments_in
from onboard.recorder.segment import is_being_written


def repair(folder: Path, except_for: Path) -> None:
    """Rewrite every unfinished segment in `folder`, up to the point where it was cut off.

    A segment that cannot be read or rewritten is left as it is, until the next start.
    """
    for path in sorted(segments_in(folder)):
        with contextlib.suppress(OSError):
            if path != except_for and not is_being_written(path) and not is_finished(path):
                repair_segment(path)


def repair_segment(path: Path) -> None:
    """Finish one segment, or delete it if it was cut off before its header.

    Raises:
        OSError: it cannot be read, or the disk is full; the segment stays as it is.
    """
    try:
        records = list(raw_records(path))
    except RecordingError:
        return  # not a segment
    if not any(isinstance(record, Metadata) for record in records):
        path.unlink()
        return
    repaired = path.with_suffix(".repairing")
    written = path.stat()
    try:
        repaired.unlink(missing_ok=True)  # of an attempt that was cut off, or a link to elsewhere
        descriptor = os.open(repaired, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
        with os.fdopen(descriptor, "wb") as file:
            write_records(records, file)
            file.flush()
            os.fsync(descriptor)
    except OSError:
        repaired.unlink(missing_ok=True)
        raise
    os.utime(repaired, ns=(written.st_atime_ns, written.st_mtime_ns))
    repaired.replace(path)


def write_records(records: Iterable[McapRecord], file: BinaryIO) -> None:
    """Write records as a finished file."""
    writer = Writer(file, compression=CompressionType.ZSTD)
    writer.start(profile="", library="onboard")
    schemas: dict[int, int] = {}
    channels: dict[int, int] = {}
    for record in records:
        match record:
            case Metadata():
                writer.add_metadata(record.name, record.metadata)
            case Schema():
                new_id = writer.register_schema(record.name, record.encoding, record.data)
                schemas[record.id] = new_id
            case Channel():
                schema = schemas[record.schema_id]
                new_id = writer.register_channel(record.topic, record.message_encoding, schema)
                channels[record.id] = new_id
            case Message():
                channel = channels[record.channel_id]
                writer.add_message(channel, record.log_time, record.data, record.publish_time)
    writer.finish()  # type: ignore[no-untyped-call]  # mcap's omission
