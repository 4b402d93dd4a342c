"""Whether a vehicle on the air moves as the lead does.

BSMs and answers give the speed of a vehicle on the air, and the own speed less the closing speed
that of the lead. Each sample of the latter is explained in two ways:

- The vehicle on the air is the lead: the sample is that vehicle's speed a moment ago, plus a
  constant difference of the speedometers, plus noise.
- Another vehicle is the lead: the sample is near the one before, since speeds change slowly. How
  slowly is learnt from the samples: at constant speeds, equal speeds are no evidence.

A third explanation is that the vehicle on the air is another one of the same row: the lead follows
it, some seconds later, or it follows the lead. Speeds then differ by more than those of
speedometers, and the difference changes.

All are Kalman filters with one state. The logarithm of the ratio of their likelihoods is the
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
from typing import NamedTuple

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
FOLLOWING_M_S, FOLLOWING_DRIFT_M_S = 1.0, 0.2
"""Sigma of the difference of two speeds of one row, some samples apart, at first; and by which it
changes in a second: of those who do not follow as closely as speedometers agree."""
AHEAD_SAMPLES = ((3, True), (5, True), (5, False), (9, False))
BEHIND_SAMPLES = ((5, True), (9, False))
"""By how many samples the lead may follow a vehicle ahead of it, or one behind follows the lead;
and whether it does so closely."""
ELSEWHERE = -5.0
"""Evidence below which a vehicle is not asked what else explains its motion."""
WANDERS_M_S = (0.05, 0.2, 0.8)
"""Sigmas by which a speed may change in a second, from cruise control to dense traffic."""
WANDER_MEMORY = 0.9
"""Share of what was learnt of these that is kept at each sample."""
MAX_STEP = 3.0
"""Bound of the evidence of one sample: one wrong speed decides nothing."""
MIN_EVIDENCE, MAX_EVIDENCE = -30.0, 12.0
"""Bounds of the sum: its error does not grow with the time driven in a row. What explains a vehicle
better than another explanation does so at the bound, too."""
OWN_ERROR_M_S = 1.0
"""Largest error of a change of the own speed, in steps of 1 km/h."""
SILENT_S = 2.0
"""Time without a speed after which a vehicle is forgotten."""
MAX_VEHICLES = 512
"""Vehicles kept; the one that was heard first is forgotten."""
_HISTORY = 16
"""Speeds kept of a vehicle: those of more than a second at 10 Hz."""
_SAMPLES = max(AHEAD_SAMPLES + BEHIND_SAMPLES)[0] + 2
"""Samples kept of the lead and of each vehicle."""


class _Filter:
    """Kalman filter of one slowly changing value."""

    __slots__ = ("_mean", "_variance")

    def __init__(self, mean: float, variance: float) -> None:
        self._mean, self._variance = mean, variance

    def copy(self) -> "_Filter":
        """Return another one that starts here."""
        return _Filter(self._mean, self._variance)

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


class _Explanation:
    """The lead's speed is that of a vehicle on the air, but for a slowly changing difference."""

    __slots__ = ("_drift", "_offset", "evidence")

    def __init__(self, offset: _Filter, drift: float, evidence: float) -> None:
        """Start with the difference, its drift from sample to sample, and the first evidence."""
        self._offset, self._drift, self.evidence = offset, drift, evidence

    def copy(self) -> "_Explanation":
        """Return another one that starts here."""
        return _Explanation(self._offset.copy(), self._drift, self.evidence)

    def update(self, difference_m_s: float, noise: float, by_itself: float) -> None:
        """Take a further one, which is judged by the lead's own past."""
        likelihood = self._offset.update(difference_m_s, noise, self._drift)
        self.evidence += min(max(likelihood - by_itself, -MAX_STEP), MAX_STEP)


class _Sample(NamedTuple):
    """One speed of the lead."""

    speed_m_s: float
    noise: float
    """Its variance."""
    by_itself: float
    """Logarithm of the likelihood by the lead's own past."""


@dataclass(slots=True)
class _Vehicle:
    """A vehicle on the air."""

    speeds: deque[tuple[float, float]] = field(default_factory=lambda: deque(maxlen=_HISTORY))
    """Time in s and speed in m/s."""
    sampled: deque[float | None] = field(default_factory=lambda: deque(maxlen=_SAMPLES))
    """Speed at each of the latest samples, the last one last."""
    as_lead: list[_Explanation] = field(default_factory=list)
    """For each delay; empty before the first sample, as the next two."""
    ahead: list[_Explanation] = field(default_factory=list)
    behind: list[_Explanation] = field(default_factory=list)
    log_ratio: float = 0.0
    """Evidence that it is the lead, with all delays as likely."""
    in_row_log_ratio: float = 0.0
    """Evidence that it is another vehicle of the row."""
    decline: float = 0.0
    """Evidence against the vehicle since it was last at its highest; not above 0."""

    def restart(self) -> None:
        """Drop all evidence, not the speeds."""
        for each in (self.sampled, self.as_lead, self.ahead, self.behind):
            each.clear()
        self.log_ratio = self.in_row_log_ratio = self.decline = 0.0

    def weigh(self) -> None:
        """Take the evidence of what the explanations have become."""
        self.log_ratio = _evidence(self.as_lead)
        self.in_row_log_ratio = _evidence([*self.ahead, *self.behind])

    def bound(self) -> None:
        """Keep the sums within their bounds, and their differences below the upper one."""
        self.weigh()
        excess = max(0.0, max(self.log_ratio, self.in_row_log_ratio) - MAX_EVIDENCE)
        explanations = [*self.as_lead, *self.ahead, *self.behind]
        if excess or any(each.evidence < MIN_EVIDENCE for each in explanations):
            for each in explanations:
                each.evidence = max(each.evidence - excess, MIN_EVIDENCE)
            self.weigh()


