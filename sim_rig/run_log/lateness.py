"""How late the rig itself was, whose delay must not count as the car's."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

LIMITS_S: Mapping[str, float] = {
    "ECU answer": 0.046,
    "CAN frame": 0.046,
    "picture": 0.1,
    "fix": 0.05,
    "detection": 0.05,
    "WSM": 0.02,
    "other car": 0.02,
}
"""Lateness that a device at the end of this wire might have too. An ECU may answer 0.05 s after the
request (ISO 15765-4, P2 CAN), of which the rig's plans 0.004 s; a frame that is played may be its
answer; a picture is late by an interval of the camera; the others are a small part of the 0.1 s
between two BSMs."""


@dataclass(frozen=True, slots=True)
class LatenessLine:
    """Lateness of one kind of output over a run."""

    what: str
    n: int
    p50_s: float
    p99_s: float
    limit_s: float
    misses: int
    """How many were later than the limit."""

    @property
    def is_too_late(self) -> bool:
        """Whether more than one in a hundred was later than the limit."""
        return self.p99_s > self.limit_s


class Lateness:
    """Collects the lateness of the rig's outputs."""

    def __init__(self) -> None:
        """Start with no output."""
        self._late_s: dict[str, list[float]] = {what: [] for what in LIMITS_S}

    def note(self, what: str, late_s: float) -> None:
        """Note one output, which left `late_s` after it was due."""
        self._late_s[what].append(max(0.0, late_s))

    def clear(self) -> None:
        """Forget all: the scenario starts."""
        for late_s in self._late_s.values():
            late_s.clear()

    def lines(self) -> Iterator[LatenessLine]:
        """Yield a line for each kind that there was."""
        for what, late_s in self._late_s.items():
            if late_s:
                yield lateness_line(what, late_s, LIMITS_S[what])


def lateness_line(what: str, late_s: Sequence[float], limit_s: float) -> LatenessLine:
    """Return the line of outputs that were late by `late_s`, of which there is one at least."""
    p50_s, p99_s = np.percentile(late_s, [50, 99])
    misses = sum(each > limit_s for each in late_s)
    return LatenessLine(what, len(late_s), float(p50_s), float(p99_s), limit_s, misses)
