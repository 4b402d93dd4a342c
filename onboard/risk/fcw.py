"""FCW: forward collision warning, by time to collision and required deceleration."""

from collections.abc import Sequence

from onboard.observations import BrakePedal, Lead, Speed
from onboard.risk.alarm import AlarmReason, Assessment, Level
from onboard.risk.bsm_data import BsmDataStore
from onboard.risk.confirmation import Confirmation
from onboard.risk.host_braking import HostBraking
from onboard.risk.path_ahead import PathAhead
from onboard.risk.required_deceleration import (
    brakes_enough,
    required_deceleration_m_s2,
    time_to_collision_s,
)
from onboard.risk.settings import FcwSettings
from onboard.risk.vehicles_ahead import (
    LEAD_WINDOW_S,
    SETTLED_SIGMA_M_S,
    CameraLead,
    ObjectsAhead,
    VehicleAhead,
)
from onboard.tracking.perceived_object import PerceivedObject

CONFIRM_S = 0.04
"""Time over which measurements of a vehicle must show a level, unless filtered: one outlier
raises no alarm."""
MAX_REPORTED_DECELERATION_M_S2 = 20.0
"""Alarms report no larger required deceleration: no braking is as hard."""


class ForwardCollisionWarning:
    """Assesses the camera's lead vehicle, and every perceived object ahead on the own path."""

    def __init__(self, settings: FcwSettings, own_length_m: float) -> None:
        """Start without vehicles.

        Args:
            settings: the thresholds.
            own_length_m: length of the host vehicle.
        """
        self.settings = settings
        self._braking = HostBraking(LEAD_WINDOW_S)
        self._camera = CameraLead()
        self._objects = ObjectsAhead(own_length_m)
        self._confirmations: dict[str, Confirmation] = {}

    def receive_speed(self, speed: Speed) -> None:
        """Take the host vehicle's speed."""
        self._braking.receive_speed(speed)

    def receive_pedal(self, pedal: BrakePedal) -> None:
        """Take the state of the host vehicle's brake pedal."""
        self._braking.receive_pedal(pedal)

    def receive_lead(self, lead: Lead, speed: Speed | None) -> None:
        """Take an observation of the lead vehicle, or that there is none.

        Args:
            lead: the observation.
            speed: the host vehicle's, if it is known.
        """
        self._camera.receive(lead, speed)

    def receive_objects(
        self,
        own: PerceivedObject | None,
        others: Sequence[PerceivedObject],
        data: BsmDataStore,
        path: PathAhead,
        speed: Speed | None,
    ) -> None:
        """Take the perceived objects.

        Args:
            own: the host vehicle; `None` without a position.
            others: the perceived objects.
            data: of their BSMs.
            path: the host vehicle's.
            speed: the host vehicle's, if it is known.
        """
        self._objects.receive(own, others, data, path, speed)

    def assess(self, speed: Speed | None, now: float) -> list[Assessment]:
        """Assess each vehicle ahead, the most urgent first.

        Args:
            speed: of the host vehicle; without it nothing is assessed.
            now: the time.
        """
        if speed is None:
            self._confirmations.clear()
            return []
        vehicles = self._objects.with_lead(self._camera.vehicle(now))
        self._confirmations = {
            vehicle.key: self._confirmations.get(vehicle.key)
            or Confirmation(0.0 if vehicle.is_filtered else CONFIRM_S)
            for vehicle in vehicles
        }
        assessed = [self._assess(vehicle, speed, now) for vehicle in vehicles]
        return sorted(assessed, key=lambda each: (each.level.rank, each.value), reverse=True)

    def _assess(self, vehicle: VehicleAhead, speed: Speed, now: float) -> Assessment:
        closing_m_s = settled_closing_speed_m_s(
            vehicle.closing_speed_m_s, vehicle.closing_speed_sigma_m_s
        )
        level, needed_m_s2 = fcw_level(
            vehicle.gap_m,
            speed.speed_m_s,
            closing_m_s,
            vehicle.deceleration_m_s2,
            self._braking.at_least_m_s2(now),
            settings=self.settings,
            sigmas=vehicle.place_sigmas,
        )
        host = AlarmReason(speed.kind, speed.source, now - speed.stamp_s)
        confirmed = self._confirmations[vehicle.key].receive(level, vehicle.stamp_s)
        return Assessment(
            Level.NONE if vehicle.is_new else confirmed,
            min(needed_m_s2, MAX_REPORTED_DECELERATION_M_S2),
            (*vehicle.reasons(now), host),
        )


def settled_closing_speed_m_s(closing_speed_m_s: float, sigma_m_s: float) -> float:
    """Return the closing speed that alarms use.

    The speed of a vehicle that has just come into view can be wrong by metres a second. Above
    `SETTLED_SIGMA_M_S`, alarms use the closing speed minus twice the excess.
    """
    return closing_speed_m_s - 2.0 * max(sigma_m_s - SETTLED_SIGMA_M_S, 0.0)


def fcw_level(
    gap_m: float,
    speed_m_s: float,
    closing_speed_m_s: float,
    lead_deceleration_m_s2: float,
    braking_m_s2: float | None,
    *,
    settings: FcwSettings,
    sigmas: tuple[float, float] = (0.0, 0.0),
) -> tuple[Level, float]:
    """Return the level, and the required deceleration after a reaction in m/s^2.

    TTC and required deceleration decide, the more urgent counts. A driver who already brakes enough
    gets a caution at most (docs/design/risk.md).

    Args:
        gap_m: to the lead vehicle.
        speed_m_s: of the host vehicle.
        closing_speed_m_s: at which the gap shrinks.
        lead_deceleration_m_s2: of the lead vehicle.
        braking_m_s2: of the host vehicle; `None` if unknown.
        settings: the thresholds.
        sigmas: of gap and closing speed, in m and m/s, within which braking may be enough.
    """
    lead = speed_m_s - closing_speed_m_s, lead_deceleration_m_s2
    needed_m_s2 = required_deceleration_m_s2(gap_m, speed_m_s, *lead, settings.reaction_s)
    ttc_s = time_to_collision_s(gap_m, closing_speed_m_s)
    level = Level.NONE
    if needed_m_s2 >= settings.warning_m_s2 or ttc_s <= settings.warning_ttc_s:
        level = Level.WARNING
    elif needed_m_s2 >= settings.caution_m_s2 or ttc_s <= settings.caution_ttc_s:
        level = Level.CAUTION
    farther_m, faster_m_s = gap_m + sigmas[0], lead[0] + sigmas[1]
    if level is Level.WARNING and brakes_enough(
        farther_m, speed_m_s, faster_m_s, lead[1], braking_m_s2
    ):
        level = Level.CAUTION
    return level, needed_m_s2
