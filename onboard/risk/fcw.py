"""FCW: forward collision warning, by time to collision and required deceleration."""

import math

from onboard.kinematics.acceleration import AccelerationEstimator, is_jump
from onboard.observations import NEW_LEAD_M, BrakePedal, Lead, Speed
from onboard.risk.alarm import NOTHING, AlarmReason, Assessment, Level
from onboard.risk.host_braking import HostBraking
from onboard.risk.settings import FcwSettings

LEAD_WINDOW_S = 0.6
"""Window over which decelerations are estimated: ten images a second give six speeds."""
LEAD_DEADBAND_M_S2 = 1.5
"""Estimated decelerations of the lead below this may be noise, and count as none."""
SETTLED_SIGMA_M_S = 1.5
"""Largest sigma of the closing speed of a lead that has been in view for a while."""
CONFIRM_S = 0.04
"""Time for which a level must last: one outlying image raises no alarm."""
LEAD_TIMEOUT_S = 0.5
"""Time for which an observation of the lead is valid."""
MAX_REPORTED_DECELERATION_M_S2 = 20.0
"""Alarms report no larger required deceleration: no braking is as hard."""


class ForwardCollisionWarning:
    """Assesses the lead vehicle that the camera observes."""

    def __init__(self, settings: FcwSettings) -> None:
        self._settings = settings
        self._braking = HostBraking(LEAD_WINDOW_S)
        self._lead: Lead | None = None
        self._motion = LeadMotion()

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
        self._lead = lead
        if speed is not None and lead.gap_m is not None and lead.closing_speed_m_s is not None:
            if (lead.closing_speed_sigma_m_s or 0.0) > SETTLED_SIGMA_M_S:
                self._motion.clear()  # a speed that settles looks like braking
            lead_speed_m_s = speed.speed_m_s - lead.closing_speed_m_s
            self._motion.receive(lead.stamp_s, lead.gap_m, lead_speed_m_s)

    def assess(self, speed: Speed | None, now: float) -> Assessment:
        """Assess the lead vehicle at the host vehicle's speed, `None` if it is not known."""
        lead = self._lead
        if (
            lead is None
            or speed is None
            or lead.gap_m is None
            or lead.closing_speed_m_s is None
            or abs(now - lead.stamp_s) > LEAD_TIMEOUT_S
        ):
            return NOTHING
        closing_m_s = settled_closing_speed_m_s(
            lead.closing_speed_m_s, lead.closing_speed_sigma_m_s
        )
        level, needed_m_s2 = fcw_level(
            lead.gap_m,
            speed.speed_m_s,
            closing_m_s,
            self._motion.deceleration_m_s2,
            self._braking.at_least_m_s2(now),
            settings=self._settings,
        )
        return Assessment(
            level,
            min(needed_m_s2, MAX_REPORTED_DECELERATION_M_S2),
            (
                AlarmReason(lead.kind, lead.identity.value, now - lead.stamp_s),
                AlarmReason(speed.kind, speed.source, now - speed.stamp_s),
            ),
        )


class LeadMotion:
    """Deceleration of the lead vehicle: the slope of its speed over a short window."""

    def __init__(self) -> None:
        self._trend = AccelerationEstimator(LEAD_WINDOW_S)
        self._last: tuple[float, float, float] | None = None

    def receive(self, stamp_s: float, gap_m: float, lead_speed_m_s: float) -> None:
        """Take an observation; a jump of gap or speed is another lead, and starts anew.

        Args:
            stamp_s: time of the observation.
            gap_m: to the lead vehicle.
            lead_speed_m_s: of the lead vehicle.
        """
        before_s, gap_before_m, speed_before_m_s = self._last or (stamp_s, gap_m, lead_speed_m_s)
        is_other_speed = is_jump(
            lead_speed_m_s - speed_before_m_s, abs(stamp_s - before_s), SETTLED_SIGMA_M_S
        )
        if is_other_speed or abs(gap_m - gap_before_m) > NEW_LEAD_M:
            self._trend.clear()
        self._last = stamp_s, gap_m, lead_speed_m_s
        self._trend.receive(stamp_s, lead_speed_m_s)

    def clear(self) -> None:
        """Start anew: the speed is unknown."""
        self._trend.clear()

    @property
    def deceleration_m_s2(self) -> float:
        """Deceleration; 0 while it is not clear that the lead brakes."""
        slope = self._trend.acceleration_m_s2
        return 0.0 if slope is None or -slope < LEAD_DEADBAND_M_S2 else -slope


