"""The folder of the black box: one segment being written, and those before it, as the ring says."""

import time
from pathlib import Path

from onboard.recorder.head import Head
from onboard.recorder.notes import Identity, Note
from onboard.recorder.ring import Stored, kept_path, to_delete
from onboard.recorder.segment import Segment
from onboard.recorder.settings import RecorderSettings
from onboard.risk.alarm import Alarm, Level

KEEPING = frozenset({"/out/warning", "/out/hard_brake", "/in/hard_brake", "/in/button"})
"""What the minutes around it are kept for, beside the alarms that are warnings."""


class Segments:
    """Writes a drive. Everything may raise `OSError`, after which only `abandon` is left to do."""

    def __init__(self, settings: RecorderSettings, head: Head) -> None:
        self._settings = settings
        self._head = head
        self._next_number = 0
        self._segment: Segment | None = None
        self._began_at = 0.0
        self._ended: list[tuple[float, Path]] = []
        self._keep_until = float("-inf")
        self._identities: dict[tuple[str, int], Note] = {}

    @property
    def path(self) -> Path:
        """Of the segment that is being written."""
        return self._open_segment().path

    def open(self, now: float) -> None:
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
            self._segment.add(identity)

    def write(self, note: Note) -> None:
        """Append to the segment, or to the next one when its time is over."""
        now = note.value.stamp_s
        segment = self._open_segment()
        if now - self._began_at >= self._settings.segment_s:
            self.close(now)
            self.open(now)
            segment = self._open_segment()
        segment.add(note)
        if isinstance(note.value, Identity):
            self._remember(note, note.value)
        elif is_event(note):
            self._keep_around(now)

    def flush(self) -> None:
        """Bring everything onto the disk."""
        self._open_segment().flush()

    def close(self, now: float) -> None:
        """Finish the segment."""
        segment = self._open_segment()
        segment.close()
        self._ended.append((now, segment.path))
        self._segment = None

    def abandon(self, now: float) -> None:
        """Leave the segment as it is, on a disk that takes no more."""
        if self._segment is not None:
            self._segment.abandon()
            self._ended.append((now, self._segment.path))
            self._segment = None

    def make_room(self, now: float) -> None:
        """Delete what the ring gives up."""
        utc_s = time.time()
        # The clock may have been set since a segment ended: those of this drive go by the cores'.
        ended = {path: utc_s - (now - at) for at, path in self._ended}
        stored = []
        for path in self._settings.folder.glob("*.mcap"):
            if self._segment is None or path != self._segment.path:
                status = path.stat()
                until_utc_s = ended.get(path, status.st_mtime)
                stored.append(Stored(path, until_utc_s, status.st_size))
        writing_bytes = self._segment.size_bytes if self._segment is not None else 0
        for path in to_delete(stored, writing_bytes, self._settings, utc_s):
            path.unlink(missing_ok=True)
        self._ended = [each for each in self._ended if each[1].exists()]

    def _open_segment(self) -> Segment:
        assert self._segment is not None  # noqa: S101 (`open` comes first)
        return self._segment

    def _remember(self, note: Note, identity: Identity) -> None:
        """Every segment says again which IDs hold, so that the cars in it are known apart."""
        self._identities[identity.plate, identity.epoch] = note
        for known in [known for known in self._identities if known[1] < identity.epoch - 1]:
            del self._identities[known]

    def _keep_around(self, now: float) -> None:
        self._keep_until = now + self._settings.keep_s
        segment = self._open_segment()
        segment.path = _kept(segment.path)
        since = now - self._settings.keep_s
        self._ended = [(at, _kept(path) if at > since else path) for at, path in self._ended]


def is_event(note: Note) -> bool:
    """Whether something happened that the minutes around it are kept for."""
    value = note.value
    return note.topic in KEEPING or (isinstance(value, Alarm) and value.level is Level.WARNING)


def _kept(path: Path) -> Path:
    kept = kept_path(path)
    return path if kept == path else path.rename(kept)
