"""Whether a vehicle on the air moves as the lead does.

BSMs and answers give the speed of a vehicle on the air, and the own speed less the closing speed
that of the lead. Each sample of the latter is explained in two ways:

- The vehicle on the air is the lead: the sample is that vehicle's speed a moment ago, plus a
  constant difference of the speedometers, plus noise.
- Another vehicle is the lead: the sample is near the one before, since speeds change slowly. How
  slowly is learnt from the samples: at constant speeds, equal speeds are no evidence.

Both are Kalman filters with one state. The logarithm of the ratio of their likelihoods is the
evidence, and a sequential probability ratio test (Wald 1945) if it is summed from the start. Its
cumulative sum from its last maximum (CUSUM; Page 1954, Continuous inspection schemes) shows that a
vehicle has ceased to be the lead.

A change of the own speed that no brakes explain, and that a second sample confirms, is an error of
the own speedometer, or its end. All vehicles then begin anew: otherwise a speedometer that was
wrong for seconds would refute the lead for minutes.
"""

import math
from collections import OrderedDict, deque
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise

from onboard.kinematics.acceleration import is_jump

SAMPLE_S = 0.4
"""Least time between two samples: errors of the closing speed are correlated for about as long."""
DELAYS_S = (0.0, 0.3, 0.6)
"""Delays of the camera's speed against the speed on the air, which are tried beside each other."""
NOISE_M_S = 0.4
"""Sigma of a sample without the camera's: steps of 1 km/h on both speedometers, and delays."""
OFFSET_M_S, OFFSET_SHARE = 0.4, 0.02
"""Sigma of the difference of the speedometers: constant, and as a share of the speed. OBD speeds
are 0.4 to 1.2 % high in recorded drives."""
TRAFFIC_M_S = 3.0
"""Sigma of the speed of other vehicles in range against the own one."""
WANDERS_M_S = (0.05, 0.2, 0.8)
"""Sigmas by which a speed may change in a second, from cruise control to dense traffic."""
WANDER_MEMORY = 0.9
"""Share of what was learnt of these that is kept at each sample."""
MAX_STEP = 3.0
"""Bound of the evidence of one sample: one wrong speed decides nothing."""
MIN_EVIDENCE, MAX_EVIDENCE = -30.0, 12.0
"""Bounds of the sum: its error does not grow with the time driven in a row."""
OWN_ERROR_M_S = 1.0
"""Largest error of a change of the own speed, in steps of 1 km/h."""
SILENT_S = 2.0
"""Time without a speed after which a vehicle is forgotten."""
MAX_VEHICLES = 512
"""Vehicles kept; the one that was heard first is forgotten."""
_HISTORY = 16
"""Speeds kept of a vehicle: those of more than a second at 10 Hz."""


class _Filter:
    """Kalman filter of one slowly changing value."""

    def __init__(self, mean: float, variance: float) -> None:
        self._mean, self._variance = mean, variance

    def update(self, value: float, noise: float, drift: float) -> float:
        """Take a measurement and return the logarithm of its likelihood.

        Args:
            value: as measured.
            noise: its variance.
            drift: by which the variance of the state has grown since the measurement before.
        """
        variance = self._variance + drift
        total, innovation = variance + noise, value - self._mean
        gain = variance / total
        self._mean += gain * innovation
        self._variance = (1.0 - gain) * variance
        return _log_density(innovation, total)


class _LeadSpeed:
    """The speed of the lead as its own past predicts it."""

    def __init__(self, own_speed_m_s: float) -> None:
        self._filters = [_Filter(own_speed_m_s, TRAFFIC_M_S**2) for _ in WANDERS_M_S]
        self._logs = [0.0] * len(WANDERS_M_S)

    def update(self, speed_m_s: float, noise: float, seconds: float) -> float:
        """Take a sample and return the logarithm of its likelihood.

        Args:
            speed_m_s: of the lead.
            noise: variance of the sample.
            seconds: since the sample before.
        """
        before = _log_mean(self._logs)
        logs = [
            log + each.update(speed_m_s, noise, wander_m_s**2 * seconds)
            for log, each, wander_m_s in zip(self._logs, self._filters, WANDERS_M_S, strict=True)
        ]
        after = _log_mean(logs)
        self._logs = [WANDER_MEMORY * (each - after) for each in logs]
        return after - before


