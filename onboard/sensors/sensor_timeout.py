"""Reports when a sensor has timed out, and when it has recovered.

A silent sensor is shown as lost, and its last value is not used. Each sensor's timeout is the
longest silence that is normal for it. How old a value may be that is used is in `host_state`.
"""

import math
from collections import deque
from collections.abc import Mapping

from typing_extensions import override

from onboard.core import Core
from onboard.observations import Discarded, Sensor, SensorLost, SensorRecovered

SensorEvent = SensorLost | SensorRecovered | Discarded


class SensorTimeouts(Core):
    """Tracks the last sample of each sensor."""

    def __init__(self, timeouts_s: Mapping[Sensor, float], now: float) -> None:
        """Monitor the sensors in `timeouts_s`, as if each had sent a sample at `now`.

        A timeout of `math.inf` is for sensors that may be silent.
        """
        self._timeouts_s = dict(timeouts_s)
        self._last_sample_at: dict[Sensor, float | None] = dict.fromkeys(self._timeouts_s)
        self._lost_at = {sensor: now + timeout for sensor, timeout in self._timeouts_s.items()}
        self._lost: set[Sensor] = set()
        self._events: deque[SensorEvent] = deque()

    @property
    def lost(self) -> frozenset[Sensor]:
        """The monitored sensors that are lost."""
        return frozenset(self._lost)

    def receive_sample(self, sensor: Sensor, stamp_s: float, now: float) -> None:
        """Restart the timeout of a sensor.

        Args:
            sensor: which one; sensors that are not monitored are ignored.
            stamp_s: when it was sampled; a sample older than the timeout is ignored.
            now: the arrival.
        """
        if sensor not in self._timeouts_s or now >= stamp_s + self._timeouts_s[sensor]:
            return
        self._last_sample_at[sensor] = stamp_s
        self._lost_at[sensor] = stamp_s + self._timeouts_s[sensor]
        if sensor in self._lost:
            self._lost.discard(sensor)
            self._events.append(SensorRecovered(stamp_s=stamp_s, sensor=sensor))

    def receive_loss(self, sensor: Sensor, reason: str, now: float) -> None:
        """Report a sensor as lost before its timeout.

        Args:
            sensor: which one.
            reason: found by the sensor's component, such as unplugged or frozen.
            now: when it was found.
        """
        if sensor not in self._timeouts_s or sensor in self._lost:
            return
        may_be_silent = self._timeouts_s[sensor] == math.inf
        last_sample_at = None if may_be_silent else self._last_sample_at[sensor]
        self._lost.add(sensor)
        self._events.append(
            SensorLost(
                stamp_s=now,
                sensor=sensor,
                silent_s=None if last_sample_at is None else now - last_sample_at,
                reason=reason,
            )
        )

    @override
    def get_timer(self) -> float:
        """Return when the next sensor times out; `math.inf` when none can."""
        pending = [at for sensor, at in self._lost_at.items() if sensor not in self._lost]
        return min(pending, default=math.inf)

    @override
    def handle_timer(self, now: float) -> None:
        """Report the sensors that have timed out as lost."""
        for sensor, at in self._lost_at.items():
            if now >= at:
                self.receive_loss(sensor, "silent", now)

    @override
    def next_event(self) -> SensorEvent | None:
        """Return the oldest event not yet taken, or `None`."""
        return self._events.popleft() if self._events else None
