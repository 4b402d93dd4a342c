"""Decides from the car's own speed samples that it brakes hard: once per braking, without guessing.

A straight line is fitted (least squares) to the newest samples, for every start in the window. Its
slope is the deceleration a; its standard error follows from the samples:

    sigma_a^2 = sigma^2 / sum (t_i - mean t)^2

where sigma^2 is the larger of what the source is known for (steps of its scale, stamps that jitter,
rough road) and of what the samples show around the line. Braking is *certain* when a less
`CONFIDENCE` standard errors exceeds the threshold for one of the starts. So coarse samples need
longer than fine ones, a step or a stale value (which no line fits) convinces nobody, and stamps
may be irregular. Re-armed when the deceleration since the alarm (over the window at most) has
fallen below half the threshold, or after a silence longer than the window.
"""

import math
from collections import deque
from collections.abc import Iterator
from typing import NamedTuple

from onboard.observations import BrakePedal, HardBrake, Speed
from onboard.units import KM_H, STANDARD_GRAVITY_M_S2

WINDOW_S = 1.2
"""Braking shorter than this is not worth a warning, and three samples at 2 Hz fit in."""

MIN_SAMPLES = 3
"""Two samples always lie on a line, so they say nothing about their own noise."""

MIN_SPAN_S = 0.09
"""Shorter spans measure the suspension and the scheduler, not the car."""

CONFIDENCE = 3.0
CONFIDENCE_PEDAL_PRESSED = 2.5
"""Standard errors; a pressed pedal makes braking likely before the samples show it."""

MIN_SPEED_M_S = 5 * KM_H
"""Many wheel sensors drop from 3 km/h to 0 at once; at walking pace there is no one to warn."""

ROAD_SIGMA_M_S = 0.1 * KM_H
"""Of the wheels' speed around the car's."""

STAMP_SIGMA_S = 0.015
"""Of the arrival around the measurement, once the constant delay is taken away."""

MAX_DECELERATION_M_S2 = 12.0
"""No tyre on a dry road does more; a larger step is the sensor's, not the car's."""

MAX_LATENESS_S = 0.1
"""How old a value may be on arrival: an ECU that refreshes its answer at 10 Hz."""

REARM_SPAN_S = 0.5
"""Braking is believed to be over only when the samples behind the alarm cover this much."""


class _Line(NamedTuple):
    """The least-squares line through the samples from `start_s` on."""

    start_s: float
    span_s: float
    deceleration_m_s2: float
    s_tt: float
    """Sum of (t_i - mean t)^2."""
    variance: float
    """Of the speeds around the line, m^2/s^2."""


class HardBrakeDetector:
    """See the module's head."""

    def __init__(self, threshold_g: float) -> None:
        self._threshold_m_s2 = threshold_g * STANDARD_GRAVITY_M_S2
        self._samples: deque[Speed] = deque()
        self._pedal_pressed = False
        self._raised_at: float | None = None
        """Of the braking that is not over yet."""

    def receive_pedal(self, pedal: BrakePedal) -> None:
        """Take the state of the brake pedal, where the car tells it."""
        self._pedal_pressed = pedal.pressed

    def receive_speed(self, speed: Speed) -> HardBrake | None:
        """Take the next sample; what it made certain, if anything.

        A stamp that goes back a little is not used. Another source, a step that no car can drive or
        a longer way back begins a new window.
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
        """Deceleration that is certainly above the threshold, from as few samples as show it."""
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
        """Whether the braking that was told at `raised_at` is over."""
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
        """Lines through the newest 3, 4, 5 ... samples."""
        newest = self._samples[-1]
        sum_t = sum_v = sum_tt = sum_tv = sum_vv = 0.0
        for n, sample in enumerate(reversed(self._samples), 1):
            # Relative to the newest sample, so that the sums lose no digits.
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
    """Whether no car can get from one to the other, stale values and steps of the scale allowed."""
    reach_s = abs(new.stamp_s - last.stamp_s) + MAX_LATENESS_S
    step_m_s = abs(new.speed_m_s - last.speed_m_s)
    return step_m_s > MAX_DECELERATION_M_S2 * reach_s + new.resolution_m_s
