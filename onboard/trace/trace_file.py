"""A trace or capture on disk; if the disk is full, the file ends and the daemon goes on."""

import contextlib
import io
import os
import stat
from collections.abc import Callable
from pathlib import Path

from typing_extensions import Buffer, override


class TraceFile(io.FileIO):
    """What is written gathers until `flush`; after the first error nothing more is written."""

    def __init__(self, path: Path, on_failure: Callable[[str], None]) -> None:
        """Create the file, or truncate it; only its owner may read it, since it has plates.

        Args:
            path: of the file.
            on_failure: called with the reason at the first error of writing.

        Raises:
            OSError: it cannot be created.
        """
        super().__init__(path, "wb", opener=_open_private)
        self._on_failure = on_failure
        self._has_failed = False
        self._pending = bytearray()

    @override
    def write(self, data: Buffer, /) -> int:
        if self._has_failed:
            return 0
        before = len(self._pending)
        self._pending += data
        return len(self._pending) - before

    @override
    def flush(self) -> None:
        try:
            while self._pending:
                del self._pending[: super().write(self._pending)]
        except OSError as error:
            self._has_failed = True
            self._pending.clear()
            self._on_failure(f"{self.name!s}: {error.strerror}")

    @override
    def close(self) -> None:
        if not self.closed:
            self.flush()
        super().close()


def _open_private(path: str, flags: int) -> int:
    """Open a file for its owner only, also one that others could read; a device stays as it is."""
    descriptor = os.open(path, flags, 0o600)
    if stat.S_ISREG(os.fstat(descriptor).st_mode):
        with contextlib.suppress(PermissionError):  # of another owner, who decides
            os.fchmod(descriptor, 0o600)
    return descriptor
