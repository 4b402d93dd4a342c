"""Reads a trace while a daemon writes it."""

import os
from pathlib import Path

from sim_rig.run_log.run_log import Record, parse_trace


class TraceReader:
    """Reads the lines that were added to a trace since the last call."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._read = 0
        self._file: int | None = None
        """Inode of the trace that was read last: a daemon that is started anew begins another."""

    def records(self) -> list[Record]:
        """Return the new records; an incomplete last line is left for the next call.

        Raises:
            ValueError: a line is no JSON object.
        """
        try:
            trace = self._path.open("rb")
        except FileNotFoundError:
            return []
        with trace:
            file = os.fstat(trace.fileno()).st_ino
            if file != self._file:
                self._file, self._read = file, 0
            trace.seek(self._read)
            records, size = parse_trace(trace.read())
        self._read += size
        return records
