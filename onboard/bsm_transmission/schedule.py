"""BSM schedule: 10 Hz, less often at high vehicle density, at once for a critical event.

The rules are the rate control of SAE J2945/1; its parameter names stand under the constants. Power
control and the tracking-error rule are left out: the radio units cannot set the power per frame,
and a car without GNSS has no position error to track.
"""

import numpy as np
from typing_extensions import override

from onboard.bsm_transmission.due_time import DueTime

MINIMUM_INTERVAL_S = 0.1
"""vTxRateCntrlInt: interval of BSMs at low density, and of the density measurement."""
MAXIMUM_INTERVAL_S = 0.6
"""vMax_ITT: interval at the highest density."""
DENSITY_COEFFICIENT = 25.0
"""vDensityCoefficient: vehicles within range up to which the interval is the minimum."""
DENSITY_WEIGHT = 0.05
"""vDensityWeightFactor: weight of the newest count in the smoothed density."""
DENSITY_RANGE_M = 100.0
"""vPERRange: vehicles within this range are counted."""
DENSITY_WINDOW_S = 1.0
"""vPERSubInterval: vehicles received within this time are counted."""
FREE_RATE_1_S, FULL_RATE_1_S = 300.0, 350.0
"""BSMs a second of all vehicles within range up to which some may send more often than by these
rules, and from which on nobody does. By the rules alone there are 250."""
JITTER_S = 0.005
"""vTxRand: random shift of each transmission, both ways, which desynchronises vehicles."""
RESCHEDULE_S = 0.025
"""vRescheduleTh: a planned transmission is advanced only by at least this."""

_MAX_COUNTED = 1024
"""Vehicles counted, a bound on memory; more would not change the interval."""


class BsmSchedule(DueTime):
    """Decides when to send BSMs."""

    def __init__(self, rng: np.random.Generator, now: float) -> None:
        """See `DueTime`."""
        super().__init__(rng, now, MINIMUM_INTERVAL_S)
        self._in_range_until: dict[bytes, float] = {}
        self._density = self._rate_1_s = 0.0
        self._received = 0
        """BSMs within range since the last measurement."""
        self._measure_at = now + MINIMUM_INTERVAL_S
        self._sent_at = now
        self._max_interval_s = MAXIMUM_INTERVAL_S

    @override
    def begin_anew(self, now: float) -> None:
        """Send next at a random time within the present interval, as `DueTime`."""
        self._draw(now, self.interval_s)

    @property
    def interval_s(self) -> float:
        """Time between two BSMs at the present density.

        The limit that `receive_max_interval` sets gives way as vehicles with one fill the channel.
        """
        interval_s = MINIMUM_INTERVAL_S * self._density / DENSITY_COEFFICIENT
        interval_s = min(max(interval_s, MINIMUM_INTERVAL_S), MAXIMUM_INTERVAL_S)
        full = (self._rate_1_s - FREE_RATE_1_S) / (FULL_RATE_1_S - FREE_RATE_1_S)
        shorter_s = max(interval_s - self._max_interval_s, 0.0)
        return interval_s - shorter_s * (1.0 - min(max(full, 0.0), 1.0))

    def receive_max_interval(self, max_s: float, now: float) -> None:
        """Limit the interval at high density to `max_s`, as far as the channel has room.

        Raises:
            ValueError: it is not between the limits.
        """
        if not MINIMUM_INTERVAL_S <= max_s <= MAXIMUM_INTERVAL_S:
            raise ValueError(f"an interval is {MINIMUM_INTERVAL_S} to {MAXIMUM_INTERVAL_S} s")
        self._max_interval_s = max_s
        self._reschedule(now)

    def receive_remote_vehicle(self, sender: bytes, distance_m: float | None, now: float) -> None:
        """Count the sender of a received BSM.

        Args:
            sender: its temporary ID.
            distance_m: `None` if unknown; it is then counted as in range.
            now: the present time.
        """
        if distance_m is not None and distance_m > DENSITY_RANGE_M:
            return
        self._received += 1
        if sender in self._in_range_until or len(self._in_range_until) < _MAX_COUNTED:
            self._in_range_until[sender] = now + DENSITY_WINDOW_S

    @override
    def get_timer(self) -> float:
        """Return the time of the next BSM or density measurement."""
        return min(self._due_at, self._measure_at)

    @override
    def handle_timer(self, now: float) -> None:
        """Measure the density if that is due."""
        if now < self._measure_at:
            return
        self._measure_at = now + MINIMUM_INTERVAL_S
        self._in_range_until = {
            car: until for car, until in self._in_range_until.items() if until > now
        }
        self._density += DENSITY_WEIGHT * (len(self._in_range_until) - self._density)
        rate_1_s = self._received / MINIMUM_INTERVAL_S
        self._rate_1_s += DENSITY_WEIGHT * (rate_1_s - self._rate_1_s)
        self._received = 0
        self._reschedule(now)

    def _reschedule(self, now: float) -> None:
        """Bring the next BSM forward if the interval has become so much shorter."""
        at = self._sent_at + self.interval_s
        if self._due_at - at >= RESCHEDULE_S:
            self._due_at = max(now, at)

    def take_due(self, now: float) -> bool:
        """Return whether a BSM is to be sent now; it then counts as sent."""
        if not self.is_due(now):
            return False
        self._sent_at = now
        interval_s = MINIMUM_INTERVAL_S if self._is_critical else self.interval_s
        self._due_at = now + interval_s + float(self._rng.uniform(-JITTER_S, JITTER_S))
        return True
