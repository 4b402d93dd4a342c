"""The folder of the black box: one segment being written, and those before it, as the ring says."""

import contextlib
import time
from dataclasses import replace
from pathlib import Path

from onboard.recorder.header import RecordingHeader
from onboard.recorder.records import Identity, RecordedMessage
from onboard.recorder.retention import Stored, kept_path, segments_in, to_delete
from onboard.recorder.segment import Segment, is_being_written
from onboard.recorder.settings import RecorderSettings
from onboard.risk.alarm import Alarm, Level

KEEPING = frozenset({"/out/warning", "/out/hard_brake", "/in/hard_brake", "/in/brake_button"})
"""What the minutes around it are kept for, beside the alarms that are warnings."""

MAKE_ROOM_S = 10.0
"""How often it is looked whether all segments still fit."""


class Segments:
    """Writes a drive. Everything may raise `OSError`, after which only `abandon` is left to do.

    Files that somebody else takes away are not missed.
    """

    def __init__(self, settings: RecorderSettings, head: RecordingHeader) -> None:
        self._settings = settings
        self._head = head
        self._next_number = 0
        self._segment: Segment | None = None
        self._began_at = 0.0
        self._ended: list[tuple[float, Path]] = []
        self._keep_until = float("-inf")
        self._identities: dict[tuple[str, int], Identity] = {}
        self._make_room_at = 0.0
        self._unsafe: list[RecordedMessage] = []

    @property
    def path(self) -> Path:
        """Of the segment that is being written."""
        return self._open_segment().path

    @property
    def unsafe_notes(self) -> int:
        """How many the disk has not confirmed; from any thread."""
        return len(self._unsafe)

    def open(self, now: float, utc_s: float) -> None:
        """Begin a segment at `now`, on the cores' clock."""
        self.make_room(now)
        name = self._settings.folder / f"{self._head.drive}-{self._next_number:04}.mcap"
        self._segment = Segment(
            kept_path(name) if now < self._keep_until else name,
            self._head,
            self._next_number,
        )
        self._next_number += 1
        self._began_at = now
        for identity in self._identities.values():
            self._segment.add(
                RecordedMessage("/in/identity", utc_s, replace(identity, stamp_s=now))
            )

    def write(self, note: RecordedMessage) -> None:
        """Append to the segment, or to the next one when its time is over."""
        now = note.value.stamp_s
        self._unsafe.append(note)
        if now - self._began_at >= self._settings.segment_s:
            self.close(now)
            self._unsafe = [note]  # the next segment's
            self.open(now, note.utc_s)
        elif now >= self._make_room_at:
            self.make_room(now)
        self._open_segment().add(note)
        if isinstance(note.value, Identity):
            self._remember(note.value)
        elif is_event(note):
            self._keep_around(now)

    def flush(self) -> None:
        """Bring everything onto the disk."""
        self._open_segment().flush()
        self._unsafe = []

    def close(self, now: float) -> None:
        """Finish the segment."""
        segment = self._open_segment()
        segment.close()
        self._unsafe = []
        self._ended.append((now, segment.path))
        self._segment = None

    def abandon(self, now: float) -> list[RecordedMessage]:
        """Leave the segment as it is, on a disk that takes no more.

        Returns:
            the notes that may not have come onto the disk.
        """
        if self._segment is not None:
            self._segment.abandon()
            self._ended.append((now, self._segment.path))
            self._segment = None
        lost, self._unsafe = self._unsafe, []
        return lost

    def make_room(self, now: float) -> None:
        """Delete what the ring gives up."""
        utc_s = time.time()
        # The clock may have been set since a segment ended: those of this drive go by the cores'.
        ended = {path: utc_s - (now - at) for at, path in self._ended}
        stored = []
        for path in segments_in(self._settings.folder):
            with contextlib.suppress(FileNotFoundError, PermissionError):
                if not is_being_written(path):
                    status = path.stat()
                    until_utc_s = ended.get(path, status.st_mtime)
                    stored.append(Stored(path, until_utc_s, status.st_size))
        writing_bytes = self._segment.size_bytes if self._segment is not None else 0
        for path in to_delete(stored, writing_bytes, self._settings, utc_s):
            path.unlink(missing_ok=True)
        self._make_room_at = now + MAKE_ROOM_S
        self._ended = [each for each in self._ended if each[1].exists()]

    def _open_segment(self) -> Segment:
        assert self._segment is not None  # noqa: S101 (`open` comes first)
        return self._segment

    def _remember(self, identity: Identity) -> None:
        """Every segment says again which IDs hold, so that the cars in it are known apart."""
        self._identities[identity.plate, identity.epoch] = identity
        for known in [known for known in self._identities if known[1] < identity.epoch - 1]:
            del self._identities[known]

    def _keep_around(self, now: float) -> None:
        self._keep_until = now + self._settings.keep_s
        segment = self._open_segment()
        segment.path = _kept(segment.path)
        since = now - self._settings.keep_s
        self._ended = [(at, _kept(path) if at > since else path) for at, path in self._ended]


def is_event(note: RecordedMessage) -> bool:
    """Whether something happened that the minutes around it are kept for."""
    value = note.value
    return note.topic in KEEPING or (isinstance(value, Alarm) and value.level is Level.WARNING)


def _kept(path: Path) -> Path:
    kept = kept_path(path)
    with contextlib.suppress(FileNotFoundError):
        path.rename(kept)
    return kept
