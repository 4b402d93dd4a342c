"""Observes the driver's reaction times: the lead vehicle brakes, and then the driver does.

A lead that begins to brake shows as a gap that begins to close fast. This is certain only late, so
its beginning is set back to the last frame in which the gap closed slowly. A reaction counts only
if the brake pedal was released before; it is dropped if the gap stops closing before the driver
brakes.
"""

from typing import NamedTuple

from onboard.observations import NEW_LEAD_M, BrakeCause, BrakePedal, HardBrake, Lead, Speed

STEADY_M_S = 0.5
"""Closing speed up to which the lead does not brake."""
CLOSING_M_S = 1.5
"""Closing speed above which, after `SIGMAS` standard deviations, the lead brakes."""
SIGMAS = 2.0
"""Standard deviations that are subtracted from a closing speed."""
QUEUE_SPEED_M_S = 5.0
"""Slower, drivers in a queue brake before the lead does."""
MAXIMUM_AGE_S = 1.0
"""Older observations belong to another situation."""


class Reaction(NamedTuple):
    """The driver's reaction to one braking of the lead vehicle."""

    reaction_s: float
    """From the beginning of the lead's braking to that of the driver's."""
    headway_s: float
    """When the lead began to brake."""


class ReactionObserver:
    """Pairs the lead's braking with the driver's, by the time stamps of the observations."""

    def __init__(self) -> None:
        """Start without observations."""
        self._steady: Lead | None = None
        self._gap_m: float | None = None
        self._pending: tuple[float, float] | None = None
        self._is_closing = False
        self._pedal: BrakePedal | None = None
        self._brakes_hard = False

    def receive_lead(self, lead: Lead, speed: Speed | None) -> None:
        """Find out from one camera frame whether the lead brakes.

        Args:
            lead: as the frame shows it.
            speed: the host vehicle's; `None` if it is not known.
        """
        closing_m_s, before_m = lead.closing_speed_m_s, self._gap_m
        self._gap_m = lead.gap_m
        if lead.gap_m is None or closing_m_s is None:
            self._reset()
            return
        if before_m is not None and abs(lead.gap_m - before_m) > NEW_LEAD_M:
            self._reset()
        if closing_m_s <= STEADY_M_S:
            self._steady = lead
            if self._is_closing:
                self._pending, self._is_closing = None, False
        elif closing_m_s - SIGMAS * (lead.closing_speed_sigma_m_s or 0.0) > CLOSING_M_S:
            if self._steady is not None and not self._is_closing:
                self._begin(self._steady, speed, lead.stamp_s)
            self._is_closing = True

    def receive_brake_pedal(self, pedal: BrakePedal) -> Reaction | None:
        """Return the reaction if the driver has just pressed the pedal because of the lead."""
        pressed_now = pedal.pressed and (self._pedal is None or not self._pedal.pressed)
        self._pedal = pedal
        return self._end(pedal.stamp_s) if pressed_now else None

    def receive_hard_brake(self, brake: HardBrake) -> Reaction | None:
        """Return the reaction if the vehicle begins to brake hard: without a pedal signal.

        The driver's button is no braking.
        """
        if brake.cause is BrakeCause.TEST:
            return None
        begins = not (self._brakes_hard or brake.is_over)
        self._brakes_hard = not brake.is_over
        return self._end(brake.stamp_s) if begins else None

    def _reset(self) -> None:
        self._steady, self._pending, self._is_closing = None, None, False

    def _begin(self, steady: Lead, speed: Speed | None, certain_s: float) -> None:
        """Take that the lead has braked since the `steady` frame, which is certain only now."""
        pedal = self._pedal
        if self._pending is not None or speed is None:
            return
        if pedal is not None and pedal.pressed and certain_s - pedal.stamp_s <= MAXIMUM_AGE_S:
            return
        if certain_s - min(steady.stamp_s, speed.stamp_s) > MAXIMUM_AGE_S or steady.gap_m is None:
            return
        if speed.speed_m_s >= QUEUE_SPEED_M_S:
            self._pending = steady.stamp_s, steady.gap_m / speed.speed_m_s

    def _end(self, stamp_s: float) -> Reaction | None:
        if self._pending is None:
            return None
        (began_s, headway_s), self._pending = self._pending, None
        return Reaction(stamp_s - began_s, headway_s)
