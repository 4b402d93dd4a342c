"""The angle through which the host vehicle has turned, by its yaw rate sensor."""

from bisect import bisect_left

from onboard.kinematics.acceleration import is_late
from onboard.observations import YawRate

YAW_RATE_SIGMA_RAD_S, YAW_RATE_SHARE = 0.005, 0.03
"""Sigma of a yaw rate sensor: its offset and the swaying in the lane; its scale."""
OFFSET_S = 1.0
"""Time over which such errors last."""
KEPT_S = 4.0
"""Longer than fixes and images come late."""
NEAR_S = 0.3
"""A sample tells the yaw rate up to this long before and after it."""


class TurnedAngle:
    """Integrates the samples."""

    def __init__(self) -> None:
        """Start without samples."""
        self._stamps_s: list[float] = []
        self._rates_rad_s: list[float] = []
        self._angles_rad: list[float] = []

    def receive_yaw_rate(self, sample: YawRate) -> None:
        """Take a sample; a late one is ignored, one after a gap begins anew."""
        angle_rad = 0.0
        if self._stamps_s:
            since_s = sample.stamp_s - self._stamps_s[-1]
            if is_late(sample.stamp_s, self._stamps_s[-1], KEPT_S):
                return
            if not 0.0 < since_s <= NEAR_S:
                self._drop(len(self._stamps_s))
            else:
                mean_rad_s = (self._rates_rad_s[-1] + sample.yaw_rate_rad_s) / 2.0
                angle_rad = self._angles_rad[-1] + mean_rad_s * since_s
        self._stamps_s.append(sample.stamp_s)
        self._rates_rad_s.append(sample.yaw_rate_rad_s)
        self._angles_rad.append(angle_rad)
        if self._stamps_s[0] < sample.stamp_s - 2.0 * KEPT_S:
            self._drop(bisect_left(self._stamps_s, sample.stamp_s - KEPT_S))

    def between(self, from_s: float, until_s: float) -> tuple[float, float] | None:
        """Return the angle turned between two stamps in either order, and its variance in rad^2.

        The angle is in rad, positive to the right. `None` where there are no samples near them.
        """
        begin_rad, end_rad = self._at(from_s), self._at(until_s)
        if begin_rad is None or end_rad is None:
            return None
        angle_rad, over_s = end_rad - begin_rad, abs(until_s - from_s)
        offset_variance = YAW_RATE_SIGMA_RAD_S**2 * over_s * OFFSET_S
        return angle_rad, offset_variance + (YAW_RATE_SHARE * angle_rad) ** 2

    def _at(self, stamp_s: float) -> float | None:
        after = bisect_left(self._stamps_s, stamp_s)
        near = [each for each in (after - 1, after) if 0 <= each < len(self._stamps_s)]
        if not near:
            return None
        nearest = min(near, key=lambda each: abs(self._stamps_s[each] - stamp_s))
        off_s = stamp_s - self._stamps_s[nearest]
        if abs(off_s) > NEAR_S:
            return None
        return self._angles_rad[nearest] + self._rates_rad_s[nearest] * off_s

    def _drop(self, count: int) -> None:
        for kept in (self._stamps_s, self._rates_rad_s, self._angles_rad):
            del kept[:count]
