"""How fast a speed changes: the slope of its samples over a short window."""

import math
from collections import deque

import numpy as np

LEAST_SAMPLES = 4


class SpeedTrend:
    """Takes samples of one car's speed, tells its acceleration."""

    def __init__(self, window_s: float) -> None:
        """Look back `window_s`; half of it must be covered before anything is told."""
        self._window_s = window_s
        self._samples: deque[tuple[float, float]] = deque()

    def receive(self, stamp_s: float, speed_m_s: float) -> None:
        """Take a sample; one that is not newer than the last is ignored."""
        if self._samples and stamp_s <= self._samples[-1][0]:
            return
        self._samples.append((stamp_s, speed_m_s))
        while stamp_s - self._samples[0][0] > self._window_s:
            self._samples.popleft()

    def clear(self) -> None:
        """What comes next is of another car."""
        self._samples.clear()

    @property
    def acceleration_m_s2(self) -> float | None:
        """By least squares, true of the middle of the window; `None` while it is not covered."""
        samples = self._samples
        if len(samples) < LEAST_SAMPLES or samples[-1][0] - samples[0][0] < self._window_s / 2:
            return None
        times_s, speeds_m_s = np.array(samples).T
        times_s -= times_s.mean()
        return float(times_s @ speeds_m_s / (times_s @ times_s))

    def largest_error_m_s2(self, step_m_s: float) -> float:
        """By how much at most the acceleration is off since speeds come in steps of `step_m_s`.

        Infinite while none is told. Holds for rounding and for cutting off alike.
        """
        if self.acceleration_m_s2 is None:
            return math.inf
        times_s = np.array(self._samples)[:, 0]
        times_s -= times_s.mean()
        return float(step_m_s / 2.0 * np.abs(times_s).sum() / (times_s @ times_s))
