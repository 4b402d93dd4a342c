"""Says when a sensor has gone silent, and when it is back.

A sensor that is silent is shown as lost, never as its last value. The limit of each sensor says
how long a gap is normal for it.
"""

import math
from collections import deque
from collections.abc import Mapping

from onboard.observations import Sensor, SensorLost, SensorRecovered


class SensorTimeouts:
    """Tracks when each watched sensor was last heard."""

    def __init__(self, limits_s: Mapping[Sensor, float], now: float) -> None:
        """Watch the sensors in `limits_s`; each is given its limit from `now` on to start."""
        self._limits_s = dict(limits_s)
        self._heard_at: dict[Sensor, float | None] = dict.fromkeys(self._limits_s)
        self._lost_at = {sensor: now + limit for sensor, limit in self._limits_s.items()}
        self._lost: set[Sensor] = set()
        self._events: deque[SensorLost | SensorRecovered] = deque()

    @property
    def lost(self) -> frozenset[Sensor]:
        """The watched sensors that are lost now."""
        return frozenset(self._lost)

    def receive_sample(self, sensor: Sensor, stamp_s: float, now: float) -> None:
        """A valid sample of `sensor` arrived; one that is older than its limit does not count."""
        if sensor not in self._limits_s or now >= stamp_s + self._limits_s[sensor]:
            return
        self._heard_at[sensor] = stamp_s
        self._lost_at[sensor] = stamp_s + self._limits_s[sensor]
        if sensor in self._lost:
            self._lost.discard(sensor)
            self._events.append(SensorRecovered(stamp_s=stamp_s, sensor=sensor))

    def receive_loss(self, sensor: Sensor, reason: str, now: float) -> None:
        """The sensor's own room found it lost (unplugged, frozen) before its limit passed."""
        if sensor not in self._limits_s or sensor in self._lost:
            return
        may_be_silent = self._limits_s[sensor] == math.inf
        heard_at = None if may_be_silent else self._heard_at[sensor]
        self._lost.add(sensor)
        self._events.append(
            SensorLost(
                stamp_s=now,
                sensor=sensor,
                silent_s=None if heard_at is None else now - heard_at,
                reason=reason,
            )
        )

    def get_timer(self) -> float:
        """Return when the next sensor times out; `math.inf` when none can."""
        waiting = (at for sensor, at in self._lost_at.items() if sensor not in self._lost)
        return min(waiting, default=math.inf)

    def handle_timer(self, now: float) -> None:
        """Declare lost what has been silent for longer than its limit."""
        for sensor, at in self._lost_at.items():
            if now >= at:
                self.receive_loss(sensor, "silent", now)

    def next_event(self) -> SensorLost | SensorRecovered | None:
        """The oldest event not yet taken."""
        return self._events.popleft() if self._events else None