def settled_closing_speed_m_s(closing_speed_m_s: float, sigma_m_s: float | None) -> float:
    """Return the closing speed that alarms use.

    The speed of a vehicle that has just come into view can be wrong by metres a second. Above
    `SETTLED_SIGMA_M_S`, alarms use the closing speed minus twice the excess. Without a sigma the
    speed is exact.
    """
    excess_m_s = max((sigma_m_s or 0.0) - SETTLED_SIGMA_M_S, 0.0)
    return closing_speed_m_s - 2.0 * excess_m_s


def time_to_collision_s(gap_m: float, closing_speed_m_s: float) -> float:
    """Return the TTC at present speeds; infinite if the gap does not shrink."""
    return max(gap_m, 0.0) / closing_speed_m_s if closing_speed_m_s > 0.0 else math.inf


def required_deceleration_m_s2(
    gap_m: float,
    speed_m_s: float,
    lead_speed_m_s: float,
    lead_deceleration_m_s2: float,
    reaction_s: float,
) -> float:
    """Return the constant deceleration, from `reaction_s` on, that just avoids the lead vehicle.

    The lead vehicle keeps its deceleration until it stands.

    Args:
        gap_m: to the lead vehicle.
        speed_m_s: of the host vehicle.
        lead_speed_m_s: of the lead vehicle.
        lead_deceleration_m_s2: of the lead vehicle, 0 or more.
        reaction_s: time until the host vehicle brakes.

    Returns:
        the deceleration; 0 if none is needed, infinite if none is enough.
    """
    lead_speed_m_s = max(lead_speed_m_s, 0.0)
    if lead_deceleration_m_s2 > 0.0:
        lead_stops_s = lead_speed_m_s / lead_deceleration_m_s2
        lead_stops_m = lead_speed_m_s * lead_stops_s / 2.0
    else:
        lead_stops_s = lead_stops_m = math.inf if lead_speed_m_s > 0.0 else 0.0
    moving_s = min(reaction_s, lead_stops_s)
    lead_m = lead_speed_m_s * moving_s - lead_deceleration_m_s2 * moving_s**2 / 2.0
    gap_then_m = gap_m + lead_m - speed_m_s * reaction_s
    if gap_then_m <= 0.0:
        return math.inf
    lead_then_m_s = max(lead_speed_m_s - lead_deceleration_m_s2 * reaction_s, 0.0)
    closing_m_s = speed_m_s - lead_then_m_s
    braking = lead_deceleration_m_s2 if lead_then_m_s > 0.0 else 0.0
    if closing_m_s > 0.0:
        while_both_move = braking + closing_m_s**2 / (2.0 * gap_then_m)
        if while_both_move * (lead_stops_s - reaction_s) >= speed_m_s:
            return while_both_move
    return speed_m_s**2 / (2.0 * (gap_m + lead_stops_m - speed_m_s * reaction_s))


def brakes_enough(
    gap_m: float,
    speed_m_s: float,
    lead_speed_m_s: float,
    lead_deceleration_m_s2: float,
    braking_m_s2: float | None,
) -> bool:
    """Whether the host vehicle's present deceleration, held, avoids the lead vehicle.

    Args:
        gap_m: to the lead vehicle.
        speed_m_s: of the host vehicle.
        lead_speed_m_s: of the lead vehicle.
        lead_deceleration_m_s2: of the lead vehicle.
        braking_m_s2: of the host vehicle; `None` and NaN are unknown, and not enough.
    """
    return braking_m_s2 is not None and braking_m_s2 >= required_deceleration_m_s2(
        gap_m, speed_m_s, lead_speed_m_s, lead_deceleration_m_s2, reaction_s=0.0
    )


def fcw_level(
    gap_m: float,
    speed_m_s: float,
    closing_speed_m_s: float,
    lead_deceleration_m_s2: float,
    braking_m_s2: float | None,
    *,
    settings: FcwSettings,
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
    """
    lead = speed_m_s - closing_speed_m_s, lead_deceleration_m_s2
    needed_m_s2 = required_deceleration_m_s2(gap_m, speed_m_s, *lead, settings.reaction_s)
    ttc_s = time_to_collision_s(gap_m, closing_speed_m_s)
    level = Level.NONE
    if needed_m_s2 >= settings.warning_m_s2 or ttc_s <= settings.warning_ttc_s:
        level = Level.WARNING
    elif needed_m_s2 >= settings.caution_m_s2 or ttc_s <= settings.caution_ttc_s:
        level = Level.CAUTION
    if level is Level.WARNING and brakes_enough(gap_m, speed_m_s, *lead, braking_m_s2):
        level = Level.CAUTION
    return level, needed_m_s2
