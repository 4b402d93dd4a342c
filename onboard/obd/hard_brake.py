"""Detection of hard braking from samples of the vehicle's speed: when it begins, how hard, its end.

A straight line is fitted (least squares) to the newest samples, for every start in the window. Its
slope is the deceleration a; its standard error follows from the samples:

    sigma_a^2 = sigma^2 / sum (t_i - mean t)^2

where sigma^2 is the larger of the known variance of the source (steps of its scale, jitter of its
stamps, rough road) and of the samples' variance around the line. Braking is *certain* when a minus
`CONFIDENCE` standard errors exceeds the threshold for one of the starts. So coarse samples take
longer than fine ones, no line fits a step or a stale value, and stamps may be irregular.

After the alarm, one line is followed: the shortest since then that spans `END_SPAN_S` and tells
half the threshold from nothing. Braking is over when its slope is below half the threshold; the
level rises when its slope is certainly higher, and falls when it is lower for a while.
"""

import math
from collections import deque
from collections.abc import Iterator
from typing import NamedTuple

from onboard.kinematics.units import KM_H, STANDARD_GRAVITY_M_S2
from onboard.observations import BrakePedal, Speed

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
"""Highest deceleration of a tyre on a dry road; a larger step is a fault or a collision."""

MAX_LATENESS_S = 0.1
"""Largest age of a value on arrival: of an ECU that refreshes its response at 10 Hz."""

END_SPAN_S = 0.5
"""Least span of the samples after the alarm by which braking can be found to be over: a pumped
pedal is released for less."""
EASED_S = 0.5
"""Time for which the slope must be below the level: while a braking ends, it is for less."""


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
        self._raised_at = math.inf
        """Time of the alarm of a braking that is not over."""
        self._level_m_s2: float | None = None
        self._eases_from_s = math.inf
        """Since when the deceleration is certainly below that level."""

    @property
    def level_m_s2(self) -> float | None:
        """Certain deceleration of the present hard braking; `None` while there is none."""
        return self._level_m_s2

    @property
    def deceleration_m_s2(self) -> float | None:
        """Deceleration over the last `END_SPAN_S`, hard or not; `None` while it is unknown."""
        line = self._recent_line(-math.inf)
        return None if line is None else line.deceleration_m_s2

    def receive_pedal(self, pedal: BrakePedal) -> None:
        """Receive the state of the brake pedal, if the vehicle broadcasts it."""
        self._pedal_pressed = pedal.pressed

    def receive_speed(self, speed: Speed) -> None:
        """Receive the next sample.

        A stamp that goes back a little is ignored. Another source, an impossible step or a larger
        way back starts a new window.
        """
        samples = self._samples
        if samples:
            last = samples[-1]
            elapsed_s = speed.stamp_s - last.stamp_s
            if -WINDOW_S < elapsed_s < 0.0 and speed.source == last.source:
                return
            if abs(elapsed_s) > WINDOW_S:
                self.reset()
            elif speed.source != last.source or is_jump(last, speed):
                samples.clear()
        samples.append(speed)
        while samples[0].stamp_s < speed.stamp_s - WINDOW_S:
            samples.popleft()
        if self._level_m_s2 is None:
            self._begin(speed)
        else:
            self._follow(self._level_m_s2)

    def reset(self) -> None:
        """Forget all samples, after a silence; braking is over."""
        self._samples.clear()
        self._level_m_s2 = None

    def _begin(self, speed: Speed) -> None:
        confidence = CONFIDENCE_PEDAL_PRESSED if self._pedal_pressed else CONFIDENCE
        for line in self._lines(self._threshold_m_s2):
            error_m_s2 = self._error_m_s2(line, self._threshold_m_s2)
            if line.deceleration_m_s2 - confidence * error_m_s2 > self._threshold_m_s2:
                if speed.speed_m_s >= MIN_SPEED_M_S:
                    self._level_m_s2, self._raised_at = line.deceleration_m_s2, speed.stamp_s
                    self._eases_from_s = math.inf
                return

    def _follow(self, level_m_s2: float) -> None:
        line = self._recent_line(self._raised_at)
        if line is None:
            return
        if line.deceleration_m_s2 < self._threshold_m_s2 / 2:
            self._level_m_s2 = None
            # Older samples are of the braking that is over, and would raise it again.
            while self._samples[0].stamp_s < line.start_s:
                self._samples.popleft()
            return
        rise_m_s2 = line.deceleration_m_s2 - level_m_s2
        if abs(rise_m_s2) <= CONFIDENCE * self._error_m_s2(line, level_m_s2):
            self._eases_from_s = math.inf
            return
        newest_s = self._samples[-1].stamp_s
        if rise_m_s2 < 0.0:
            self._eases_from_s = min(self._eases_from_s, newest_s)
        if rise_m_s2 > 0.0 or newest_s - self._eases_from_s >= EASED_S:
            self._level_m_s2, self._eases_from_s = line.deceleration_m_s2, math.inf

    def _error_m_s2(self, line: _Line, limit_m_s2: float) -> float:
        """Standard error of the line's slope, compared with a limit."""
        return math.sqrt(max(self._known_variance(limit_m_s2), line.variance) / line.s_tt)

    def _recent_line(self, since_s: float) -> _Line | None:
        """The shortest line since `since_s` that can show whether braking is over."""
        half_m_s2 = self._threshold_m_s2 / 2
        least_s_tt = self._known_variance(half_m_s2) * (CONFIDENCE / half_m_s2) ** 2
        return next(
            (
                line
                for line in self._lines()
                if line.start_s >= since_s and line.span_s >= END_SPAN_S and line.s_tt >= least_s_tt
            ),
            None,
        )

    def _known_variance(self, deceleration_m_s2: float) -> float:
        """Variance of a sample, m^2/s^2, while the vehicle decelerates like this."""
        resolution_m_s = self._samples[-1].resolution_m_s if self._samples else 0.0
        jitter_m_s = STAMP_SIGMA_S * deceleration_m_s2
        return resolution_m_s**2 / 12 + ROAD_SIGMA_M_S**2 + jitter_m_s**2

    def _lines(self, above_m_s2: float = -math.inf) -> Iterator[_Line]:
        """Yield the lines through the newest 3, 4, 5 ... samples, those of more deceleration."""
        if not self._samples:
            return
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
            deceleration_m_s2 = -s_tv / s_tt
            if deceleration_m_s2 <= above_m_s2:
                continue
            s_vv = sum_vv - sum_v * sum_v / n
            yield _Line(
                start_s=sample.stamp_s,
                span_s=-t,
                deceleration_m_s2=deceleration_m_s2,
                s_tt=s_tt,
                variance=(s_vv - s_tv * s_tv / s_tt) / (n - 2),
            )


def is_jump(last: Speed, new: Speed) -> bool:
    """Whether the step, up or down, is impossible on a road."""
    return abs(least_deceleration_m_s2(last, new)) > MAX_DECELERATION_M_S2


def least_deceleration_m_s2(last: Speed, new: Speed) -> float:
    """Deceleration that explains both samples with the oldest value and the scale's largest error.

    Negative for an acceleration.
    """
    reach_s = abs(new.stamp_s - last.stamp_s) + MAX_LATENESS_S
    fall_m_s = last.speed_m_s - new.speed_m_s
    return math.copysign(max(abs(fall_m_s) - new.resolution_m_s, 0.0), fall_m_s) / reach_s
