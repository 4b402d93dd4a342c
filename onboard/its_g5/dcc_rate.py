"""How often a station may send at a channel load: the two approaches of ETSI TS 102 687 V1.2.1.

Reactive (5.3, annex A): a table of states. Adaptive (5.4): the share of time in which the station
sends follows the load to a target, as LIMERIC (Bansal, Kenney, Rohrs, IEEE TVT 62(9), 2013).
"""

from enum import StrEnum
from typing import NamedTuple, Protocol

from typing_extensions import override

LEAST_INTERVAL_S, GREATEST_INTERVAL_S = 0.025, 1.0
"""Bounds of the time between two frames (equation B.1)."""


class DccState(StrEnum):
    """How busy the channel is (annex A)."""

    RELAXED = "relaxed"
    ACTIVE_1 = "active_1"
    ACTIVE_2 = "active_2"
    ACTIVE_3 = "active_3"
    RESTRICTIVE = "restrictive"


STATES = tuple(DccState)


class _Row(NamedTuple):
    """Of a table of annex A, for one state."""

    from_load: float
    interval_s: float


SHORT_FRAME_S, LONG_FRAME_S = 0.000_5, 0.001
"""Longest frames of tables A.2 and A.1."""
SHORT_FRAMES = (
    _Row(0.0, 0.05), _Row(0.3, 0.1), _Row(0.4, 0.2), _Row(0.5, 0.25), _Row(0.65, 1.0)
)  # fmt: skip
"""Table A.2."""
LONG_FRAMES = (
    _Row(0.0, 0.1), _Row(0.3, 0.2), _Row(0.4, 0.4), _Row(0.5, 0.5), _Row(0.6, 1.0)
)  # fmt: skip
"""Table A.1."""

ALPHA, BETA = 0.016, 0.0012
TARGET_LOAD = 0.68
GREATEST_DUTY_CYCLE, LEAST_DUTY_CYCLE = 0.03, 0.0006
GREATEST_RISE, GREATEST_FALL = 0.0005, -0.000_25
"""Of the duty cycle in one step, before `ALPHA` (table 3)."""


class DccRate(Protocol):
    """Sets the time between two frames."""

    def receive_load(self, load: float) -> None:
        """Take the channel busy ratio of the last 100 ms, 0 to 1."""

    def interval_s(self, on_s: float) -> float:
        """Return the time from the start of a frame that lasts `on_s` to that of the next."""


class StateMachine:
    """The state by the load, which moves to a neighbour at most (5.3)."""

    def __init__(self) -> None:
        """Start relaxed."""
        self.state = DccState.RELAXED

    def receive_load(self, load: float) -> bool:
        """Take the next load; return whether the state has changed."""
        before, place = self.state, STATES.index(self.state)
        if load < LONG_FRAMES[place].from_load:
            self.state = STATES[place - 1]
        elif place + 1 < len(STATES) and load >= LONG_FRAMES[place + 1].from_load:
            self.state = STATES[place + 1]
        return self.state is not before


class ReactiveRate(DccRate):
    """The reactive approach.

    Which of the two tables rules is by the frame that was sent, the standard has one for all. A
    frame longer than those of table A.1 waits longer in proportion: its share of the time is that
    of the longest. Both are ours, since CAMs and CPMs differ that much.
    """

    def __init__(self) -> None:
        """Start relaxed."""
        self._machine = StateMachine()

    @override
    def receive_load(self, load: float) -> None:
        self._machine.receive_load(load)

    @override
    def interval_s(self, on_s: float) -> float:
        place = STATES.index(self._machine.state)
        if on_s <= SHORT_FRAME_S:
            return SHORT_FRAMES[place].interval_s
        longer = max(on_s / LONG_FRAME_S, 1.0)
        return min(LONG_FRAMES[place].interval_s * longer, GREATEST_INTERVAL_S)


class AdaptiveRate(DccRate):
    """The adaptive approach: a duty cycle, stepped with every second load."""

    def __init__(self) -> None:
        """Start in the middle of the limits; the standard names no start."""
        self.duty_cycle = (GREATEST_DUTY_CYCLE + LEAST_DUTY_CYCLE) / 2
        self._smoothed: float | None = None
        self._previous: float | None = None

    @override
    def receive_load(self, load: float) -> None:
        if self._previous is None:
            self._previous = load
            return
        mean = (load + self._previous) / 2
        self._previous = None
        smoothed = mean if self._smoothed is None else 0.5 * self._smoothed + 0.5 * mean
        self._smoothed = smoothed
        offset = min(max(BETA * (TARGET_LOAD - smoothed), GREATEST_FALL), GREATEST_RISE)
        duty_cycle = (1.0 - ALPHA) * self.duty_cycle + offset
        self.duty_cycle = min(max(duty_cycle, LEAST_DUTY_CYCLE), GREATEST_DUTY_CYCLE)

    @override
    def interval_s(self, on_s: float) -> float:
        return min(max(on_s / self.duty_cycle, LEAST_INTERVAL_S), GREATEST_INTERVAL_S)
