"""EEBL: emergency electronic brake lights (SAE J2945/1).

A remote vehicle ahead on the host vehicle's path sets the hard braking flag in its BSM. The level
is that of the braking which the host then needs.
"""

import math
from collections.abc import Sequence

from onboard.mvs.perceived_object import PerceivedObject
from onboard.risk.alarm import NOTHING, AlarmReason, Assessment, Level, object_reason
from onboard.risk.bsm_data import DEFAULT_LENGTH_M, BsmDataStore
from onboard.risk.fcw import MAX_REPORTED_DECELERATION_M_S2, required_deceleration_m_s2
from onboard.risk.settings import FcwSettings

RANGE_M = 150.0
"""Farther ahead a braking vehicle asks for no reaction: 27 m/s stop in 100 m with 4 m/s^2."""
MAX_LATERAL_M = 2.0
"""Farther to the side a vehicle is in another lane."""
MAX_HEADING_DIFFERENCE_RAD = 0.5
"""A vehicle with another heading is on another road."""
FLAG_HOLD_S = 1.0
"""Time for which a flag is valid: ten BSMs."""
ASSUMED_DECELERATION_M_S2 = 4.0
"""Deceleration that the flag stands for, more than 0.4 g (SAE J2735), if the BSM reports less."""

_MIN_HEADING_SPEED_M_S = 1.0
"""A slower vehicle has no heading that could be compared."""


def assess_eebl(
    own: PerceivedObject,
    others: Sequence[PerceivedObject],
    data: BsmDataStore,
    now: float,
    *,
    own_length_m: float,
    settings: FcwSettings,
) -> Assessment:
    """Evaluate all remote vehicles; the one that asks for the hardest braking counts.

    Args:
        own: the host vehicle.
        others: the perceived objects.
        data: of their BSMs.
        now: the time.
        own_length_m: length of the host vehicle.
        settings: reaction time, and required deceleration of a warning.
    """
    worst = NOTHING
    for car in others:
        flags = data.get(car.name)
        if flags is None or now - flags.braked_hard_s > FLAG_HOLD_S:
            continue
        length_m = flags.length_m or DEFAULT_LENGTH_M
        gap_m = _gap_on_path_m(own, car, (own_length_m + length_m) / 2.0)
        if gap_m is None or data.is_on_another_level(car.name, gap_m):
            continue
        braking_m_s2 = max(ASSUMED_DECELERATION_M_S2, -(car.acceleration_m_s2 or 0.0))
        needed_m_s2 = required_deceleration_m_s2(
            gap_m,
            math.hypot(*own.state[2:]),
            math.hypot(*car.state[2:]),
            braking_m_s2,
            settings.reaction_s,
        )
        if worst is NOTHING or needed_m_s2 > worst.value:
            is_urgent = needed_m_s2 >= settings.warning_m_s2
            flag = AlarmReason("bsm", car.name, now - flags.braked_hard_s)
            worst = Assessment(
                Level.WARNING if is_urgent else Level.CAUTION,
                min(needed_m_s2, MAX_REPORTED_DECELERATION_M_S2),
                (flag, object_reason(car, own)),
            )
    return worst


def _gap_on_path_m(
    own: PerceivedObject, car: PerceivedObject, half_lengths_m: float
) -> float | None:
    """Gap to a vehicle ahead in the host's lane with the same heading; `None` for others."""
    heading = math.atan2(own.state[3], own.state[2])
    east_m, north_m = car.state[0] - own.state[0], car.state[1] - own.state[1]
    ahead_m = east_m * math.cos(heading) + north_m * math.sin(heading)
    lateral_m = north_m * math.cos(heading) - east_m * math.sin(heading)
    if not 0.0 < ahead_m <= RANGE_M or abs(lateral_m) > MAX_LATERAL_M:
        return None
    if math.hypot(*car.state[2:]) >= _MIN_HEADING_SPEED_M_S:
        difference = math.atan2(car.state[3], car.state[2]) - heading
        if math.cos(difference) < math.cos(MAX_HEADING_DIFFERENCE_RAD):
            return None
    return max(ahead_m - half_lengths_m, 0.0)
