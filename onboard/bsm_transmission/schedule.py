"""When the next BSM is due: ten a second, fewer among many cars, at once when something happens.

The rate rules are those of SAE J2945/1 (rate control by vehicle density), with its own parameter
names in the comments. Power control and the tracking-error rule are not followed: the radios here
do not let their power be set for a frame, and a car without GNSS has no position error to track.
"""

import numpy as np

MINIMUM_INTERVAL_S = 0.1
"""vTxRateCntrlInt: ten a second, and how often the density is looked at."""
MAXIMUM_INTERVAL_S = 0.6
"""vMax_ITT."""
DENSITY_COEFFICIENT = 25.0
"""vDensityCoefficient: up to so many cars near, the interval is not stretched."""
DENSITY_WEIGHT = 0.05
"""vDensityWeightFactor: of the newest count in the smoothed density."""
DENSITY_RANGE_M = 100.0
"""vPERRange: cars within it count as near."""
DENSITY_WINDOW_S = 1.0
"""vPERSubInterval: a car counts if it was heard so recently."""
SPREAD_S = 0.005
"""vTxRand: each sending time is moved by up to this, both ways, so that cars drift out of step."""
RESCHEDULE_S = 0.025
"""vRescheduleTh: a sending time moves only if it comes forward by at least this."""

_MOST_NEAR = 1024
"""More would not change the interval, and memory stays bounded."""


class BsmSchedule:
    """Says when to send. `now` is the car's clock."""

    def __init__(self, rng: np.random.Generator, now: float) -> None:
        """Start somewhere in the first interval, so that cars switched on together differ."""
        self._rng = rng
        self._near_until: dict[bytes, float] = {}
        self._density = 0.0
        self._measure_at = now + MINIMUM_INTERVAL_S
        self._sent_at = now
        self._send_at = now + float(rng.uniform(0.0, MINIMUM_INTERVAL_S))
        self._is_critical = False
        self._longest_s = MAXIMUM_INTERVAL_S

    @property
    def interval_s(self) -> float:
        """Time between two BSMs, at the density of now."""
        stretched = MINIMUM_INTERVAL_S * self._density / DENSITY_COEFFICIENT
        return min(max(stretched, MINIMUM_INTERVAL_S), self._longest_s)

    def receive_longest_interval(self, longest_s: float, now: float) -> None:
        """Let density stretch the interval to at most `longest_s`, from now on.

        Raises:
            ValueError: it is not between the limits.
        """
        if not MINIMUM_INTERVAL_S <= longest_s <= MAXIMUM_INTERVAL_S:
            raise ValueError(f"an interval is {MINIMUM_INTERVAL_S} to {MAXIMUM_INTERVAL_S} s")
        self._longest_s = longest_s
        if self._send_at - (self._sent_at + self.interval_s) >= RESCHEDULE_S:
            self._send_at = max(now, self._sent_at + self.interval_s)

    def receive_remote_vehicle(self, sender: bytes, distance_m: float | None, now: float) -> None:
        """A BSM came from `sender`; a car whose distance is unknown counts as near."""
        if distance_m is not None and distance_m > DENSITY_RANGE_M:
            return
        if sender in self._near_until or len(self._near_until) < _MOST_NEAR:
            self._near_until[sender] = now + DENSITY_WINDOW_S

    def receive_event_flags(self, is_critical: bool, now: float) -> None:
        """Tell whether a critical event lasts; one that begins is sent at once."""
        if is_critical and not self._is_critical:
            self._send_at = now
        self._is_critical = is_critical

    def get_timer(self) -> float:
        """When `handle_timer` or `take_due` has something to do."""
        return min(self._send_at, self._measure_at)

    def handle_timer(self, now: float) -> None:
        """Look at the density, if that is due."""
        if now < self._measure_at:
            return
        self._measure_at = now + MINIMUM_INTERVAL_S
        self._near_until = {car: until for car, until in self._near_until.items() if until > now}
        self._density += DENSITY_WEIGHT * (len(self._near_until) - self._density)
        if self._send_at - (self._sent_at + self.interval_s) >= RESCHEDULE_S:
            self._send_at = max(now, self._sent_at + self.interval_s)

    def take_due(self, now: float) -> bool:
        """Return whether a BSM is to be sent now; it then counts as sent."""
        if now < self._send_at:
            return False
        self._sent_at = now
        interval_s = MINIMUM_INTERVAL_S if self._is_critical else self.interval_s
        self._send_at = now + interval_s + float(self._rng.uniform(-SPREAD_S, SPREAD_S))
        return True
