"""A quantity over time as its scenario gives it: values at breakpoints, linear in between."""

from bisect import bisect_right
from collections.abc import Sequence
from itertools import accumulate, pairwise

Breakpoints = Sequence[tuple[float, float]]
"""(time in s, value), in order of time. The first and the last value hold outwards."""


class Course:
    """Evaluates breakpoints, their slope and their integral, exactly."""

    def __init__(self, breakpoints: Breakpoints) -> None:
        self._times_s = [at_s for at_s, _ in breakpoints]
        self._values = [value for _, value in breakpoints]
        areas = (
            (later - sooner) * (first + second) / 2
            for (sooner, first), (later, second) in pairwise(breakpoints)
        )
        self._areas = list(accumulate(areas, initial=0.0))

    def value(self, at_s: float) -> float:
        """The value at `at_s`."""
        index = self._index(at_s)
        if index < 0:
            return self._values[0]
        return self._values[index] + self.slope(at_s) * (at_s - self._times_s[index])

    def slope(self, at_s: float) -> float:
        """Its rate of change, per second; at a breakpoint that of the stretch after it."""
        index = self._index(at_s)
        if index < 0 or index + 1 == len(self._values):
            return 0.0
        rise = self._values[index + 1] - self._values[index]
        return rise / (self._times_s[index + 1] - self._times_s[index])

    def integral(self, at_s: float) -> float:
        """From the first breakpoint to `at_s`; negative before it."""
        index = self._index(at_s)
        if index < 0:
            return self._values[0] * (at_s - self._times_s[0])
        since_s = at_s - self._times_s[index]
        return self._areas[index] + (self._values[index] + self.value(at_s)) / 2 * since_s

    def _index(self, at_s: float) -> int:
        """Of the last breakpoint at or before `at_s`; -1 before the first."""
        return bisect_right(self._times_s, at_s) - 1
