"""Path prediction of the BSM: a circle whose radius is speed over yaw rate (SAE J2945/1, A.6).

The yaw rate is the slope of the GNSS course (`onboard/kinematics/course_rate.py`).
"""

import math

import numpy as np

from onboard.kinematics.course_rate import STANDSTILL_M_S, CourseRate, course_rate
from onboard.messages.bsm_safety import PathPrediction
from onboard.observations import Position

STRAIGHT_M = 2500.0
"""Radius above which the path is sent as straight (SAE J2945/1, A.6)."""

CHANGES_DEG_S2 = (0.0, 2.5, 5.0, 25.0)
CONFIDENCES = (1.0, 0.5, 0.4, 0.0)
"""Confidence by the rate of change of the yaw rate (SAE J2945/1, Table A3)."""


class PathPredictor:
    """Estimates yaw rate and predicted path from GNSS fixes."""

    def __init__(self) -> None:
        self._courses = CourseRate()

    def receive_position(self, fix: Position) -> None:
        """Take the next fix; a late one is ignored."""
        self._courses.receive_position(fix)

    @property
    def yaw_rate_rad_s(self) -> float | None:
        """Yaw rate, positive to the right; `None` while unknown."""
        return course_rate(self._courses.newest)

    @property
    def prediction(self) -> PathPrediction | None:
        """The predicted path for the BSM; `None` while unknown. At rest it is straight."""
        speed_m_s = self._courses.speed_m_s
        if speed_m_s is not None and speed_m_s < STANDSTILL_M_S:
            return PathPrediction(radius_of_curve_m=None, confidence=1.0)
        newest, before = self._courses.newest, self._courses.before
        now, then = course_rate(newest), course_rate(before)
        if speed_m_s is None or now is None or then is None:
            return None
        elapsed_s = (newest[0][0] + newest[-1][0] - before[0][0] - before[-1][0]) / 2
        change_deg_s2 = math.degrees(abs(now - then)) / elapsed_s
        is_straight = speed_m_s > STRAIGHT_M * abs(now)
        return PathPrediction(
            radius_of_curve_m=None if is_straight else speed_m_s / now,
            confidence=float(np.interp(change_deg_s2, CHANGES_DEG_S2, CONFIDENCES)),
        )
