"""Decentralized congestion control (DCC): the gate that frames pass to the radio (ETSI TS 102 687).

The channel load is measured by what is received and sent, since no radio unit tells it: the time on
the air of all frames, as a share of the last 100 ms. Frames that collide, are too weak to be
decoded, or are lost before this computer reads them are missing in it, so that it is too low rather
than too high. The load that stations report in single-hop packets (TS 102 636-4-2) is not read:
forged, it would silence whoever believed it.
"""

import math
from collections import deque
from dataclasses import dataclass
from typing import ClassVar

from typing_extensions import override

from onboard.core import Core
from onboard.its_g5.dcc_rate import (
    GREATEST_INTERVAL_S,
    LEAST_INTERVAL_S,
    SHORT_FRAME_S,
    AdaptiveRate,
    DccRate,
    DccState,
    ReactiveRate,
    StateMachine,
)
from onboard.wave_udp.radio_queue import Gate, airtime_s
from onboard.wave_udp.settings import CongestionControlApproach

MEASURED_S = 0.1
"""T_CBR: time over which a channel busy ratio is measured."""
URGENT_PRIORITY = 6
"""User priority from which a frame has DCC profile DP0."""
BURST_FRAMES = 20
BURST_PERIOD_S = 10.0
"""Of DP0 so many frames pass a closed gate in this time (N_Burst, T_BurstPeriod of the Basic System
Profile of C2C-CC; that a burst ends within 1 s is left out: a warning repeats for longer)."""


@dataclass(frozen=True, slots=True)
class ChannelLoad:
    """The state of the channel has changed."""

    kind: ClassVar[str] = "channel_load"
    stamp_s: float
    state: DccState
    """Of the load, by table A.1 of TS 102 687; with either approach."""
    channel_busy_ratio: float
    """Over the last 100 ms."""
    interval_s: float
    """Time between two frames of 0.5 ms from now on."""


class CongestionControl(Core, Gate):
    """Measures the channel load, and opens and closes the gate."""

    def __init__(self, approach: CongestionControlApproach, now: float) -> None:
        """Start with an open gate."""
        is_adaptive = approach is CongestionControlApproach.ADAPTIVE
        self._rate: DccRate = AdaptiveRate() if is_adaptive else ReactiveRate()
        self._machine = StateMachine()
        self._busy_s = 0.0
        self._measured_at = now
        self._sent_at = self._opens_at = -math.inf
        self._on_s = 0.0
        self._urgent: deque[float] = deque(maxlen=BURST_FRAMES)
        self._events: deque[ChannelLoad] = deque()

    def receive_frame(self, size_bytes: int) -> None:
        """Take a frame from the radio, of use or not."""
        self._busy_s += airtime_s(size_bytes)

    @override
    def receive_sent(self, size_bytes: int, user_priority: int, now: float) -> None:
        self._on_s = airtime_s(size_bytes)
        self._busy_s += self._on_s
        if user_priority >= URGENT_PRIORITY and now < self._opens_at:
            self._urgent.append(now)
        self._sent_at, self._opens_at = now, now + self._rate.interval_s(self._on_s)

    @override
    def opens_at(self, user_priority: int) -> float:
        if user_priority < URGENT_PRIORITY:
            return self._opens_at
        full = len(self._urgent) == BURST_FRAMES
        return min(self._opens_at, self._urgent[0] + BURST_PERIOD_S if full else -math.inf)

    @override
    def get_timer(self) -> float:
        """Return when the load is next measured."""
        return self._measured_at + MEASURED_S

    @override
    def handle_timer(self, now: float) -> None:
        """Measure the load if that is due, and move the opening of a closed gate by it."""
        if now < self.get_timer():
            return
        load = min(self._busy_s / (now - self._measured_at), 1.0)
        self._measured_at, self._busy_s = now, 0.0
        self._rate.receive_load(load)
        if now < self._opens_at:
            self._move_opening(now)
        if self._machine.receive_load(load):
            interval_s = self._rate.interval_s(SHORT_FRAME_S)
            self._events.append(ChannelLoad(now, self._machine.state, load, interval_s))

    def _move_opening(self, now: float) -> None:
        """Wait the share that is left of the old interval in the new one (equation B.2)."""
        left = (self._opens_at - now) / (self._opens_at - self._sent_at)
        interval_s = now - self._sent_at + left * self._rate.interval_s(self._on_s)
        interval_s = min(max(interval_s, LEAST_INTERVAL_S), GREATEST_INTERVAL_S)
        self._opens_at = self._sent_at + interval_s

    @override
    def next_event(self) -> ChannelLoad | None:
        """Return the oldest event not yet taken, or `None`."""
        return self._events.popleft() if self._events else None
