"""Runs the daemon with a UTC clock of its own, which can be set while it runs.

    python -m sim_rig.processes.settable_clock UTC_FILE ARGS...

`onboard` runs unchanged; `time.time` of its process is that of UTC_FILE, which has a UTC in s since
1970, valid when the file was written. Without the file it is that of the computer.
"""

import sys
import time
from pathlib import Path

from onboard.tools.cli import main

_CHECK_INTERVAL_S = 0.1


class SettableClock:
    """UTC clock that follows a file."""

    def __init__(self, file: Path) -> None:
        self._file = file
        self._computer_utc_s = time.time
        self._error_s = 0.0
        self._check_at = 0.0

    def __call__(self) -> float:
        """UTC by this clock, s since 1970."""
        now = time.monotonic()
        if now >= self._check_at:
            self._check_at = now + _CHECK_INTERVAL_S
            self._read()
        return self._computer_utc_s() + self._error_s

    def _read(self) -> None:
        try:
            written_s, text = self._file.stat().st_mtime, self._file.read_text("utf-8")
        except FileNotFoundError:
            return
        if text.strip():  # else it is being written
            self._error_s = float(text) - written_s


if __name__ == "__main__":
    _, utc_file, *arguments = sys.argv
    sys.argv = ["onboard", *arguments]
    time.time = SettableClock(Path(utc_file))
    main()
