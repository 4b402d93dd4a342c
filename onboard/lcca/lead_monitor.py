"""The lead vehicle by camera and speedometer: which one it is, and whether it is too close."""

from collections.abc import Mapping

from onboard.lcca.events import MeasuredLead
from onboard.lcca.parameters import GroupParameters
from onboard.messages.lcca import CarId
from onboard.sensors.host_state import SPEED_VALID_S


class LeadMonitor:
    """Evaluates each frame. A vehicle is *close* in a frame within the leave headway."""

    def __init__(self, parameters: GroupParameters) -> None:
        self._parameters = parameters
        self._speed_m_s = 0.0
        self._speed_until = float("-inf")
        self._lead: MeasuredLead | None = None
        self._is_close = False
        self._identified: CarId | None = None
        self._close_at: dict[CarId, float] = {}

    @property
    def identified(self) -> CarId | None:
        """The last vehicle identified; `None` after a frame in which the lane is free."""
        return self._identified

    def speed_at(self, now: float) -> float | None:
        """Return the own speed in m/s; `None` if it is too old: then no gap is too small."""
        return self._speed_m_s if now < self._speed_until else None

    def receive_speed(self, speed_m_s: float, now: float) -> None:
        """Take a sample of the own speed."""
        self._speed_m_s = speed_m_s
        self._speed_until = now + SPEED_VALID_S

    def receive_lead(
        self, lead: MeasuredLead | None, now: float, *, is_unknown: bool = False
    ) -> None:
        """Take one frame.

        Args:
            lead: the vehicle that it shows, if any.
            now: seconds on the cores' clock.
            is_unknown: whether one may be there although the frame shows none.
        """
        self._lead = lead
        self._is_close = self._is_within(self._parameters.leave_headway_s, now)
        if lead is None:
            self._identified = self._identified if is_unknown else None
        elif lead.car_id is not None:
            self._identified = lead.car_id
            if self._is_close:
                self._close_at[lead.car_id] = now
        horizon = now - self._parameters.lead_hold_s
        if any(at < horizon for at in self._close_at.values()):
            self._close_at = {car: at for car, at in self._close_at.items() if at >= horizon}

    def rename(self, names: Mapping[CarId, CarId]) -> None:
        """Take the new IDs of vehicles, by the old ones."""
        if self._identified is not None:
            self._identified = names.get(self._identified, self._identified)
        self._close_at = {names.get(key, key): at for key, at in self._close_at.items()}

    def close_at(self, car_id: CarId) -> float:
        """Return when that vehicle was last close; minus infinity if it never was."""
        return self._close_at.get(car_id, float("-inf"))

    def lead_to_join(self, now: float) -> CarId | None:
        """Return the lead's ID if it is identified and too close."""
        lead = self._lead
        if lead is None or lead.car_id is None:
            return None
        is_too_close = self._is_within(self._parameters.join_headway_s, now)
        return lead.car_id if is_too_close else None

    def is_far(self, car_id: CarId) -> bool:
        """Whether the last frame shows that vehicle, and beyond the leave headway."""
        lead = self._lead
        return lead is not None and lead.car_id == car_id and not self._is_close

    def shows_close(self, car_id: CarId | None) -> bool:
        """Whether the last frame shows that vehicle, and as close."""
        lead = self._lead
        if lead is None or lead.car_id is None:
            return False
        return lead.car_id == car_id and self._is_close

    def matches_speed(self, speed_m_s: float | None, now: float) -> bool:
        """Whether a vehicle with this speed can be the one that the camera sees.

        `True` where either speed is unknown.
        """
        own, lead = self.speed_at(now), self._lead
        if speed_m_s is None or own is None or lead is None or lead.closing_speed_m_s is None:
            return True
        seen_m_s = own - lead.closing_speed_m_s
        return abs(speed_m_s - seen_m_s) <= self._parameters.speed_tolerance_m_s

    def _is_within(self, headway_s: float, now: float) -> bool:
        """Compare the gap with the safety distance, headway times own speed (LCCA, section 3)."""
        speed, lead = self.speed_at(now), self._lead
        return lead is not None and speed is not None and lead.gap_m < headway_s * speed
