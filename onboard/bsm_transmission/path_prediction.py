"""Path prediction of the BSM: a circle whose radius is speed over yaw rate (SAE J2945/1, A.6).

There is no gyroscope: the yaw rate is the slope of the GNSS course, and lags by half of `WINDOW_S`.
"""

import math
from collections import deque
from collections.abc import Sequence

import numpy as np

from onboard.kinematics.acceleration import is_late, slope
from onboard.messages.bsm_safety import PathPrediction
from onboard.observations import Position

WINDOW_S = 1.2
"""Window of the slope: two fixes of a receiver at 1 Hz, with jitter."""

STRAIGHT_M = 2500.0
"""Radius above which the path is sent as straight (SAE J2945/1, A.6)."""

STANDSTILL_M_S = 1.0
"""Speed below which the course is noise and the path is sent as straight."""

CHANGES_DEG_S2 = (0.0, 2.5, 5.0, 25.0)
CONFIDENCES = (1.0, 0.5, 0.4, 0.0)
"""Confidence by the rate of change of the yaw rate (SAE J2945/1, Table A3)."""

_Courses = Sequence[tuple[float, float]]
"""(stamp in s, course in rad, continuous across north)."""


class PathPredictor:
    """Estimates yaw rate and predicted path from GNSS fixes."""

    def __init__(self) -> None:
        self._courses: deque[tuple[float, float]] = deque()
        self._speed_m_s: float | None = None

    def receive_position(self, fix: Position) -> None:
        """Take the next fix; a late one is ignored."""
        courses = self._courses
        if courses and is_late(fix.stamp_s, courses[-1][0], 2 * WINDOW_S):
            return
        self._speed_m_s = fix.speed_m_s
        if fix.course_rad is None or fix.speed_m_s is None or fix.speed_m_s < STANDSTILL_M_S:
            courses.clear()
            return
        course = fix.course_rad
        if courses and abs(fix.stamp_s - courses[-1][0]) <= WINDOW_S:
            last = courses[-1][1]
            course = last + math.remainder(course - last, math.tau)
        else:
            courses.clear()
        courses.append((fix.stamp_s, course))
        while courses[0][0] < fix.stamp_s - 2 * WINDOW_S:
            courses.popleft()

    @property
    def yaw_rate_rad_s(self) -> float | None:
        """Yaw rate, positive to the right; `None` while unknown."""
        return _slope(self._newest())

    @property
    def prediction(self) -> PathPrediction | None:
        """The predicted path for the BSM; `None` while unknown."""
        if self._speed_m_s is not None and self._speed_m_s < STANDSTILL_M_S:
            return PathPrediction(radius_of_curve_m=None, confidence=1.0)
        newest = self._newest()
        before = [each for each in self._courses if newest and each[0] <= newest[0][0]]
        now, then = _slope(newest), _slope(before)
        if self._speed_m_s is None or now is None or then is None:
            return None
        elapsed_s = (newest[0][0] + newest[-1][0] - before[0][0] - before[-1][0]) / 2
        change_deg_s2 = math.degrees(abs(now - then)) / elapsed_s
        is_straight = self._speed_m_s > STRAIGHT_M * abs(now)
        return PathPrediction(
            radius_of_curve_m=None if is_straight else self._speed_m_s / now,
            confidence=float(np.interp(change_deg_s2, CHANGES_DEG_S2, CONFIDENCES)),
        )

    def _newest(self) -> list[tuple[float, float]]:
        if not self._courses:
            return []
        since_s = self._courses[-1][0] - WINDOW_S
        return [each for each in self._courses if each[0] >= since_s]


def _slope(courses: _Courses) -> float | None:
    """Return the slope in rad/s; `None` if they cover less than half of the window."""
    if not courses or courses[-1][0] - courses[0][0] < WINDOW_S / 2:
        return None
    return slope(courses)
