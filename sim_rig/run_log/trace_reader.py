"""Reads a trace while a daemon writes it."""

import json
from pathlib import Path

from sim_rig.run_log.run_log import Record


class TraceReader:
    """Reads the lines that were added to a trace since the last call."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._read = 0

    def records(self) -> list[Record]:
        """Return the new records; an incomplete last line is left for the next call."""
        if not self._path.exists():
            self._read = 0  # a daemon that is started anew begins a new one
            return []
        with self._path.open("rb") as trace:
            trace.seek(self._read)
            data = trace.read()
        complete = data[: data.rfind(b"\n") + 1]
        self._read += len(complete)
        return [json.loads(line) for line in complete.splitlines()]
