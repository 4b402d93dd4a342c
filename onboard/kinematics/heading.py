"""Heading of the host vehicle: a one-dimensional Kalman filter over courses and yaw rates.

A receiver derives the course from a velocity whose error is the same at every speed. So the error
of the course is that of the velocity over the speed: 0.4 degrees in town, 6 at walking pace.
Between two courses the vehicle may turn: per metre, the variance of its heading grows by the square
of the curvature that drivers take at that speed. So a vehicle that stops keeps the heading by its
better courses, and one that sets off takes the new ones. A yaw rate on the bus says how far it has
turned: it is weighed against that variance, and so counts for nothing at rest.
"""

import math
from dataclasses import dataclass

from onboard.kinematics.turned_angle import TurnedAngle
from onboard.observations import Position, YawRate

CURVATURE_1_M = 0.02
"""Curvature at low speed. Fitted with `LATERAL_M_S2` to real drives (docs/design/mvs.md)."""
LATERAL_M_S2 = 1.5
"""Lateral acceleration that drivers do not exceed; bounds the curvature at higher speeds."""
OUTLIER_SIGMAS = 3.0
"""A course that differs by more sigmas restarts the filter: the vehicle has turned."""
MIN_COURSE_SPEED_M_S = 1.0
"""At a lower speed the course is not used: it is wrong by 6 degrees or more."""


@dataclass(frozen=True, slots=True)
class Heading:
    """A heading and its uncertainty."""

    heading_rad: float
    """Clockwise from true north, from 0 to 2 pi."""
    sigma_rad: float


class HeadingFilter:
    """Filters the courses of fixes, which arrive in the order of their stamps, and yaw rates."""

    def __init__(self, velocity_sigma_m_s: float, mounting_sigma_rad: float) -> None:
        """Start without a heading.

        Args:
            velocity_sigma_m_s: error of the receiver's velocity on either axis.
            mounting_sigma_rad: constant error, added to the sigma of every heading.
        """
        self._velocity_sigma_m_s = velocity_sigma_m_s
        self._mounting_sigma_rad = mounting_sigma_rad
        self._heading_rad: float | None = None
        self._variance = 0.0
        self._stamp_s = 0.0
        self._speed_m_s = 0.0
        self._turned = TurnedAngle()

    def receive_yaw_rate(self, sample: YawRate) -> None:
        """Take a sample of the bus."""
        self._turned.receive_yaw_rate(sample)

    def receive_position(self, fix: Position) -> None:
        """Use the next fix; one without a speed is ignored."""
        if fix.speed_m_s is None:
            return
        turned_rad, variance = self._turn(fix.stamp_s, fix.speed_m_s)
        self._variance += variance
        if self._heading_rad is not None:
            self._heading_rad = (self._heading_rad + turned_rad) % math.tau
        self._stamp_s, self._speed_m_s = fix.stamp_s, fix.speed_m_s
        if fix.course_rad is None or fix.speed_m_s < MIN_COURSE_SPEED_M_S:
            return
        noise = (self._velocity_sigma_m_s / fix.speed_m_s) ** 2
        if self._heading_rad is not None:
            off_rad = math.remainder(fix.course_rad - self._heading_rad, math.tau)
            expected = self._variance + noise
            if off_rad**2 <= OUTLIER_SIGMAS**2 * expected:
                gain = self._variance / expected
                self._heading_rad = (self._heading_rad + gain * off_rad) % math.tau
                self._variance *= 1.0 - gain
                return
        self._heading_rad, self._variance = fix.course_rad % math.tau, noise

    def at(self, stamp_s: float) -> Heading | None:
        """Return the heading at `stamp_s`; `None` before the first usable course."""
        if self._heading_rad is None:
            return None
        turned_rad, turn_variance = self._turn(stamp_s, self._speed_m_s)
        variance = self._variance + turn_variance + self._mounting_sigma_rad**2
        return Heading((self._heading_rad + turned_rad) % math.tau, math.sqrt(variance))

    def _turn(self, stamp_s: float, speed_m_s: float) -> tuple[float, float]:
        """Angle turned between the last fix and `stamp_s`, and its variance in rad^2."""
        slow_m_s, fast_m_s = sorted((self._speed_m_s, speed_m_s))
        distance_m = fast_m_s * abs(stamp_s - self._stamp_s)
        curvature_1_m = min(CURVATURE_1_M, LATERAL_M_S2 / max(slow_m_s, 1.0) ** 2)
        driven = curvature_1_m**2 * distance_m
        measured = self._turned.between(self._stamp_s, stamp_s)
        if measured is None or driven == 0.0:
            return 0.0, driven
        turned_rad, noise = measured
        weight = driven / (driven + noise)
        return weight * turned_rad, weight * noise
