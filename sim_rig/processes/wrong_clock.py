"""Runs the daemon with a wrong UTC clock.

    python -m sim_rig.processes.wrong_clock START_FILE N FAULT... ARGS...

`onboard` runs unchanged; `time.time` of its process is wrong. START_FILE is written at the start of
the scenario and has the monotonic time of the start.
"""

import sys
import time
from pathlib import Path

from onboard.tools.cli import main
from sim_rig.scenario.faults import WrongClock

START_FILE = "begins"
"""Name of the start file."""
_CHECK_INTERVAL_S = 0.1


class Clock:
    """UTC clock with the faults of a scenario."""

    def __init__(self, start_file: Path, faults: list[WrongClock]) -> None:
        self._start_file = start_file
        self._faults = faults
        self._true_utc_s = time.time
        self._start_s: float | None = None
        self._check_at = 0.0

    def __call__(self) -> float:
        """UTC with the error of the active faults, s since 1970."""
        now = time.monotonic()
        if self._start_s is None and now >= self._check_at:
            self._check_at = now + _CHECK_INTERVAL_S
            if self._start_file.exists():
                self._start_s = float(self._start_file.read_text("utf-8") or "inf")
        at_s = -1.0 if self._start_s is None else now - self._start_s
        active = (fault for fault in self._faults if fault.holds(fault.car, at_s))
        return self._true_utc_s() + sum(fault.error_s(at_s) for fault in active)


if __name__ == "__main__":
    _, start_file, number, *rest = sys.argv
    faults = [WrongClock.model_validate_json(each) for each in rest[: int(number)]]
    sys.argv = ["onboard", *rest[int(number) :]]
    time.time = Clock(Path(start_file), faults)
    main()
