"""Piecewise linear functions of time."""

from bisect import bisect_right
from collections.abc import Sequence
from itertools import accumulate, pairwise

Breakpoints = Sequence[tuple[float, float]]
"""(time in s, value), in order of time; constant before the first and after the last."""


class PiecewiseLinear:
    """Evaluates breakpoints, their slope and their integral, exactly."""

    def __init__(self, breakpoints: Breakpoints) -> None:
        self._times_s = [at_s for at_s, _ in breakpoints]
        self._values = [value for _, value in breakpoints]
        stretches = [
            (later - sooner, first, second)
            for (sooner, first), (later, second) in pairwise(breakpoints)
        ]
        self._slopes = [(second - first) / length for length, first, second in stretches] + [0.0]
        areas = (length * (first + second) / 2 for length, first, second in stretches)
        self._areas = list(accumulate(areas, initial=0.0))

    def value(self, at_s: float) -> float:
        """The value at `at_s`."""
        return self.sample(at_s)[0]

    def sample(self, at_s: float) -> tuple[float, float, float]:
        """Value, slope (per second) and integral since the first breakpoint, at `at_s`.

        At a breakpoint the slope is that of the following segment.
        """
        index = bisect_right(self._times_s, at_s) - 1
        if index < 0:
            first = self._values[0]
            return first, 0.0, first * (at_s - self._times_s[0])
        since_s = at_s - self._times_s[index]
        begin, slope = self._values[index], self._slopes[index]
        value = begin + slope * since_s
        return value, slope, self._areas[index] + (begin + value) / 2 * since_s