class MotionMatch:
    """Evidence for each vehicle on the air that it is the lead."""

    def __init__(self) -> None:
        self._vehicles: OrderedDict[bytes, _Vehicle] = OrderedDict()
        self._lead_speed: _LeadSpeed | None = None
        self._samples: deque[_Sample] = deque(maxlen=_SAMPLES)
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
        self._samples.clear()
        for vehicle in self._vehicles.values():
            vehicle.restart()

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
        self._samples.append(_Sample(speed_m_s, noise, by_itself))
        for vehicle in self._vehicles.values():
            if vehicle.as_lead:
                self._compare(vehicle, now)
            else:
                _begin(vehicle, self._samples[-1], own_speed_m_s, now)

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
            for each in vehicle.as_lead:
                each.evidence = vehicle.decline
            vehicle.decline = 0.0
            vehicle.weigh()

    def is_on_air(self, name: bytes) -> bool:
        """Whether the vehicle has sent its speed lately."""
        return name in self._vehicles

    def log_ratios(self) -> dict[bytes, float]:
        """Logarithms of the likelihood ratios of all vehicles on the air."""
        return {name: vehicle.log_ratio for name, vehicle in self._vehicles.items()}

    def in_row_log_ratios(self) -> dict[bytes, float]:
        """The same for each being another vehicle of the row, ahead of the lead or behind."""
        return {name: vehicle.in_row_log_ratio for name, vehicle in self._vehicles.items()}

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

    def _compare(self, vehicle: _Vehicle, now: float) -> None:
        before, latest = vehicle.log_ratio, self._samples[-1]
        vehicle.sampled.append(speed_at(vehicle.speeds, now))
        for delay_s, each in zip(DELAYS_S, vehicle.as_lead, strict=True):
            _explain(each, latest, speed_at(vehicle.speeds, now - delay_s))
        after = _evidence(vehicle.as_lead)
        vehicle.decline = min(0.0, vehicle.decline + after - before)
        if after > ELSEWHERE:
            self._compare_in_row(vehicle)
        vehicle.bound()

    def _compare_in_row(self, vehicle: _Vehicle) -> None:
        latest = self._samples[-1]
        for (lag, _), each in zip(AHEAD_SAMPLES, vehicle.ahead, strict=True):
            _explain(each, latest, vehicle.sampled[-min(1 + lag, len(vehicle.sampled))])
        for (lag, _), each in zip(BEHIND_SAMPLES, vehicle.behind, strict=True):
            is_kept = lag < len(self._samples) - 1  # the first is judged by all traffic
            _explain(each, self._samples[-1 - lag * is_kept], vehicle.sampled[-1])


def _begin(vehicle: _Vehicle, sample: _Sample, own_speed_m_s: float, now: float) -> None:
    """Compare the first speed of a vehicle: with the lead's, and with all traffic."""
    on_air_m_s = speed_at(vehicle.speeds, max(now, vehicle.speeds[0][0]))
    if on_air_m_s is None:
        return
    by_traffic = _log_density(on_air_m_s - own_speed_m_s, TRAFFIC_M_S**2)
    offset = OFFSET_M_S**2 + (OFFSET_SHARE * sample.speed_m_s) ** 2

    def begun(variance: float, drift_m_s: float) -> _Explanation:
        each = _Filter(0.0, variance)
        likelihood = each.update(sample.speed_m_s - on_air_m_s, sample.noise, 0.0)
        return _Explanation(each, drift_m_s**2 * SAMPLE_S, _bounded(likelihood - by_traffic))

    close = begun(offset, WANDERS_M_S[0])
    loose = begun(offset + FOLLOWING_M_S**2, FOLLOWING_DRIFT_M_S)
    vehicle.as_lead = [close.copy() for _ in DELAYS_S]
    vehicle.ahead = [(close if is_close else loose).copy() for _, is_close in AHEAD_SAMPLES]
    vehicle.behind = [(close if is_close else loose).copy() for _, is_close in BEHIND_SAMPLES]
    vehicle.sampled.append(on_air_m_s)
    vehicle.weigh()


def _explain(explanation: _Explanation, sample: _Sample, on_air_m_s: float | None) -> None:
    if on_air_m_s is not None:
        explanation.update(sample.speed_m_s - on_air_m_s, sample.noise, sample.by_itself)


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
    for (after_s, after_m_s), (before_s, before_m_s) in pairwise(reversed(speeds)):
        if before_s <= at_s < after_s:
            share = (at_s - before_s) / (after_s - before_s)
            return before_m_s + share * (after_m_s - before_m_s)
    return None


def _evidence(explanations: Sequence[_Explanation]) -> float:
    return _log_mean([each.evidence for each in explanations]) if explanations else 0.0


def _bounded(evidence: float) -> float:
    return min(max(evidence, MIN_EVIDENCE), MAX_EVIDENCE)


def _log_mean(logs: Sequence[float]) -> float:
    """Logarithm of the mean of the values whose logarithms are given."""
    highest = max(logs)
    return highest + math.log(sum(math.exp(each - highest) for each in logs) / len(logs))


def _log_density(difference: float, variance: float) -> float:
    return -0.5 * (math.log(2.0 * math.pi * variance) + difference * difference / variance)
