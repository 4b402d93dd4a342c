"""Retention of segments: by age and total size; segments near an event are kept longer."""

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from onboard.recorder.settings import RecorderSettings

KEPT = "-kept"
"""Suffix of the name of a segment near an event."""
LEAST_FREE_MIB = 16
"""Kept free on the disk, for what is written until the next look."""
_NAME = re.compile(rf"\d{{8}}T\d{{6}}\.\d{{3}}Z-\d{{4,}}({KEPT})?\.mcap")
"""Drive and segment number; other files in the folder are ignored."""


def segments_in(folder: Path) -> Iterator[Path]:
    """Return the files of the folder that a black box has written."""
    return (path for path in folder.glob("*.mcap") if _NAME.fullmatch(path.name) and path.is_file())


@dataclass(frozen=True, slots=True)
class StoredSegment:
    """A finished segment."""

    path: Path
    until_utc_s: float
    """End in s since 1970."""
    size_bytes: int

    @property
    def is_kept(self) -> bool:
        """Whether it is near an event."""
        return self.path.stem.endswith(KEPT)


def kept_path(path: Path) -> Path:
    """Return the path with the suffix of segments near an event."""
    return path if path.stem.endswith(KEPT) else path.with_stem(path.stem + KEPT)


def segments_to_delete(
    stored: Iterable[StoredSegment],
    writing_bytes: int,
    disk_bytes: int,
    settings: RecorderSettings,
    utc_s: float | None,
) -> list[Path]:
    """Return the segments to delete: those too old, then the oldest until the rest fits.

    Segments near an event are deleted last.

    Args:
        stored: the finished segments.
        writing_bytes: size of the segment that is being written.
        disk_bytes: what is free on the disk.
        settings: limits of age and total size.
        utc_s: present time in s since 1970; `None` if the clock is in doubt: no age is known.
    """
    oldest_first = sorted(stored, key=lambda each: (each.is_kept, each.until_utc_s))
    used_bytes = writing_bytes + sum(each.size_bytes for each in oldest_first)
    free_bytes = min(settings.ring_mib * 2**20 - used_bytes, disk_bytes - LEAST_FREE_MIB * 2**20)
    deleted: list[Path] = []
    for each in oldest_first:
        lifetime_s = settings.kept_ring_s if each.is_kept else settings.ring_s
        is_old = utc_s is not None and each.until_utc_s < utc_s - lifetime_s
        if free_bytes < 0 or is_old:
            deleted.append(each.path)
            free_bytes += each.size_bytes
    return deleted
