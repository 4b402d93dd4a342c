"""FCW: forward collision warning, by time to collision and required deceleration."""

import math
from typing import ClassVar

from typing_extensions import override

from onboard.observations import Lead, Speed
from onboard.risk.alarm import AlarmReason, Assessment, Cause, Level
from onboard.risk.application import Application, Assessed
from onboard.risk.confirmation import Confirmation
from onboard.risk.driver_reaction import for_driver
from onboard.risk.required_deceleration import (
    brakes_enough,
    required_deceleration_m_s2,
    time_to_collision_s,
)
from onboard.risk.settings import FcwSettings, RiskSettings
from onboard.risk.situation import Situation
from onboard.risk.vehicle_motion import SETTLED_SIGMA_M_S
from onboard.risk.vehicles_ahead import (
    CameraLead,
    ObjectsAhead,
    VehicleAhead,
)
from onboard.trace.trace_line import Event

FCW = Cause("fcw")
CONFIRM_S = 0.04
"""Time over which measurements of a vehicle must show a level, unless filtered: one outlier
raises no alarm."""
JAM_M_S, ROUTINE_M_S2 = 8.0, 2.5
"""In a jam, slower than this, drivers brake so hard time and again: a time to collision that asks
for less is no danger."""
PEDAL_M_S2 = 1.25
"""Deceleration of a driver who brakes: a car in gear slows down by itself with 1 m/s^2 at most."""
YELLOW_LIGHT_M_S2 = 3.0
"""With which drivers stop for a yellow light, rounded down (ITE's yellow change interval assumes
10 ft/s^2). Who brakes already is expected to brake so hard without a warning."""
MAX_REPORTED_DECELERATION_M_S2 = 20.0
"""Alarms report no larger required deceleration: no braking is as hard."""


class ForwardCollisionWarning(Application):
    """Assesses the camera's lead vehicle, and every perceived object ahead on the own path.

    Without the host vehicle's speed, nothing is assessed.
    """

    cause = FCW
    takes: ClassVar = (Lead,)

    def __init__(self, settings: RiskSettings) -> None:
        """Start without vehicles."""
        self._settings = settings
        self._camera = CameraLead()
        self._objects = ObjectsAhead()
        self._confirmations: dict[str, Confirmation] = {}

    @override
    def assess(self, situation: Situation) -> Assessed:
        """Assess each vehicle ahead."""
        self._objects.receive_situation(situation)
        return self._assess_all(situation)

    @override
    def receive_event(self, event: Event, situation: Situation) -> Assessed:
        """Take an observation of the lead vehicle, or that there is none."""
        assert isinstance(event, Lead)  # noqa: S101 (it takes no other)
        self._camera.receive_lead(event, situation.speed)
        return self._assess_all(situation)

    def _assess_all(self, situation: Situation) -> list[Assessment]:
        speed = situation.speed
        if speed is None:
            self._confirmations.clear()
            return []
        if speed.speed_m_s < self._settings.least_speed_m_s:
            return []
        vehicles = self._objects.with_lead(self._camera.vehicle(situation.now))
        self._confirmations = {
            vehicle.key: self._confirmations.get(vehicle.key)
            or Confirmation(0.0 if vehicle.is_filtered else CONFIRM_S)
            for vehicle in vehicles
        }
        if not vehicles:
            return []
        settings = for_driver(self._settings.fcw, situation.reaction_s)
        braking_m_s2 = situation.host.braking_m_s2(situation.now)
        return [
            self._assess(vehicle, speed, braking_m_s2, settings, situation.now)
            for vehicle in vehicles
        ]

    def _assess(
        self,
        vehicle: VehicleAhead,
        speed: Speed,
        braking_m_s2: float | None,
        settings: FcwSettings,
        now: float,
    ) -> Assessment:
        closing_m_s = settled_closing_speed_m_s(
            vehicle.closing_speed_m_s, vehicle.closing_speed_sigma_m_s
        )
        level, needed_m_s2 = fcw_level(
            vehicle.gap_m,
            speed.speed_m_s,
            closing_m_s,
            vehicle.deceleration_m_s2,
            braking_m_s2,
            settings=settings,
            sigmas=vehicle.place_sigmas,
        )
        host = AlarmReason(speed.kind, speed.source, now - speed.stamp_s)
        confirmed = self._confirmations[vehicle.key].receive_level(level, vehicle.stamp_s)
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

    TTC and required deceleration decide, the more urgent counts; in a jam a TTC counts
    only if more than routine braking is required. A driver who already brakes enough, or so
    that the time to react is left, gets a caution at most (docs/design/risk.md).

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
    is_routine = speed_m_s < JAM_M_S and needed_m_s2 < ROUTINE_M_S2
    ttc_s = math.inf if is_routine else time_to_collision_s(gap_m, closing_speed_m_s)
    level = Level.NONE
    if _are_urgent(needed_m_s2, ttc_s, settings):
        level = Level.WARNING
    elif needed_m_s2 >= settings.caution_m_s2 or ttc_s <= settings.caution_ttc_s:
        level = Level.CAUTION
    farther_m, faster_m_s = gap_m + sigmas[0], lead[0] + sigmas[1]
    if level is Level.WARNING and (
        brakes_enough(farther_m, speed_m_s, faster_m_s, lead[1], braking_m_s2)
        or _leaves_time(gap_m, speed_m_s, lead, braking_m_s2, settings)
    ):
        level = Level.CAUTION
    return level, needed_m_s2


def _are_urgent(needed_m_s2: float, ttc_s: float, settings: FcwSettings) -> bool:
    """Whether required deceleration or TTC asks for a warning."""
    return needed_m_s2 >= settings.warning_m_s2 or ttc_s <= settings.warning_ttc_s


def _leaves_time(
    gap_m: float,
    speed_m_s: float,
    lead: tuple[float, float],
    braking_m_s2: float | None,
    settings: FcwSettings,
) -> bool:
    """Whether the driver brakes, needs no hard braking, and has time to react by what he brakes.

    `lead` is its speed in m/s, and its deceleration in m/s^2.
    """
    if braking_m_s2 is None or not braking_m_s2 >= PEDAL_M_S2:  # NaN is unknown
        return False
    if not brakes_enough(gap_m, speed_m_s, *lead, YELLOW_LIGHT_M_S2):
        return False
    needed_m_s2 = required_deceleration_m_s2(
        gap_m, speed_m_s, *lead, settings.reaction_s, braking_m_s2=braking_m_s2
    )
    ttc_s = time_to_collision_s(gap_m, speed_m_s - lead[0], braking_m_s2)
    return not _are_urgent(needed_m_s2, ttc_s, settings)
