"""Acceleration: the slope of speed samples over a short window."""

import math
from collections import deque
from collections.abc import Sequence

import numpy as np

LEAST_SAMPLES = 4

_HARDEST_BRAKING_M_S2 = 12.0
"""Hardest braking of tyres on a dry road."""


def is_jump(step_m_s: float, elapsed_s: float, error_m_s: float) -> bool:
    """Whether a speed changed by more than braking and the error of the speed explain.

    Args:
        step_m_s: change of the speed.
        elapsed_s: time in which it changed.
        error_m_s: largest error of the change.
    """
    return abs(step_m_s) > _HARDEST_BRAKING_M_S2 * elapsed_s + error_m_s


def slope(samples: Sequence[tuple[float, float]]) -> float:
    """Return the least-squares slope of (stamp in s, value), in units of the value per s."""
    mean_s = sum([stamp_s for stamp_s, _ in samples]) / len(samples)
    by_value = by_time = 0.0
    for stamp_s, value in samples:  # a handful: faster than arrays
        since_s = stamp_s - mean_s
        by_value += since_s * value
        by_time += since_s * since_s
    return by_value / by_time


def is_late(stamp_s: float, newest_s: float, window_s: float) -> bool:
    """Whether a sample is no newer than the newest one so far, and must be ignored.

    A sample older than the whole window is not late: then the newest stamp was wrong, and callers
    start again from the sample. Otherwise one stamp far ahead would suppress all later samples.

    Args:
        stamp_s: time of the sample.
        newest_s: latest time of the samples so far.
        window_s: length of the window.
    """
    return newest_s - window_s <= stamp_s <= newest_s


class AccelerationEstimator:
    """Estimates the acceleration of one car from samples of its speed."""

    def __init__(self, window_s: float) -> None:
        """Use the last `window_s`; samples must cover half of it for an estimate."""
        self._window_s = window_s
        self._samples: deque[tuple[float, float]] = deque()

    def receive_speed(self, stamp_s: float, speed_m_s: float) -> None:
        """Take a sample; a late one is ignored."""
        if self._samples:
            newest_s = self._samples[-1][0]
            if is_late(stamp_s, newest_s, self._window_s):
                return
            if stamp_s < newest_s:
                self.clear()
        self._samples.append((stamp_s, speed_m_s))
        while stamp_s - self._samples[0][0] > self._window_s:
            self._samples.popleft()

    def clear(self) -> None:
        """Drop all samples: the next ones are of another car."""
        self._samples.clear()

    @property
    def acceleration_m_s2(self) -> float | None:
        """Least-squares slope, valid at the middle of the window; `None` without coverage."""
        return slope(self._samples) if self._is_covered else None

    def largest_error_m_s2(self, step_m_s: float) -> float:
        """Largest error of the acceleration due to the resolution of the speeds, `step_m_s`.

        Infinite while there is no estimate. Holds for rounding and for truncation.
        """
        if not self._is_covered:
            return math.inf
        times_s = np.array(self._samples)[:, 0]
        times_s -= times_s.mean()
        return float(step_m_s / 2.0 * np.abs(times_s).sum() / (times_s @ times_s))

    def least_m_s2(self, step_m_s: float) -> float:
        """Return the least acceleration that any sample and the newest one allow.

        Two speeds of resolution `step_m_s` differ by less than one step more than they show.
        Minus infinity with less than two samples.
        """
        newest_s, newest_m_s = self._samples[-1] if self._samples else (0.0, 0.0)
        return max(
            (
                (newest_m_s - speed_m_s - step_m_s) / (newest_s - stamp_s)
                for stamp_s, speed_m_s in self._samples
                if stamp_s < newest_s
            ),
            default=-math.inf,
        )

    def sigma_m_s2(self, speed_sigma_m_s: float) -> float:
        """Standard deviation of the acceleration, for independent errors of the speeds.

        Infinite while there is no estimate.
        """
        if not self._is_covered:
            return math.inf
        times_s = np.array(self._samples)[:, 0]
        times_s -= times_s.mean()
        return speed_sigma_m_s / math.sqrt(times_s @ times_s)

    @property
    def _is_covered(self) -> bool:
        samples = self._samples
        return (
            len(samples) >= LEAST_SAMPLES and samples[-1][0] - samples[0][0] >= self._window_s / 2
        )
