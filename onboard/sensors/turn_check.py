"""Finds a yaw rate sensor or a steering angle that turns otherwise than the vehicle does.

A sensor that is frozen, has the wrong sign or another scale is found by the angle through which the
vehicle turns in `WINDOW_S`: by the sensor, and by the GNSS courses. Where there are courses, a
sensor is used once it has agreed with them in a bend. Without courses, two sensors are compared
with each other, and neither is used while they differ.
"""

import math
from collections import deque

from onboard.kinematics.acceleration import is_late
from onboard.kinematics.course_rate import STANDSTILL_M_S
from onboard.observations import Position, Speed, Steering, YawRate

WINDOW_S = 2.0
"""In which a bend of 1,000 m turns a vehicle at 30 m/s by 0.06 rad."""
DIFFERENCE_RAD, DIFFERENCE_SHARE = 0.03, 0.5
"""Difference of two such angles that errors explain: offsets and delays, and a share of the larger
angle for the lag of courses and understeer."""
COURSE_SIGMA_M_S, SIGMAS = 0.1, 4.0
"""Error of a receiver's velocity, from which courses are made, and how many of its sigmas count."""
WINDOWS = 2
"""Consecutive windows that must differ: in one, wheels may slip."""
_KEPT_S = 2.0 * WINDOW_S
_NEAR_S = 0.3
"""A sample this near tells the angle at a time: it changes by less than is allowed."""


class TurnCheck:
    """Compares the sensors by the angles through which they say that the vehicle turned."""

    def __init__(self) -> None:
        """Start without samples; every sensor is believed."""
        self._speed_m_s = 0.0
        self._turned = {kind: _Turned() for kind in ("yaw_rate", "steering", "course")}
        self._differing = dict.fromkeys(("yaw_rate", "steering"), 0)
        """Consecutive windows in which a sensor differs."""
        self._proven: set[str] = set()
        """Sensors that have agreed with the courses in a bend."""
        self._has_courses = False
        self._compared_at = -math.inf
        self._tolerance_rad = DIFFERENCE_RAD

    def receive_observation(self, observation: Speed | YawRate | Steering | Position) -> None:
        """Take a sample, and compare if a window is over."""
        match observation:
            case Speed():
                self._speed_m_s = observation.speed_m_s
            case YawRate():
                self._turned["yaw_rate"].receive_rate(
                    observation.yaw_rate_rad_s, observation.stamp_s
                )
            case Steering():
                rate_rad_s = observation.curvature_1_m * self._speed_m_s
                self._turned["steering"].receive_rate(rate_rad_s, observation.stamp_s)
            case Position():
                self._receive_position(observation)
        if observation.stamp_s - self._compared_at >= WINDOW_S:
            self._compare(observation.stamp_s)

    def is_contradicted(self, observation: YawRate | Steering) -> bool:
        """Whether this sensor has turned otherwise than the vehicle lately."""
        return self._differing[observation.kind] >= WINDOWS

    def is_used(self, observation: YawRate | Steering) -> bool:
        """Whether this sensor tells how the vehicle turns, as far as is known."""
        is_proven = not self._has_courses or observation.kind in self._proven
        return is_proven and not self.is_contradicted(observation)

    def _receive_position(self, fix: Position) -> None:
        course = self._turned["course"]
        if fix.course_rad is None or fix.speed_m_s is None or fix.speed_m_s < STANDSTILL_M_S:
            course.clear()
            return
        course.receive_angle(fix.course_rad, fix.stamp_s)
        noise_rad = SIGMAS * math.sqrt(2.0) * COURSE_SIGMA_M_S / fix.speed_m_s
        self._tolerance_rad = DIFFERENCE_RAD + noise_rad

    def _compare(self, stamp_s: float) -> None:
        self._compared_at = stamp_s
        span = self._turned["course"].span()
        if span is not None and stamp_s - span[1] <= WINDOW_S:
            self._has_courses = True
            pairs = [("yaw_rate", "course"), ("steering", "course")]
        else:
            self._has_courses = False
            pairs = [("yaw_rate", "steering"), ("steering", "yaw_rate")]
            span, self._tolerance_rad = (stamp_s - WINDOW_S, stamp_s), DIFFERENCE_RAD
        for sensor, other in pairs:
            one, reference = (self._turned[name].between(*span) for name in (sensor, other))
            if one is None or reference is None:
                continue
            largest_rad = max(abs(one), abs(reference))
            allowed_rad = max(self._tolerance_rad, DIFFERENCE_SHARE * largest_rad)
            if abs(one - reference) > allowed_rad:
                self._differing[sensor] += 1
            elif largest_rad > self._tolerance_rad:
                self._differing[sensor] = 0
                self._proven |= {sensor} if self._has_courses else set()
            elif self._differing[sensor] < WINDOWS:
                self._differing[sensor] = 0  # on a straight road a frozen sensor agrees, too


class _Turned:
    """The angle through which a source says that the vehicle turned, of the last windows."""

    def __init__(self) -> None:
        self._angles: deque[tuple[float, float]] = deque()
        """(stamp in s, angle in rad, continuous)."""

    def clear(self) -> None:
        self._angles.clear()

    def receive_rate(self, rate_rad_s: float, stamp_s: float) -> None:
        last_s, angle = self._angles[-1] if self._angles else (stamp_s, 0.0)
        self._add(angle + rate_rad_s * (stamp_s - last_s), stamp_s)

    def receive_angle(self, angle_rad: float, stamp_s: float) -> None:
        last = self._angles[-1][1] if self._angles else angle_rad
        self._add(last + math.remainder(angle_rad - last, math.tau), stamp_s)

    def span(self) -> tuple[float, float] | None:
        """First and last stamp of the last window; `None` if it is not covered."""
        if not self._angles:
            return None
        until_s = self._angles[-1][0]
        inside = [stamp_s for stamp_s, _ in self._angles if stamp_s >= until_s - WINDOW_S - 1e-6]
        return (inside[0], until_s) if until_s - inside[0] >= 0.7 * WINDOW_S else None

    def between(self, from_s: float, until_s: float) -> float | None:
        """Angle turned between two stamps; `None` where there are no samples near them."""
        begin, end = self._at(from_s), self._at(until_s)
        return None if begin is None or end is None else end - begin

    def _at(self, stamp_s: float) -> float | None:
        near = min(self._angles, key=lambda each: abs(each[0] - stamp_s), default=None)
        return near[1] if near is not None and abs(near[0] - stamp_s) <= _NEAR_S else None

    def _add(self, angle_rad: float, stamp_s: float) -> None:
        if self._angles:
            if is_late(stamp_s, self._angles[-1][0], _KEPT_S):
                return
            if abs(stamp_s - self._angles[-1][0]) > WINDOW_S:
                self._angles.clear()
        self._angles.append((stamp_s, angle_rad))
        while self._angles[0][0] < stamp_s - _KEPT_S:
            self._angles.popleft()
