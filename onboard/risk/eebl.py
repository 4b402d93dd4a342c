"""EEBL: emergency electronic brake lights (SAE J2945/1).

A remote vehicle ahead on the host vehicle's path sets the hard braking flag in its BSM. The level
is that of the braking which the host then needs.
"""

import math
from functools import partial
from operator import itemgetter

from typing_extensions import override

from onboard.risk.alarm import AlarmReason, Assessment, Cause, Level, object_reason
from onboard.risk.application import Application, Assessed
from onboard.risk.driver_reaction import for_driver
from onboard.risk.fcw import MAX_REPORTED_DECELERATION_M_S2
from onboard.risk.required_deceleration import required_deceleration_m_s2
from onboard.risk.settings import FcwSettings, RiskSettings
from onboard.risk.situation import Situation
from onboard.tracking.perceived_object import PerceivedObject

EEBL = Cause("eebl")
FLAG_HOLD_S = 1.0
"""Time for which a flag is valid: ten BSMs."""
ASSUMED_DECELERATION_M_S2 = 4.0
"""Deceleration that the flag stands for, more than 0.4 g (SAE J2735), if the BSM reports less."""


class EmergencyElectronicBrakeLights(Application):
    """Assesses all remote vehicles that brake hard ahead."""

    cause = EEBL

    def __init__(self, settings: RiskSettings) -> None:
        """Start; reaction time and required deceleration of a warning are those of FCW."""
        self._settings = settings

    @override
    def assess(self, situation: Situation) -> Assessed:
        """Assess each vehicle whose flag is set, by the braking that it asks for."""
        own = situation.own
        if own is None or math.hypot(*own.state[2:]) < self._settings.least_speed_m_s:
            return ()
        settings = for_driver(self._settings.fcw, situation.reaction_s)
        assessed = [
            found
            for each in situation.others
            if (found := _assess(own, each, situation, settings)) is not None
        ]
        assessed.sort(key=itemgetter(0), reverse=True)  # also above what is reported
        return [assessment for _, assessment in assessed]


def _assess(
    own: PerceivedObject, car: PerceivedObject, situation: Situation, settings: FcwSettings
) -> tuple[float, Assessment] | None:
    """Return the required deceleration in m/s^2 and the assessment; `None` without danger."""
    data = situation.bsm_data
    flags = data.get(car.name)
    if flags is None or situation.now - flags.braked_hard_s > FLAG_HOLD_S:
        return None
    place = situation.path.place(own, car, partial(data.path_history_m, car.name))
    if place is None or data.is_on_another_deck(car, place.ahead_m):
        return None
    length_m, _ = data.size_m(car.name)
    gap_m = max(place.ahead_m - (situation.own_size_m[0] + length_m) / 2.0, 0.0)
    braking_m_s2 = max(ASSUMED_DECELERATION_M_S2, -(car.acceleration_m_s2 or 0.0))
    needed_m_s2 = required_deceleration_m_s2(
        gap_m,
        math.hypot(*own.state[2:]),
        math.hypot(*car.state[2:]),
        braking_m_s2,
        settings.reaction_s,
    )
    is_urgent = needed_m_s2 >= settings.warning_m_s2
    flag = AlarmReason("bsm", car.name, situation.now - flags.braked_hard_s)
    return needed_m_s2, Assessment(
        Level.WARNING if is_urgent else Level.CAUTION,
        min(needed_m_s2, MAX_REPORTED_DECELERATION_M_S2),
        (flag, object_reason(car, own)),
    )
