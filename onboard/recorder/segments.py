"""Segments of a drive in the folder of the black box: writing, rotation and retention."""

import contextlib
import math
import shutil
from dataclasses import replace
from pathlib import Path

from onboard.recorder.header import RecordingHeader
from onboard.recorder.records import Identity, RecordedMessage
from onboard.recorder.retention import StoredSegment, kept_path, segments_in, segments_to_delete
from onboard.recorder.segment import Segment, is_being_written
from onboard.recorder.settings import RecorderSettings
from onboard.risk.alarm import Alarm, Level

EVENT_TOPICS = frozenset({"/out/warning", "/out/hard_brake", "/in/hard_brake", "/in/brake_button"})
"""Topics of events: segments near one are kept longer. Alarms of level warning are events too."""

RETENTION_INTERVAL_S = 10.0
"""Time between two checks of age and total size of the segments in s."""

CLOCK_STEP_S = 2.0
"""UTC that moves so far against the clock of the cores was set."""

CLOCK_STEADY_S = 120.0
"""Time after UTC was set, and after the start, in which nothing is deleted for its age."""


class Segments:
    """Writes a drive as segments.

    Every method may raise `OSError`, after which only `abandon` may be called. Files that other
    programs delete or move are ignored.
    """

    def __init__(self, settings: RecorderSettings, header: RecordingHeader) -> None:
        self._settings = settings
        self._header = header
        self._next_number = 0
        self._segment: Segment | None = None
        self._began_at = 0.0
        self._ended: list[tuple[float, Path]] = []
        self._keep_until = float("-inf")
        self._identities: dict[tuple[str, int], Identity] = {}
        self._retention_at = 0.0
        self._utc_offset_s = math.inf
        self._clock_set_at = 0.0
        self._unflushed: list[RecordedMessage] = []

    @property
    def path(self) -> Path:
        """Path of the segment that is being written."""
        return self._open_segment().path

    @property
    def unflushed_records(self) -> int:
        """Number of records since the last flush; may be read from any thread."""
        return len(self._unflushed)

    def open(self, now: float, utc_s: float) -> None:
        """Begin a segment at `now`, in s on the clock of the cores."""
        self._apply_retention(now, utc_s)
        name = self._settings.folder / f"{self._header.drive}-{self._next_number:04}.mcap"
        self._segment = Segment(
            kept_path(name) if now < self._keep_until else name,
            self._header,
            self._next_number,
        )
        self._next_number += 1
        self._began_at = now
        for identity in self._identities.values():
            self._segment.add(
                RecordedMessage("/in/identity", utc_s, replace(identity, stamp_s=now))
            )

    def write(self, record: RecordedMessage) -> None:
        """Append to the segment, or to a new one after `segment_s`."""
        now = record.value.stamp_s
        self._unflushed.append(record)
        if now - self._began_at >= self._settings.segment_s:
            self.close(now)
            self._unflushed = [record]  # goes to the next segment
            self.open(now, record.utc_s)
        elif now >= self._retention_at:
            self._apply_retention(now, record.utc_s)
        self._open_segment().add(record)
        if isinstance(record.value, Identity):
            self._repeat_in_segments(record.value)
        elif is_event(record):
            self._keep_near(now)

    def flush(self) -> None:
        """Write everything to the disk, safe from a power cut."""
        self._open_segment().flush()
        self._unflushed = []

    def close(self, now: float) -> None:
        """Finish the segment."""
        segment = self._open_segment()
        segment.close()
        self._unflushed = []
        self._ended.append((now, segment.path))
        self._segment = None

    def abandon(self, now: float) -> list[RecordedMessage]:
        """Close the segment unfinished, after a write error.

        Returns:
            the records that may be lost.
        """
        if self._segment is not None:
            self._segment.abandon()
            self._ended.append((now, self._segment.path))
            self._segment = None
        lost, self._unflushed = self._unflushed, []
        return lost

    def _apply_retention(self, now: float, utc_s: float) -> None:
        """Delete the segments that are too old or exceed the size limit or the disk."""
        # UTC may have been set since a segment ended; for this drive the clock of the cores counts.
        ended = {path: utc_s - (now - at) for at, path in self._ended}
        stored = []
        for path in segments_in(self._settings.folder):
            with contextlib.suppress(FileNotFoundError, PermissionError):
                if not is_being_written(path):
                    status = path.stat()
                    until_utc_s = ended.get(path, status.st_mtime)
                    stored.append(StoredSegment(path, until_utc_s, status.st_size))
        writing_bytes = self._segment.size_bytes if self._segment is not None else 0
        self._receive_clock(now, utc_s)
        is_steady = now - self._clock_set_at >= CLOCK_STEADY_S
        known_utc_s = utc_s if is_steady else None
        disk_bytes = shutil.disk_usage(self._settings.folder).free
        for path in segments_to_delete(
            stored, writing_bytes, disk_bytes, self._settings, known_utc_s
        ):
            path.unlink(missing_ok=True)
        self._retention_at = now + RETENTION_INTERVAL_S
        self._ended = [each for each in self._ended if each[1].exists()]

    def _receive_clock(self, now: float, utc_s: float) -> None:
        """Note when UTC was set: a clock that is a month ahead makes every segment old."""
        if abs(utc_s - now - self._utc_offset_s) > CLOCK_STEP_S:
            self._clock_set_at = now
        self._utc_offset_s = utc_s - now

    def _open_segment(self) -> Segment:
        assert self._segment is not None  # noqa: S101 (`open` comes first)
        return self._segment

    def _repeat_in_segments(self, identity: Identity) -> None:
        """Store the identity: every later segment begins with it and is thus complete."""
        self._identities[identity.plate, identity.epoch] = identity
        for expired in [key for key in self._identities if key[1] < identity.epoch - 1]:
            del self._identities[expired]

    def _keep_near(self, now: float) -> None:
        self._keep_until = now + self._settings.keep_s
        segment = self._open_segment()
        segment.path = _kept(segment.path)
        since = now - self._settings.keep_s
        self._ended = [(at, _kept(path) if at > since else path) for at, path in self._ended]


def is_event(record: RecordedMessage) -> bool:
    """Whether segments near this record are kept longer."""
    value = record.value
    return record.topic in EVENT_TOPICS or (
        isinstance(value, Alarm) and value.level is Level.WARNING
    )


def _kept(path: Path) -> Path:
    kept = kept_path(path)
    with contextlib.suppress(FileNotFoundError):
        path.rename(kept)
    return kept
