"""Waits for a condition in real time."""

import time
from collections.abc import Callable

WITHIN_S = 60.0
"""Longest wait for a condition in s; it usually takes milliseconds."""


def wait_until(holds: Callable[[], bool]) -> None:
    give_up_at = time.monotonic() + WITHIN_S
    while not holds():
        assert time.monotonic() < give_up_at, "condition not met in time"
        time.sleep(0.01)
