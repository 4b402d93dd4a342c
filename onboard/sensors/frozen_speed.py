"""Finds a speed of the bus that stays the same while the vehicle's speed over ground is another."""

from onboard.observations import Position, Speed
from onboard.sensors.host_state import PREDICTED_POSITION_VALID_S

FROZEN_AFTER_S = 2.0
"""A driver who holds the speed to one step of 1 km/h for longer drives at that speed."""
DIFFERENCE_M_S = 3.0
"""Between bus and receiver, more than slipping wheels and multipath give over `FROZEN_AFTER_S`."""
DIFFERENCE_SHARE = 0.1
"""Of the speed, in addition: largest error of a speedometer (UN R39)."""


class FrozenSpeed:
    """Compares the samples of each source with the last fix."""

    def __init__(self) -> None:
        self._unchanged: dict[str, Speed] = {}
        """By source: its first sample with the present value."""
        self._fix: Position | None = None

    def receive_position(self, position: Position) -> None:
        """Take a fix; without a speed it contradicts nothing."""
        self._fix = position

    def receive_speed(self, speed: Speed) -> bool:
        """Take a sample; return whether it repeats an old one that the receiver contradicts.

        One that changes is believed at once, since a frozen value does not.
        """
        first = self._unchanged.get(speed.source)
        if first is None or first.speed_m_s != speed.speed_m_s or first.stamp_s > speed.stamp_s:
            self._unchanged[speed.source] = first = speed
        fix = self._fix
        if fix is None or fix.speed_m_s is None:
            return False
        if speed.stamp_s - fix.stamp_s > PREDICTED_POSITION_VALID_S:
            return False
        largest_m_s = DIFFERENCE_M_S + DIFFERENCE_SHARE * speed.speed_m_s
        is_contradicted = abs(fix.speed_m_s - speed.speed_m_s) > largest_m_s
        return is_contradicted and fix.stamp_s - first.stamp_s >= FROZEN_AFTER_S
