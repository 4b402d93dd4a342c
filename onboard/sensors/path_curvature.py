"""The curvature of the host vehicle's path, from all that measures how it turns.

Each source gives a yaw rate with a sigma: a yaw rate sensor, the angle of the steering wheel, and
the slope of the GNSS course. Over the speed, that is a curvature. They are weighed by their
variances, and what they differ by adds to the variance. A road is straight before it is measured,
with the curvatures that drivers take at this speed as its sigma: noisy sources count little.
"""

import math
from collections.abc import Iterator, Sequence

from onboard.kinematics.course_rate import WINDOW_S, CourseRate, course_rate
from onboard.kinematics.heading import CURVATURE_1_M, LATERAL_M_S2
from onboard.kinematics.turned_angle import YAW_RATE_SHARE, YAW_RATE_SIGMA_RAD_S
from onboard.observations import Curvature, Position, Speed, Steering, YawRate

STEERING_SIGMA_1_M, STEERING_SHARE = 0.0005, 0.15
"""Sigma of a curvature by the steering wheel: an offset of 1 degree; understeer, and the ratio."""
VELOCITY_SIGMA_M_S = 0.1
"""Error of a receiver's velocity on either axis, of which a course is made."""
SMOOTHING_S = 0.2
"""Time constant of the smoothing of signals, which comes as often as they do."""
VALID_S = 0.5
"""A signal that is older is not used."""
COURSE_VALID_S = 1.6
"""The same of a fix: receivers at 1 Hz deliver late."""
LEAST_SPEED_M_S = 2.0
"""At a lower speed no source tells the curvature."""


class PathCurvature:
    """Takes the observations of the host vehicle's sensors."""

    def __init__(self) -> None:
        """Start without sources."""
        self._speed: Speed | None = None
        self._yaw_rate = _Smoothed()
        self._steering = _Smoothed()
        self._courses = CourseRate()
        self._fixed_at = -math.inf

    def receive_observation(self, observation: Speed | YawRate | Steering | Position) -> None:
        """Take a sample; late ones are ignored."""
        match observation:
            case Speed():
                self._speed = observation
            case YawRate():
                self._yaw_rate.receive_sample(observation.yaw_rate_rad_s, observation.stamp_s)
            case Steering():
                self._steering.receive_sample(observation.curvature_1_m, observation.stamp_s)
            case Position():
                self._courses.receive_position(observation)
                self._fixed_at = observation.stamp_s

    def at(self, now: float) -> Curvature | None:
        """Return the curvature as known at `now`; `None` without a source."""
        speed = self._speed
        if speed is None or now - speed.stamp_s > VALID_S or speed.speed_m_s < LEAST_SPEED_M_S:
            return None
        sources = list(self._sources(speed.speed_m_s, now))
        if not sources:
            return None
        mean, variance = _combined(sources)
        road_1_m = min(CURVATURE_1_M, LATERAL_M_S2 / speed.speed_m_s**2)
        share = road_1_m**2 / (road_1_m**2 + variance)
        return Curvature(now, share * mean, math.sqrt(share * variance))

    def _sources(self, speed_m_s: float, now: float) -> Iterator[tuple[float, float]]:
        """Yield the curvature by each source that is recent, and its variance."""
        yaw_rate = self._yaw_rate.at(now)
        if yaw_rate is not None:
            sigma_rad_s = YAW_RATE_SIGMA_RAD_S + YAW_RATE_SHARE * abs(yaw_rate)
            yield yaw_rate / speed_m_s, (sigma_rad_s / speed_m_s) ** 2
        steering = self._steering.at(now)
        if steering is not None:
            yield steering, (STEERING_SIGMA_1_M + STEERING_SHARE * abs(steering)) ** 2
        newest, before = course_rate(self._courses.newest), course_rate(self._courses.before)
        if newest is not None and now - self._fixed_at <= COURSE_VALID_S:
            # It lags by half of the window: by as much as the rate has changed, it may be wrong.
            lag_rad_s = 0.0 if before is None else newest - before
            noise_rad_s = math.sqrt(2.0) * VELOCITY_SIGMA_M_S / speed_m_s / WINDOW_S
            yield newest / speed_m_s, (math.hypot(noise_rad_s, lag_rad_s) / speed_m_s) ** 2


def _combined(sources: Sequence[tuple[float, float]]) -> tuple[float, float]:
    """Mean and variance of values with their variances."""
    total = sum(1.0 / variance for _, variance in sources)
    mean = sum(value / variance for value, variance in sources) / total
    spread = sum((value - mean) ** 2 / variance for value, variance in sources) / total
    return mean, 1.0 / total + spread


class _Smoothed:
    """The mean of a signal's samples, the newest weighing most."""

    def __init__(self) -> None:
        self._value = 0.0
        self._stamp_s = -math.inf

    def receive_sample(self, value: float, stamp_s: float) -> None:
        if stamp_s <= self._stamp_s:
            return
        kept = math.exp((self._stamp_s - stamp_s) / SMOOTHING_S)
        self._value = kept * self._value + (1.0 - kept) * value
        self._stamp_s = stamp_s

    def at(self, now: float) -> float | None:
        return self._value if now - self._stamp_s <= VALID_S else None
