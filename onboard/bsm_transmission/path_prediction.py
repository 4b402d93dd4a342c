"""Where the car goes if nothing changes: the path prediction of its BSM (SAE J2945/1, A.6).

A circle, whose radius is speed over yaw rate. There is no gyroscope on these wires, so the yaw rate
is the slope of the receiver's course, and lags by half of `WINDOW_S`.
"""

import math
from collections import deque
from collections.abc import Sequence

import numpy as np

from onboard.kinematics.acceleration import is_late, slope
from onboard.messages.bsm_safety import PathPrediction
from onboard.observations import Position

WINDOW_S = 1.2
"""Two fixes of a receiver that gives one a second lie in it, and their jitter."""

STRAIGHT_M = 2500.0
"""A larger radius is called straight on."""

STANDING_M_S = 1.0
"""Below it a course says nothing, and the path is straight."""

CHANGES_DEG_S2 = (0.0, 2.5, 5.0, 25.0)
CONFIDENCES = (1.0, 0.5, 0.4, 0.0)
"""Table A3: who is just turning the wheel does not stay on the circle."""

_Courses = Sequence[tuple[float, float]]
"""(stamp in s, course in rad without a jump at north)"""


class PathPredictor:
    """Takes fixes, tells yaw rate and circle."""

    def __init__(self) -> None:
        self._courses: deque[tuple[float, float]] = deque()
        self._speed_m_s: float | None = None

    def receive_position(self, fix: Position) -> None:
        """Take the next fix; one that comes late is ignored."""
        courses = self._courses
        if courses and is_late(fix.stamp_s, courses[-1][0], 2 * WINDOW_S):
            return
        self._speed_m_s = fix.speed_m_s
        if fix.course_rad is None or fix.speed_m_s is None or fix.speed_m_s < STANDING_M_S:
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
        """To the right; `None` while it is not known."""
        return _slope(self._newest())

    @property
    def prediction(self) -> PathPrediction | None:
        """What the BSM says; `None` while it is not known."""
        if self._speed_m_s is not None and self._speed_m_s < STANDING_M_S:
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
    """`None` if they cover less than half of the window."""
    if not courses or courses[-1][0] - courses[0][0] < WINDOW_S / 2:
        return None
    return slope(courses)
