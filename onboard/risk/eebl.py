"""EEBL: emergency electronic brake lights (SAE J2945/1).

A remote vehicle ahead on the host vehicle's path sets the hard braking flag in its BSM. The level
is that of the braking which the host then needs.
"""

import math
from collections.abc import Sequence
from functools import partial
from operator import itemgetter

from onboard.risk.alarm import AlarmReason, Assessment, Level, object_reason
from onboard.risk.bsm_data import BsmDataStore
from onboard.risk.fcw import MAX_REPORTED_DECELERATION_M_S2
from onboard.risk.path_ahead import PathAhead
from onboard.risk.required_deceleration import required_deceleration_m_s2
from onboard.risk.settings import FcwSettings
from onboard.tracking.perceived_object import PerceivedObject

FLAG_HOLD_S = 1.0
"""Time for which a flag is valid: ten BSMs."""
ASSUMED_DECELERATION_M_S2 = 4.0
"""Deceleration that the flag stands for, more than 0.4 g (SAE J2735), if the BSM reports less."""


def assess_eebl(
    own: PerceivedObject,
    others: Sequence[PerceivedObject],
    data: BsmDataStore,
    path: PathAhead,
    now: float,
    *,
    own_length_m: float,
    settings: FcwSettings,
) -> list[Assessment]:
    """Evaluate all remote vehicles that brake hard ahead, the most urgent first.

    Args:
        own: the host vehicle.
        others: the perceived objects.
        data: of their BSMs.
        path: the host vehicle's.
        now: the time.
        own_length_m: length of the host vehicle.
        settings: reaction time, and required deceleration of a warning.
    """
    assessed: list[tuple[float, Assessment]] = []
    for car in others:
        flags = data.get(car.name)
        if flags is None or now - flags.braked_hard_s > FLAG_HOLD_S:
            continue
        place = path.place(own, car, partial(data.path_history_m, car.name))
        if place is None or data.is_on_another_level(car, place.ahead_m):
            continue
        length_m, _ = data.size_m(car.name)
        gap_m = max(place.ahead_m - (own_length_m + length_m) / 2.0, 0.0)
        braking_m_s2 = max(ASSUMED_DECELERATION_M_S2, -(car.acceleration_m_s2 or 0.0))
        needed_m_s2 = required_deceleration_m_s2(
            gap_m,
            math.hypot(*own.state[2:]),
            math.hypot(*car.state[2:]),
            braking_m_s2,
            settings.reaction_s,
        )
        is_urgent = needed_m_s2 >= settings.warning_m_s2
        flag = AlarmReason("bsm", car.name, now - flags.braked_hard_s)
        assessment = Assessment(
            Level.WARNING if is_urgent else Level.CAUTION,
            min(needed_m_s2, MAX_REPORTED_DECELERATION_M_S2),
            (flag, object_reason(car, own)),
        )
        assessed.append((needed_m_s2, assessment))
    assessed.sort(key=itemgetter(0), reverse=True)
    return [assessment for _, assessment in assessed]
