"""Reaction times from what the box sees: the car ahead brakes, and then the driver does.

The car ahead is seen to brake when the gap begins to close fast. That is certain only late, so it
is dated back to the last frame in which the gap closed slowly. The driver's foot must have been off
the brake; if the gap stops closing without the driver's braking, there was no reaction to learn.
"""

from typing import NamedTuple

from onboard.observations import NEW_LEAD_M, BrakePedal, HardBrake, Lead, Speed

STEADY_M_S = 0.5
"""Closing slower than this, nobody brakes."""
CLOSING_M_S = 1.5
"""Closing faster than this, beyond what noise explains, the car ahead brakes."""
SIGMAS = 2.0
"""Of the closing speed's noise."""
SLOWEST_M_S = 5.0
"""In a queue people brake before they must."""
FRESH_S = 1.0
"""An observation older than this is of another situation."""


class Reaction(NamedTuple):
    """The driver braked so long after the car ahead."""

    reaction_s: float
    headway_s: float
    """When the car ahead began."""


class ReactionObserver:
    """Pairs the lead car's braking with the driver's. Stamps are those of the observations."""

    def __init__(self) -> None:
        self._speed: Speed | None = None
        self._steady: Lead | None = None
        self._gap_m: float | None = None
        self._pending: tuple[float, float] | None = None
        self._closes = False
        self._pedal: BrakePedal | None = None

    def receive_speed(self, speed: Speed) -> None:
        """The own speed."""
        self._speed = speed

    def receive_lead(self, lead: Lead) -> None:
        """The car ahead, in each frame."""
        closing_m_s, before_m = lead.closing_speed_m_s, self._gap_m
        self._gap_m = lead.gap_m
        if lead.gap_m is None or closing_m_s is None:
            self._forget()
            return
        if before_m is not None and abs(lead.gap_m - before_m) > NEW_LEAD_M:
            self._forget()
        if closing_m_s <= STEADY_M_S:
            self._steady = lead
            if self._closes:
                self._pending, self._closes = None, False
        elif closing_m_s - SIGMAS * (lead.closing_speed_sigma_m_s or 0.0) > CLOSING_M_S:
            if self._steady is not None and not self._closes:
                self._begin(self._steady.stamp_s, lead.stamp_s)
            self._closes = True

    def receive_brake_pedal(self, pedal: BrakePedal) -> Reaction | None:
        """The driver's foot, where the car tells; the reaction if this is one."""
        pressed_now = pedal.pressed and (self._pedal is None or not self._pedal.pressed)
        self._pedal = pedal
        return self._end(pedal.stamp_s) if pressed_now else None

    def receive_hard_brake(self, brake: HardBrake) -> Reaction | None:
        """The own car brakes hard: the only sign in a car that does not tell of its pedal."""
        return self._end(brake.stamp_s)

    def _forget(self) -> None:
        self._steady, self._pending, self._closes = None, None, False

    def _begin(self, began_s: float, certain_s: float) -> None:
        steady, speed, pedal = self._steady, self._speed, self._pedal
        if self._pending is not None or steady is None or speed is None:
            return
        if pedal is not None and pedal.pressed and certain_s - pedal.stamp_s <= FRESH_S:
            return
        if certain_s - min(steady.stamp_s, speed.stamp_s) > FRESH_S or steady.gap_m is None:
            return
        if speed.speed_m_s >= SLOWEST_M_S:
            self._pending = began_s, steady.gap_m / speed.speed_m_s

    def _end(self, stamp_s: float) -> Reaction | None:
        if self._pending is None:
            return None
        (began_s, headway_s), self._pending = self._pending, None
        return Reaction(stamp_s - began_s, headway_s)
