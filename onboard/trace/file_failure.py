"""A file that the daemon is to write and cannot, by a full, read-only or broken disk.

Warnings come first: the vehicle drives on without the file, and says so.
"""

from dataclasses import dataclass
from enum import StrEnum
from typing import ClassVar


class FileUse(StrEnum):
    """What a file is for."""

    TRACE = "trace"
    CAPTURE = "capture"
    DRIVER = "driver"
    """Keeps the driver model."""


@dataclass(frozen=True, slots=True)
class FileFailure:
    """Nothing more is written to a file; for trace, journal, metrics and the driver's page."""

    kind: ClassVar[str] = "file_failure"
    stamp_s: float
    use: FileUse
    reason: str
    """Names the file."""
