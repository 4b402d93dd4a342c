"""Detection of a collision: the speed falls faster than tyres can brake, and stays low.

A fall that no tyre explains is either a collision, wheels that lock, or a fault of the source. It
counts when the speed stays low for `CONFIRM_S`, unless

- the speed comes back before that: a wrong sample;
- another source's newer speed is still high: an ECU that restarts reports 0;
- the speed was not steady before the fall: a sensor that jumps up and down.

With one source, a speed that falls to 0 and stays there counts: the sensor may be dead, but silence
after a collision is the worse error.
"""

import math
from collections import deque
from dataclasses import dataclass

from typing_extensions import override

from onboard.core import Core
from onboard.obd.hard_brake import (
    MAX_DECELERATION_M_S2,
    WINDOW_S,
    is_jump,
    least_deceleration_m_s2,
)
from onboard.observations import Speed

MIN_FALL_M_S = 5.0
"""Least fall of a collision: about that from which airbags fire. Steps at the end of a stop and
errors of scale are smaller."""

FALL_S = 0.3
"""Longest fall: a collision with a deforming barrier takes 0.1 to 0.2 s."""

STEADY_S = 0.5
"""Time before the fall without an impossible rise."""

CONFIRM_S = 0.2
"""Least time for which the speed stays low."""

GIVE_UP_S = 1.5
"""Time after which a fall that is not confirmed is the source's fault: two samples at 2 Hz of two
sources."""

COLLISION_S = 5.0
"""Time for which a collision is shown: then the vehicle is an obstacle that others see."""

FRESH_S = 1.0
"""Age up to which another source's speed counts."""


@dataclass(slots=True)
class _Fall:
    before_m_s: float
    low_m_s: float
    since_s: float
    """Stamp of its first sample."""
    deceleration_m_s2: float
    over_at: float = math.inf
    """End of the collision; infinite while it is not confirmed."""

    @property
    def is_confirmed(self) -> bool:
        return self.over_at < math.inf

    def is_undone_by(self, speed_m_s: float) -> bool:
        """Whether a speed is nearer to that before the fall."""
        return speed_m_s > (self.before_m_s + self.low_m_s) / 2


class CollapseDetector(Core):
    """Detects that the speed collapses; the module's docstring has the rules."""

    def __init__(self) -> None:
        self._recent: deque[Speed] = deque()
        """Samples of the last `FALL_S`, at least the last one."""
        self._steady_since_s = math.inf
        self._others: dict[str, Speed] = {}
        """The newest speed of each other source."""
        self._fall: _Fall | None = None

    @property
    def level_m_s2(self) -> float | None:
        """Least deceleration of the collision; `None` while there is none."""
        fall = self._fall
        return fall.deceleration_m_s2 if fall is not None and fall.is_confirmed else None

    def receive_speed(self, speed: Speed, now: float) -> None:
        """Receive the next sample of the source in use."""
        self._others.pop(speed.source, None)
        recent = self._recent
        if recent:
            elapsed_s = speed.stamp_s - recent[-1].stamp_s
            if speed.source != recent[-1].source or abs(elapsed_s) > WINDOW_S:
                self._restart()
            elif elapsed_s < 0.0:
                return
        if self._fall is not None:
            self._follow(self._fall, speed, now)
        elif recent and speed.speed_m_s > recent[-1].speed_m_s and is_jump(recent[-1], speed):
            recent.clear()
        else:
            self._fall = self._find(speed)
        if not recent:
            self._steady_since_s = speed.stamp_s
        while len(recent) > 1 and recent[0].stamp_s < speed.stamp_s - FALL_S:
            recent.popleft()
        recent.append(speed)

    def receive_other_speed(self, speed: Speed, now: float) -> None:
        """Receive a speed of a source that is not in use."""
        self._others[speed.source] = speed
        if self._fall is not None:
            self._judge(self._fall, speed.stamp_s, now)

    @override
    def get_timer(self) -> float:
        return math.inf if self._fall is None else self._fall.over_at

    @override
    def handle_timer(self, now: float) -> None:
        """End the collision when its time is over, also if the bus is silent since."""
        if now >= self.get_timer():
            self._drop()

    def _restart(self) -> None:
        self._recent.clear()
        # A collision outlasts the silence of a bus that it destroyed.
        if self.level_m_s2 is None:
            self._fall = None

    def _drop(self) -> None:
        self._recent.clear()
        self._fall = None

    def _find(self, speed: Speed) -> _Fall | None:
        """The steepest impossible fall from a recent sample to this one."""
        before, steepest_m_s2 = None, MAX_DECELERATION_M_S2
        for sample in self._recent:
            deceleration_m_s2 = least_deceleration_m_s2(sample, speed)
            if (
                deceleration_m_s2 > steepest_m_s2
                and sample.speed_m_s - speed.speed_m_s >= MIN_FALL_M_S
                and sample.stamp_s - self._steady_since_s >= STEADY_S
            ):
                before, steepest_m_s2 = sample, deceleration_m_s2
        if before is None:
            return None
        return _Fall(before.speed_m_s, speed.speed_m_s, speed.stamp_s, steepest_m_s2)

    def _follow(self, fall: _Fall, speed: Speed, now: float) -> None:
        fall.low_m_s = min(fall.low_m_s, speed.speed_m_s)
        if fall.is_undone_by(speed.speed_m_s):
            self._drop()
        else:
            self._judge(fall, speed.stamp_s, now)

    def _judge(self, fall: _Fall, stamp_s: float, now: float) -> None:
        is_contradicted = any(
            other.stamp_s >= max(fall.since_s, stamp_s - FRESH_S)
            and fall.is_undone_by(other.speed_m_s)
            for other in self._others.values()
        )
        if fall.is_confirmed:
            if is_contradicted:
                self._drop()
        elif stamp_s - fall.since_s > GIVE_UP_S:
            self._drop()
        elif stamp_s - fall.since_s >= CONFIRM_S and not is_contradicted:
            fall.over_at = now + COLLISION_S
