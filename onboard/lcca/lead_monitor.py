"""The lead vehicle by camera and speedometer: which one it is, and whether it is too close."""

from collections.abc import Mapping

from onboard.lcca.events import MeasuredLead
from onboard.lcca.parameters import GroupParameters
from onboard.messages.lcca import CarId
from onboard.sensors.host_state import SPEED_VALID_S

CRAWL_M_S = 3.0
"""Slower than this the host vehicle crawls: in a jam, as fast as one walks, or at rest."""
NEAR_M = 5.0
"""A lead that was last identified nearer than this may be too near for the camera when it shows
none, and is there until the host vehicle has driven as far, compared with the lead."""


class LeadMonitor:
    """Evaluates each frame. A vehicle is *close* in a frame within the distance of leaving."""

    def __init__(self, parameters: GroupParameters) -> None:
        self._parameters = parameters
        self._speed_m_s = 0.0
        self._speed_until = float("-inf")
        self._lead: MeasuredLead | None = None
        self._is_close = False
        self._identified: CarId | None = None
        self._close_at: dict[CarId, float] = {}
        self._speed_s = float("-inf")
        self._lead_speed_m_s = 0.0
        self._lead_speed_until = float("-inf")
        self._approached_m = float("inf")
        """What the host vehicle has driven more than the identified one, since that was near."""

    @property
    def identified(self) -> CarId | None:
        """The last vehicle identified; `None` after a frame in which the lane is free."""
        return self._identified

    def speed_at(self, now: float) -> float | None:
        """Return the own speed in m/s; `None` if it is too old: then no gap is too small."""
        return self._speed_m_s if now < self._speed_until else None

    def receive_speed(self, speed_m_s: float, now: float) -> None:
        """Take a sample of the own speed."""
        if now < self._speed_until:
            lead_m_s = self._lead_speed_m_s if now < self._lead_speed_until else 0.0
            self._approached_m += (speed_m_s - lead_m_s) * (now - self._speed_s)
        self._speed_m_s, self._speed_s = speed_m_s, now
        self._speed_until = now + SPEED_VALID_S

    def receive_speed_on_air(self, car_id: CarId, speed_m_s: float | None, now: float) -> None:
        """Take the speed in a BSM or reply of this vehicle."""
        if car_id == self._identified and speed_m_s is not None:
            self._lead_speed_m_s, self._lead_speed_until = speed_m_s, now + SPEED_VALID_S

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
        self._is_close = self._is_within(
            self._parameters.leave_headway_s, now, self._parameters.leave_at_least_m
        )
        if lead is not None and lead.car_id is not None:
            if lead.car_id != self._identified:
                self._lead_speed_until = float("-inf")
            self._identified = lead.car_id
            self._approached_m = 0.0 if lead.gap_m < NEAR_M else float("inf")
        is_near = self._is_near_unidentified(now)
        if lead is None and not (is_unknown or is_near):
            self._identified = None
        if self._identified is not None and (is_near or self.shows_close(self._identified)):
            self._close_at[self._identified] = now
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

    def _is_near_unidentified(self, now: float) -> bool:
        """Whether the identified vehicle is taken to be near, although the frame does not name it.

        Of a plate nearer than some 3 m the camera sees nothing, and at rest nobody is asked.
        """
        speed = self.speed_at(now)
        if speed is None or speed >= CRAWL_M_S or abs(self._approached_m) >= NEAR_M:
            return False
        return self._lead is None or (self._lead.car_id is None and self._is_close)

    def _is_within(self, headway_s: float, now: float, at_least_m: float = 0.0) -> bool:
        """Compare the gap with the safety distance, headway times own speed (LCCA, section 3)."""
        speed, lead = self.speed_at(now), self._lead
        if lead is None or speed is None:
            return False
        return lead.gap_m < max(headway_s * speed, at_least_m)
