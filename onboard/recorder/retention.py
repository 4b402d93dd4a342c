"""Which segments are kept: the new ones, and those around an event longer; still without I/O."""

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from onboard.recorder.settings import RecorderSettings

KEPT = "-kept"
"""Ends the name of a segment that something happened in."""
_NAME = re.compile(rf"\d{{8}}T\d{{6}}\.\d{{3}}Z-\d{{4,}}({KEPT})?\.mcap")
"""Of a drive and a segment; whatever else lies in the folder is somebody else's."""


def segments_in(folder: Path) -> Iterator[Path]:
    """Yield the files of the folder that a black box has written."""
    return (path for path in folder.glob("*.mcap") if _NAME.fullmatch(path.name) and path.is_file())


@dataclass(frozen=True, slots=True)
class Stored:
    """A finished segment."""

    path: Path
    until_utc_s: float
    size_bytes: int

    @property
    def is_kept(self) -> bool:
        """Whether something happened in it, or near it."""
        return self.path.stem.endswith(KEPT)


def kept_path(path: Path) -> Path:
    """The name that says so."""
    return path if path.stem.endswith(KEPT) else path.with_stem(path.stem + KEPT)


def to_delete(
    stored: Iterable[Stored], writing_bytes: int, settings: RecorderSettings, utc_s: float
) -> list[Path]:
    """What has to go: what is too old, then the oldest until the rest fits, kept ones last.

    `writing_bytes` is the size of the segment that is being written.
    """
    oldest_first = sorted(stored, key=lambda each: (each.is_kept, each.until_utc_s))
    room = settings.ring_mib * 2**20 - writing_bytes - sum(each.size_bytes for each in oldest_first)
    gone: list[Path] = []
    for each in oldest_first:
        lifetime_s = settings.kept_ring_s if each.is_kept else settings.ring_s
        if room < 0 or each.until_utc_s < utc_s - lifetime_s:
            gone.append(each.path)
            room += each.size_bytes
    return gone
