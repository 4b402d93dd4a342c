"""How hard a vehicle ahead brakes, by its speeds."""

from onboard.kinematics.acceleration import AccelerationEstimator, is_jump
from onboard.observations import NEW_LEAD_M
from onboard.risk.vehicle_motion import SETTLED_SIGMA_M_S
from onboard.sensors.host_state import BRAKING_WINDOW_S

LEAD_WINDOW_S = BRAKING_WINDOW_S
"""Window over which decelerations are estimated: ten images a second give six speeds."""
LEAD_DEADBAND_M_S2 = 1.5
"""Estimated decelerations of the lead below this may be noise, and count as none."""


class LeadMotion:
    """Deceleration of a vehicle ahead: the slope of its speed over a short window."""

    def __init__(self, window_s: float = LEAD_WINDOW_S) -> None:
        """Estimate over `window_s`."""
        self._trend = AccelerationEstimator(window_s)
        self._last: tuple[float, float, float] | None = None

    def receive_speed(self, stamp_s: float, gap_m: float, lead_speed_m_s: float) -> None:
        """Take its speed and the gap to it; a jump of either is another vehicle, and starts anew.

        Args:
            stamp_s: time of the observation.
            gap_m: to the vehicle.
            lead_speed_m_s: of the vehicle.
        """
        before_s, gap_before_m, speed_before_m_s = self._last or (stamp_s, gap_m, lead_speed_m_s)
        is_other_speed = is_jump(
            lead_speed_m_s - speed_before_m_s, abs(stamp_s - before_s), SETTLED_SIGMA_M_S
        )
        if is_other_speed or abs(gap_m - gap_before_m) > NEW_LEAD_M:
            self._trend.clear()
        self._last = stamp_s, gap_m, lead_speed_m_s
        self._trend.receive_speed(stamp_s, lead_speed_m_s)

    def clear(self) -> None:
        """Start anew: the speed is unknown."""
        self._trend.clear()

    def deceleration_m_s2(self, speed_sigma_m_s: float = 0.0) -> float:
        """Return the deceleration less its sigma; 0 while it is not clear that the vehicle brakes.

        Args:
            speed_sigma_m_s: of each speed.
        """
        slope = self._trend.acceleration_m_s2
        if slope is None:
            return 0.0
        certain_m_s2 = -slope - self._trend.sigma_m_s2(speed_sigma_m_s)
        return certain_m_s2 if certain_m_s2 >= LEAD_DEADBAND_M_S2 else 0.0
