"""Acceleration of the host vehicle, and its braking by its driver, where they are known."""

from onboard.kinematics.acceleration import AccelerationEstimator, is_jump, is_late
from onboard.observations import BrakePedal, Speed


class HostBraking:
    """Estimates it from the speed and, where the vehicle reports it, the brake pedal."""

    def __init__(self, window_s: float) -> None:
        """Estimate over `window_s`; older samples are not used."""
        self._window_s = window_s
        self._trend = AccelerationEstimator(window_s)
        self._speed: Speed | None = None
        self._pedal: BrakePedal | None = None

    def receive_speed(self, speed: Speed) -> None:
        """Take a sample; one after an impossible step, or of another source, starts anew."""
        last = self._speed
        if last is not None and is_late(speed.stamp_s, last.stamp_s, self._window_s):
            return
        if last is not None and (speed.source != last.source or _jumps(last, speed)):
            self._trend.clear()
        self._speed = speed
        self._trend.receive_speed(speed.stamp_s, speed.speed_m_s)

    def receive_pedal(self, pedal: BrakePedal) -> None:
        """Take the state of the pedal."""
        self._pedal = pedal

    def acceleration_m_s2(self, now: float) -> float | None:
        """Return the slope of the speed; `None` while it is unknown."""
        if self._speed is None or now - self._speed.stamp_s > self._window_s:
            return None
        return self._trend.acceleration_m_s2

    def at_least_m_s2(self, now: float) -> float | None:
        """Return the deceleration less what the steps of the speed may have added, 0 or more.

        It is no more than the newest speed allows beside any of the window, so that a driver who
        ceases to brake is noticed before half a window has passed.

        0 with the pedal released: the slope is half a window old, and braking by the engine or a
        cruise control is no reaction of the driver. `None` while it is unknown.
        """
        slope_m_s2 = self.acceleration_m_s2(now)
        if self._speed is None or slope_m_s2 is None:
            return None
        pedal = self._pedal
        if pedal is not None and now - pedal.stamp_s <= self._window_s and not pedal.pressed:
            return 0.0
        step_m_s = self._speed.resolution_m_s
        at_least_m_s2 = -slope_m_s2 - self._trend.largest_error_m_s2(step_m_s)
        return max(min(at_least_m_s2, -self._trend.least_m_s2(step_m_s)), 0.0)


def _jumps(last: Speed, new: Speed) -> bool:
    step_m_s, elapsed_s = new.speed_m_s - last.speed_m_s, new.stamp_s - last.stamp_s
    return is_jump(step_m_s, elapsed_s, new.resolution_m_s)
