"""Detection of hard braking from samples of the vehicle's speed: once for each braking.

A straight line is fitted (least squares) to the newest samples, for every start in the window. Its
slope is the deceleration a; its standard error follows from the samples:

    sigma_a^2 = sigma^2 / sum (t_i - mean t)^2

where sigma^2 is the larger of the known variance of the source (steps of its scale, jitter of its
stamps, rough road) and of the samples' variance around the line. Braking is *certain* when a minus
`CONFIDENCE` standard errors exceeds the threshold for one of the starts. So coarse samples take
longer than fine ones, no line fits a step or a stale value, and stamps may be irregular. The
detector is re-armed when the deceleration since the alarm (over the window at most) is below half
the threshold, or after a silence longer than the window.
"""

import math
from collections import deque
from collections.abc import Iterator
from typing import NamedTuple

from onboard.observations import BrakePedal, HardBrake, Speed
from onboard.units import KM_H, STANDARD_GRAVITY_M_S2

WINDOW_S = 1.2
"""Longest span of samples: three at 2 Hz, and braking that is long enough for a warning."""

MIN_SAMPLES = 3
"""Least samples of a line: two have no residual."""

MIN_SPAN_S = 0.09
"""Least span of a line: shorter ones measure the suspension and the scheduler."""

CONFIDENCE = 3.0
CONFIDENCE_PEDAL_PRESSED = 2.5
"""Standard errors; fewer suffice with a pressed pedal, which makes braking likely."""

MIN_SPEED_M_S = 5 * KM_H
"""Least speed: many wheel sensors drop from 3 km/h to 0 at once."""

ROAD_SIGMA_M_S = 0.1 * KM_H
"""Sigma of the wheels' speed around the vehicle's."""

STAMP_SIGMA_S = 0.015
"""Sigma of the time from measurement to arrival, without its constant part."""

MAX_DECELERATION_M_S2 = 12.0
"""Highest deceleration of a tyre on a dry road; a larger step is the sensor's."""

MAX_LATENESS_S = 0.1
"""Largest age of a value on arrival: of an ECU that refreshes its response at 10 Hz."""

REARM_SPAN_S = 0.5
"""Least span of the samples after the alarm by which braking can be found to be over."""


class _Line(NamedTuple):
    """The least-squares line through the samples from `start_s` on."""

    start_s: float
    span_s: float
    deceleration_m_s2: float
    s_tt: float
    """Sum of (t_i - mean t)^2."""
    variance: float
    """Variance of the speeds around the line, m^2/s^2."""


class HardBrakeDetector:
    """Detects hard braking; the module's docstring has the method."""

    def __init__(self, threshold_g: float) -> None:
        self._threshold_m_s2 = threshold_g * STANDARD_GRAVITY_M_S2
        self._samples: deque[Speed] = deque()
        self._pedal_pressed = False
        self._raised_at: float | None = None
        """Time of the alarm of a braking that is not over."""

    def receive_pedal(self, pedal: BrakePedal) -> None:
        """Receive the state of the brake pedal, if the vehicle broadcasts it."""
        self._pedal_pressed = pedal.pressed

    def receive_speed(self, speed: Speed) -> HardBrake | None:
        """Receive the next sample; returns hard braking when it becomes certain.

        A stamp that goes back a little is ignored. Another source, an impossible step or a larger
        way back starts a new window.
        """
        samples = self._samples
        if samples:
            last = samples[-1]
            elapsed_s = speed.stamp_s - last.stamp_s
            if -WINDOW_S < elapsed_s < 0.0 and speed.source == last.source:
                return None
            if abs(elapsed_s) > WINDOW_S:
                self._raised_at = None
                samples.clear()
            elif speed.source != last.source or _is_jump(last, speed):
                samples.clear()
        samples.append(speed)
        while samples[0].stamp_s < speed.stamp_s - WINDOW_S:
            samples.popleft()
        if self._raised_at is not None:
            if self._has_ended(self._raised_at):
                self._raised_at = None
            return None
        deceleration_m_s2 = self._certain_m_s2(speed.resolution_m_s)
        if deceleration_m_s2 is None or speed.speed_m_s < MIN_SPEED_M_S:
            return None
        self._raised_at = speed.stamp_s
        return HardBrake(speed.stamp_s, deceleration_m_s2, speed.source)

    def _certain_m_s2(self, resolution_m_s: float) -> float | None:
        """Deceleration that is certainly above the threshold, of the fewest samples."""
        confidence = CONFIDENCE_PEDAL_PRESSED if self._pedal_pressed else CONFIDENCE
        known_variance = (
            resolution_m_s**2 / 12 + ROAD_SIGMA_M_S**2 + (STAMP_SIGMA_S * self._threshold_m_s2) ** 2
        )
        for line in self._lines():
            error = math.sqrt(max(known_variance, line.variance) / line.s_tt)
            if line.deceleration_m_s2 - confidence * error > self._threshold_m_s2:
                return line.deceleration_m_s2
        return None

    def _has_ended(self, raised_at: float) -> bool:
        """Whether the braking with an alarm at `raised_at` is over."""
        longest = None
        for line in self._lines():
            if line.start_s < raised_at:
                break
            longest = line
        return (
            longest is not None
            and longest.span_s >= REARM_SPAN_S
            and longest.deceleration_m_s2 < self._threshold_m_s2 / 2
        )

    def _lines(self) -> Iterator[_Line]:
        """Yield the lines through the newest 3, 4, 5 ... samples."""
        newest = self._samples[-1]
        sum_t = sum_v = sum_tt = sum_tv = sum_vv = 0.0
        for n, sample in enumerate(reversed(self._samples), 1):
            # Relative to the newest sample, for numerical accuracy.
            t = sample.stamp_s - newest.stamp_s
            v = sample.speed_m_s - newest.speed_m_s
            sum_t += t
            sum_v += v
            sum_tt += t * t
            sum_tv += t * v
            sum_vv += v * v
            if n < MIN_SAMPLES or -t < MIN_SPAN_S:
                continue
            s_tt = sum_tt - sum_t * sum_t / n
            s_tv = sum_tv - sum_t * sum_v / n
            s_vv = sum_vv - sum_v * sum_v / n
            yield _Line(
                start_s=sample.stamp_s,
                span_s=-t,
                deceleration_m_s2=-s_tv / s_tt,
                s_tt=s_tt,
                variance=(s_vv - s_tv * s_tv / s_tt) / (n - 2),
            )


def _is_jump(last: Speed, new: Speed) -> bool:
    """Whether the step is impossible, with stale values and steps of the scale allowed for."""
    reach_s = abs(new.stamp_s - last.stamp_s) + MAX_LATENESS_S
    step_m_s = abs(new.speed_m_s - last.speed_m_s)
    return step_m_s > MAX_DECELERATION_M_S2 * reach_s + new.resolution_m_s
