"""How fast the GNSS course turns: its slope over a short window, which lags by half of it."""

import math
from collections import deque
from collections.abc import Sequence

from onboard.kinematics.acceleration import is_late, slope
from onboard.observations import Position

WINDOW_S = 1.2
"""Window of the slope: two fixes of a receiver at 1 Hz, with jitter."""

STANDSTILL_M_S = 1.0
"""Speed below which the course is noise."""

Courses = Sequence[tuple[float, float]]
"""(stamp in s, course in rad, continuous across north)."""


class CourseRate:
    """Keeps the courses of two windows."""

    def __init__(self) -> None:
        """Start without courses."""
        self._courses: deque[tuple[float, float]] = deque()
        self.speed_m_s: float | None = None
        """Of the last fix."""

    def receive_position(self, fix: Position) -> None:
        """Take the next fix; a late one is ignored."""
        courses = self._courses
        if courses and is_late(fix.stamp_s, courses[-1][0], 2 * WINDOW_S):
            return
        self.speed_m_s = fix.speed_m_s
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
    def newest(self) -> Courses:
        """The courses of the last window."""
        if not self._courses:
            return []
        since_s = self._courses[-1][0] - WINDOW_S
        return [each for each in self._courses if each[0] >= since_s]

    @property
    def before(self) -> Courses:
        """The courses of the window before the last one, and the first of that."""
        newest = self.newest
        return [each for each in self._courses if newest and each[0] <= newest[0][0]]


def course_rate(courses: Courses) -> float | None:
    """Return the slope in rad/s; `None` if they cover less than half of the window."""
    if not courses or courses[-1][0] - courses[0][0] < WINDOW_S / 2:
        return None
    return slope(courses)
