"""A daemon on a box whose clock is wrong.

    python -m sim_rig.processes.wrong_clock BEGINS N FAULT... ARGS...

`onboard` runs as it is; what is wrong is `time.time` of its process, as it would be on such a box.
The file BEGINS comes to be when the scenario begins, and says when that is on the monotonic clock.
"""

import sys
import time
from pathlib import Path

from onboard.cli import main
from sim_rig.scenario.faults import WrongClock

BEGINS = "begins"
"""Name of the file."""
_LOOK_EVERY_S = 0.1


class Clock:
    """What time it is for the box."""

    def __init__(self, begins: Path, faults: list[WrongClock]) -> None:
        self._begins = begins
        self._faults = faults
        self._true_utc_s = time.time
        self._start_s: float | None = None
        self._look_at = 0.0

    def __call__(self) -> float:
        """Seconds since 1970, or so the box thinks."""
        now = time.monotonic()
        if self._start_s is None and now >= self._look_at:
            self._look_at = now + _LOOK_EVERY_S
            if self._begins.exists():
                self._start_s = float(self._begins.read_text("utf-8") or "inf")
        at_s = -1.0 if self._start_s is None else now - self._start_s
        holding = (fault for fault in self._faults if fault.holds(fault.car, at_s))
        return self._true_utc_s() + sum(fault.error_s(at_s) for fault in holding)


if __name__ == "__main__":
    _, begins, number, *rest = sys.argv
    faults = [WrongClock.model_validate_json(each) for each in rest[: int(number)]]
    sys.argv = ["onboard", *rest[int(number) :]]
    time.time = Clock(Path(begins), faults)
    main()
