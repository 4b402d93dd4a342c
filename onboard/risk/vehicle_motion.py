"""Acceleration of a vehicle along and across its course, from its velocities."""

import math

from onboard.kinematics.acceleration import AccelerationEstimator

TREND_WINDOW_S = 0.8
"""Window over which the acceleration of a vehicle is estimated that does not report it."""
SETTLED_SIGMA_M_S = 1.5
"""Largest sigma of a velocity, or closing speed, that has settled. Above it, two vehicles may have
been taken for a fast one, and a speed that settles looks like braking."""
_DIGITS = 3
"""Of times of measurements in s, so that the same one is recognised."""


class VehicleMotion:
    """Estimates both for one vehicle."""

    def __init__(self, window_s: float) -> None:
        """Estimate over `window_s`, of which half must be covered."""
        self._along = AccelerationEstimator(window_s)
        self._east, self._north = AccelerationEstimator(window_s), AccelerationEstimator(window_s)
        self._velocity_m_s = 0.0, 0.0

    def receive_velocity(
        self, now: float, measured_s: float, east_m_s: float, north_m_s: float
    ) -> None:
        """Take a velocity.

        Args:
            now: the time.
            measured_s: time of its last measurement. The same one again does not count along the
                course: it would hold the speed, and then step.
            east_m_s: eastward.
            north_m_s: northward.
        """
        self._velocity_m_s = east_m_s, north_m_s
        self._along.receive_speed(round(measured_s, _DIGITS), math.hypot(east_m_s, north_m_s))
        self._east.receive_speed(now, east_m_s)
        self._north.receive_speed(now, north_m_s)

    @property
    def acceleration_m_s2(self) -> float | None:
        """Along the course; `None` while the window is not covered."""
        return self._along.acceleration_m_s2

    @property
    def lateral_m_s2(self) -> float | None:
        """Across the course, to the left; `None` while the window is not covered, or at rest."""
        east, north = self._velocity_m_s
        to_east, to_north = self._east.acceleration_m_s2, self._north.acceleration_m_s2
        speed_m_s = math.hypot(east, north)
        if to_east is None or to_north is None or speed_m_s == 0.0:
            return None
        return (east * to_north - north * to_east) / speed_m_s
