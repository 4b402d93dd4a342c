"""What the camera and the speedometer say about the car ahead: who it is, and is it too close."""

from onboard.lcca.events import PrecedingVehicle
from onboard.lcca.settings import LccaSettings
from onboard.messages.lcca import CarId


class LeadMonitor:
    """Judges each frame. A car is *shown close* while frames keep it within the safety distance."""

    def __init__(self, settings: LccaSettings) -> None:
        self._settings = settings
        self._speed_m_s = 0.0
        self._speed_until = float("-inf")
        self._lead: PrecedingVehicle | None = None
        self._is_close = False
        self._named: CarId | None = None
        self._named_since = 0.0
        self._close_at: dict[CarId, float] = {}
        self.last_close_at = float("-inf")
        """When any car whose plate is known was last shown close."""

    @property
    def named(self) -> CarId | None:
        """The last plate read, until a frame shows no car ahead."""
        return self._named

    def speed_at(self, now: float) -> float | None:
        """Return the own speed in m/s, if it is known."""
        return self._speed_m_s if now < self._speed_until else None

    def receive_speed(self, speed_m_s: float, now: float) -> None:
        """The own speed, from the car."""
        self._speed_m_s = speed_m_s
        self._speed_until = now + self._settings.speed_hold_s

    def receive_preceding_vehicle(self, lead: PrecedingVehicle | None, now: float) -> None:
        """One frame's verdict on the car ahead."""
        self._lead = lead
        self._is_close = self._is_within(self._settings.leave_headway_s, now)
        if lead is None:
            self._named = None
        elif lead.car_id is not None:
            if lead.car_id != self._named:
                self._named, self._named_since = lead.car_id, now
            if self._is_close:
                self._close_at[lead.car_id] = self.last_close_at = now
        horizon = now - self._settings.lead_hold_s - self._settings.rename_s
        if any(at < horizon for at in self._close_at.values()):
            self._close_at = {car: at for car, at in self._close_at.items() if at >= horizon}

    def close_at(self, car_id: CarId) -> float:
        """Return when that car was last shown close; long ago if it never was."""
        return self._close_at.get(car_id, float("-inf"))

    def to_join(self, now: float) -> CarId | None:
        """Return the car ahead if this frame says to join it: known for a while, and too close."""
        lead = self._lead
        if lead is None or lead.car_id is None:
            return None
        if now - self._named_since < self._settings.identity_dwell_s:
            return None
        return lead.car_id if self._is_within(self._settings.join_headway_s, now) else None

    def shows_far(self, car_id: CarId) -> bool:
        """Whether the last frame shows that car, and not close."""
        return self._lead is not None and self._lead.car_id == car_id and not self._is_close

    def fits(self, speed_m_s: float | None, now: float) -> bool:
        """Whether a car that drives this fast can be the one that the camera sees."""
        own, lead = self.speed_at(now), self._lead
        if speed_m_s is None or own is None or lead is None or lead.closing_speed_m_s is None:
            return True
        seen_m_s = own - lead.closing_speed_m_s
        return abs(speed_m_s - seen_m_s) <= self._settings.speed_tolerance_m_s

    def _is_within(self, headway_s: float, now: float) -> bool:
        """The safety distance: headway times own speed (LCCA, section 3, in SI)."""
        speed = self.speed_at(now)
        return self._lead is not None and speed is not None and self._lead.gap_m < headway_s * speed
