"""The car ahead: time to collision, how hard the driver will have to brake, and whether he does."""

import math

from onboard.kinematics.acceleration import AccelerationEstimator, is_jump
from onboard.observations import NEW_LEAD_M
from onboard.risk.alarm import Level
from onboard.risk.settings import FcwSettings


class LeadMotion:
    """How the car ahead moves: its braking is the slope of its speed over a short window."""

    def __init__(self, settings: FcwSettings) -> None:
        self._settings = settings
        self._trend = AccelerationEstimator(settings.lead_window_s)
        self._last: tuple[float, float, float] | None = None

    def receive(self, stamp_s: float, gap_m: float, lead_speed_m_s: float) -> None:
        """Take one sight of it. After a jump to another gap or speed, what came before is void."""
        before_s, gap_before_m, speed_before_m_s = self._last or (stamp_s, gap_m, lead_speed_m_s)
        is_other_speed = is_jump(
            lead_speed_m_s - speed_before_m_s,
            abs(stamp_s - before_s),
            self._settings.settled_sigma_m_s,
        )
        if is_other_speed or abs(gap_m - gap_before_m) > NEW_LEAD_M:
            self._trend.clear()
        self._last = stamp_s, gap_m, lead_speed_m_s
        self._trend.receive(stamp_s, lead_speed_m_s)

    def clear(self) -> None:
        """Its speed is not known any more."""
        self._trend.clear()

    @property
    def deceleration_m_s2(self) -> float:
        """0 while it is not clear that it brakes."""
        slope = self._trend.acceleration_m_s2
        return 0.0 if slope is None or -slope < self._settings.lead_deadband_m_s2 else -slope


def settled_closing_speed_m_s(
    closing_speed_m_s: float, sigma_m_s: float | None, settings: FcwSettings
) -> float:
    """The closing speed that may be acted upon while it settles.

    The speed of a car that has just come into view may be off by metres a second. It is taken lower
    by twice what its sigma exceeds that of a settled one by. Without a sigma it is exact.
    """
    excess_m_s = max((sigma_m_s or 0.0) - settings.settled_sigma_m_s, 0.0)
    return closing_speed_m_s - 2.0 * excess_m_s


def time_to_collision_s(gap_m: float, closing_speed_m_s: float) -> float:
    """At present speeds; infinite if the gap does not shrink."""
    return max(gap_m, 0.0) / closing_speed_m_s if closing_speed_m_s > 0.0 else math.inf


def required_deceleration_m_s2(
    gap_m: float,
    speed_m_s: float,
    lead_speed_m_s: float,
    lead_deceleration_m_s2: float,
    reaction_s: float,
) -> float:
    """Constant braking, from `reaction_s` on, that just avoids the car ahead.

    The car ahead keeps braking until it stands. 0 if no braking is needed, infinite if none helps.
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


def level(
    gap_m: float, closing_speed_m_s: float, required_m_s2: float, settings: FcwSettings
) -> Level:
    """How urgent it is, by either measure."""
    ttc_s = time_to_collision_s(gap_m, closing_speed_m_s)
    if required_m_s2 >= settings.warning_m_s2 or ttc_s <= settings.warning_ttc_s:
        return Level.WARNING
    if required_m_s2 >= settings.caution_m_s2 or ttc_s <= settings.caution_ttc_s:
        return Level.CAUTION
    return Level.NONE


def is_answered(
    gap_m: float,
    speed_m_s: float,
    lead_speed_m_s: float,
    lead_deceleration_m_s2: float,
    braking_m_s2: float | None,
) -> bool:
    """Whether the present braking is enough to stay clear of the car ahead.

    `None` or NaN: it is not known, and counts as not enough.
    """
    return braking_m_s2 is not None and braking_m_s2 >= required_deceleration_m_s2(
        gap_m, speed_m_s, lead_speed_m_s, lead_deceleration_m_s2, reaction_s=0.0
    )


def judged(
    gap_m: float,
    speed_m_s: float,
    closing_speed_m_s: float,
    lead_deceleration_m_s2: float,
    braking_m_s2: float | None,
    *,
    settings: FcwSettings,
) -> tuple[Level, float]:
    """How urgent it is, and the braking needed after a reaction in m/s^2.

    A driver who already brakes enough gets no warning, only a caution (docs/design/risk.md).
    """
    lead = speed_m_s - closing_speed_m_s, lead_deceleration_m_s2
    needed_m_s2 = required_deceleration_m_s2(gap_m, speed_m_s, *lead, settings.reaction_s)
    seen = level(gap_m, closing_speed_m_s, needed_m_s2, settings)
    if seen is Level.WARNING and is_answered(gap_m, speed_m_s, *lead, braking_m_s2):
        seen = Level.CAUTION
    return seen, needed_m_s2
