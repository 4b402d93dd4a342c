"""Which way the own car faces: a Kalman filter in one dimension, over the receiver's courses.

A receiver has its course from a velocity, and the error of that is the same at every speed: the
course is wrong by the error over the speed, 0.4 degrees in town and 6 at a walk. From one course to
the next a car turns, by more the farther it drives and the slower it is: per metre, the variance of
its heading grows by the square of the curvature that a driver takes at that speed. So a car that
comes to a stand keeps what its better courses said, and who only just sets off believes the new.
"""

import math
from dataclasses import dataclass

from onboard.mvs.settings import SensingSettings
from onboard.observations import Position

CURVATURE_1_M = 0.02
"""That a heading may take up within a metre, at low speed."""
LATERAL_M_S2 = 1.5
"""And the most at any speed: where it would take more than this to the side, drivers do not. With
both, a heading wanders as on real drives (docs/decisions/0330)."""
SURPRISING = 3.0
"""Sigmas by which a course contradicts what was held: the car has turned, and it begins anew."""


@dataclass(frozen=True, slots=True)
class Heading:
    """What is known of a heading."""

    heading_rad: float
    """Clockwise from true north, from 0 to 2 pi."""
    sigma_rad: float


class HeadingFilter:
    """Takes fixes in the order of their stamps, tells the heading at any moment near the last."""

    def __init__(self, settings: SensingSettings) -> None:
        """`settings` say what is an error of the receiver's, and what of the camera's."""
        self._settings = settings
        self._heading_rad: float | None = None
        self._variance = 0.0
        self._stamp_s = 0.0
        self._speed_m_s = 0.0

    def receive_position(self, fix: Position) -> None:
        """Take the next fix; a course without a speed tells nothing."""
        if fix.speed_m_s is None:
            return
        self._variance += self._turned(fix.stamp_s, fix.speed_m_s)
        self._stamp_s, self._speed_m_s = fix.stamp_s, fix.speed_m_s
        if fix.course_rad is None or fix.speed_m_s < self._settings.heading_held_below_m_s:
            return
        noise = (self._settings.velocity_sigma_m_s / fix.speed_m_s) ** 2
        if self._heading_rad is not None:
            off_rad = math.remainder(fix.course_rad - self._heading_rad, math.tau)
            expected = self._variance + noise
            if off_rad**2 <= SURPRISING**2 * expected:
                gain = self._variance / expected
                self._heading_rad = (self._heading_rad + gain * off_rad) % math.tau
                self._variance *= 1.0 - gain
                return
        self._heading_rad, self._variance = fix.course_rad % math.tau, noise

    def at(self, stamp_s: float) -> Heading | None:
        """What is known of it at `stamp_s`; `None` until the car has driven."""
        if self._heading_rad is None:
            return None
        turned = self._turned(stamp_s, self._speed_m_s)
        variance = self._variance + turned + self._settings.heading_sigma_rad**2
        return Heading(self._heading_rad, math.sqrt(variance))

    def _turned(self, stamp_s: float, speed_m_s: float) -> float:
        """Variance of what the car may have turned by between the last fix and `stamp_s`."""
        slow_m_s, fast_m_s = sorted((self._speed_m_s, speed_m_s))
        way_m = fast_m_s * abs(stamp_s - self._stamp_s)
        curvature_1_m = min(CURVATURE_1_M, LATERAL_M_S2 / max(slow_m_s, 1.0) ** 2)
        return curvature_1_m**2 * way_m