@dataclass(slots=True)
class _Vehicle:
    """A vehicle on the air."""

    speeds: deque[tuple[float, float]] = field(default_factory=lambda: deque(maxlen=_HISTORY))
    """Time in s and speed in m/s."""
    offsets: list[_Filter] = field(default_factory=list)
    """Difference of the speedometers for each delay; empty before the first sample."""
    evidence: list[float] = field(default_factory=lambda: [0.0] * len(DELAYS_S))
    decline: float = 0.0
    """Evidence against the vehicle since it was last at its highest; not above 0."""

    @property
    def log_ratio(self) -> float:
        """Evidence with all delays as likely."""
        return _log_mean(self.evidence)


class MotionMatch:
    """Evidence for each vehicle on the air that it is the lead."""

    def __init__(self) -> None:
        self._vehicles: OrderedDict[bytes, _Vehicle] = OrderedDict()
        self._lead_speed: _LeadSpeed | None = None
        self._sampled_at = -math.inf
        self._before: tuple[float, float] | None = None
        """Time and own speed of the last sample that did not jump."""
        self._jumped_m_s: float | None = None
        """The last own speed, if it differs from that one by more than brakes explain."""

    def restart(self) -> None:
        """Drop all evidence, not the speeds: another vehicle is the lead."""
        self._lead_speed = self._before = None
        self._jumped_m_s = None
        self._sampled_at = -math.inf
        for vehicle in self._vehicles.values():
            vehicle.offsets.clear()
            vehicle.evidence = [0.0] * len(DELAYS_S)
            vehicle.decline = 0.0

    def receive_speed_on_air(self, name: bytes, speed_m_s: float, now: float) -> None:
        """Take the speed that the vehicle with this temporary ID has sent."""
        vehicle = self._vehicles.setdefault(name, _Vehicle())
        vehicle.speeds.append((now, speed_m_s))
        self._vehicles.move_to_end(name)
        while self._vehicles:
            oldest = next(iter(self._vehicles.values()))
            if len(self._vehicles) <= MAX_VEHICLES and now - oldest.speeds[-1][0] < SILENT_S:
                break
            self._vehicles.popitem(last=False)

    def receive_lead_speed(
        self, speed_m_s: float, sigma_m_s: float, own_speed_m_s: float, now: float
    ) -> None:
        """Take a speed of the lead.

        Args:
            speed_m_s: own speed less closing speed.
            sigma_m_s: of the closing speed.
            own_speed_m_s: the own speed at the time of the image.
            now: that time in s.
        """
        seconds = now - self._sampled_at
        if seconds < SAMPLE_S:
            return
        noise = NOISE_M_S**2 + sigma_m_s**2
        if self._receive_own_speed(own_speed_m_s, now):
            self.restart()
        if self._jumped_m_s is None:
            self._before = now, own_speed_m_s
        self._sampled_at = now
        if self._lead_speed is None:
            self._lead_speed = _LeadSpeed(own_speed_m_s)
            seconds = 0.0
        by_itself = self._lead_speed.update(speed_m_s, noise, seconds)
        for vehicle in self._vehicles.values():
            if vehicle.offsets:
                self._compare(vehicle, speed_m_s, noise, by_itself, now)
            else:
                self._begin(vehicle, speed_m_s, noise, own_speed_m_s, now)

    def log_ratio(self, name: bytes) -> float:
        """Logarithm of the likelihood ratio that it is the lead; 0 if nothing is known."""
        vehicle = self._vehicles.get(name)
        return 0.0 if vehicle is None else vehicle.log_ratio

    def decline(self, name: bytes) -> float:
        """Evidence against this vehicle since it was last at its highest; not above 0."""
        vehicle = self._vehicles.get(name)
        return 0.0 if vehicle is None else vehicle.decline

    def refute(self, name: bytes) -> None:
        """Keep only the evidence since this vehicle was last at its highest."""
        vehicle = self._vehicles.get(name)
        if vehicle is not None:
            vehicle.evidence = [vehicle.decline] * len(DELAYS_S)
            vehicle.decline = 0.0

    def is_on_air(self, name: bytes) -> bool:
        """Whether the vehicle has sent its speed lately."""
        return name in self._vehicles

    def log_ratios(self) -> dict[bytes, float]:
        """Logarithms of the likelihood ratios of all vehicles on the air."""
        return {name: vehicle.log_ratio for name, vehicle in self._vehicles.items()}

    def __len__(self) -> int:
        return len(self._vehicles)

    def _receive_own_speed(self, own_speed_m_s: float, now: float) -> bool:
        """Take the own speed; return whether the one before was a jump that this one confirms."""
        if self._before is None:
            return False
        at_s, before_m_s = self._before
        step_m_s, jumped_m_s = own_speed_m_s - before_m_s, self._jumped_m_s
        if jumped_m_s is not None and abs(own_speed_m_s - jumped_m_s) < abs(step_m_s):
            return True
        is_first = is_jump(step_m_s, now - at_s, OWN_ERROR_M_S)
        self._jumped_m_s = own_speed_m_s if is_first else None
        return False

    def _begin(
        self, vehicle: _Vehicle, speed_m_s: float, noise: float, own_speed_m_s: float, now: float
    ) -> None:
        """Compare the first speed of a vehicle: with the lead's, and with all traffic."""
        on_air_m_s = speed_at(vehicle.speeds, max(now, vehicle.speeds[0][0]))
        if on_air_m_s is None:
            return
        variance = OFFSET_M_S**2 + (OFFSET_SHARE * speed_m_s) ** 2
        vehicle.offsets = [_Filter(0.0, variance) for _ in DELAYS_S]
        by_traffic = _log_density(on_air_m_s - own_speed_m_s, TRAFFIC_M_S**2)
        for index, offset in enumerate(vehicle.offsets):
            likelihood = offset.update(speed_m_s - on_air_m_s, noise, 0.0)
            vehicle.evidence[index] = _bounded(likelihood - by_traffic)

    def _compare(
        self, vehicle: _Vehicle, speed_m_s: float, noise: float, by_itself: float, now: float
    ) -> None:
        before = vehicle.log_ratio
        for index, delay_s in enumerate(DELAYS_S):
            on_air_m_s = speed_at(vehicle.speeds, now - delay_s)
            if on_air_m_s is None:
                continue
            likelihood = vehicle.offsets[index].update(
                speed_m_s - on_air_m_s, noise, WANDERS_M_S[0] ** 2 * SAMPLE_S
            )
            step = min(max(likelihood - by_itself, -MAX_STEP), MAX_STEP)
            vehicle.evidence[index] = _bounded(vehicle.evidence[index] + step)
        vehicle.decline = min(0.0, vehicle.decline + vehicle.log_ratio - before)


