"""A trace or capture on disk: it ends where the disk is full, and the car goes on."""

import io
from pathlib import Path

import structlog
from typing_extensions import Buffer, override

from onboard.errors import UserError

log = structlog.get_logger()


class TraceFile(io.FileIO):
    """Written through at once; after the first error nothing more is written."""

    def __init__(self, path: Path) -> None:
        """Make the file, or empty it.

        Raises:
            UserError: it cannot be made.
        """
        try:
            super().__init__(path, "wb")
        except OSError as error:
            raise UserError(f"trace: {path}: {error.strerror}") from error
        self._is_given_up = False

    @override
    def write(self, data: Buffer, /) -> int:
        if self._is_given_up:
            return 0
        try:
            return super().write(data)
        except OSError as error:
            self._is_given_up = True
            log.error("no more is traced", file=str(self.name), reason=error.strerror)  # noqa: TRY400 (the disk is full, not the program wrong)
            return 0