def speed_at(
    speeds: Sequence[tuple[float, float]], at_s: float, hold_s: float = SAMPLE_S
) -> float | None:
    """Return the speed at a time in m/s, linear between samples; `None` if none is near.

    Args:
        speeds: time in s and speed in m/s, the last one last.
        at_s: the time in s.
        hold_s: time for which the last one is valid.
    """
    if not speeds:
        return None
    last_s, last_m_s = speeds[-1]
    if at_s >= last_s:
        return last_m_s if at_s - last_s < hold_s else None
    for (before_s, before_m_s), (after_s, after_m_s) in pairwise(speeds):
        if before_s <= at_s < after_s:
            share = (at_s - before_s) / (after_s - before_s)
            return before_m_s + share * (after_m_s - before_m_s)
    return None


def _bounded(evidence: float) -> float:
    return min(max(evidence, MIN_EVIDENCE), MAX_EVIDENCE)


def _log_mean(logs: Sequence[float]) -> float:
    """Logarithm of the mean of the values whose logarithms are given."""
    highest = max(logs)
    return highest + math.log(sum(math.exp(each - highest) for each in logs) / len(logs))


def _log_density(difference: float, variance: float) -> float:
    return -0.5 * (math.log(2.0 * math.pi * variance) + difference * difference / variance)
