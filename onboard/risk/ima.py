"""IMA and LTA: intersection movement and left turn assist, by P_C of crossing paths.

The same assessment is an alarm of LTA while the host vehicle turns left, and of IMA otherwise.
"""

import math
from typing import ClassVar

import numpy as np
from typing_extensions import override

from onboard.observations import Discarded
from onboard.risk.alarm import Assessment, Cause, Level, object_reason
from onboard.risk.application import Application, Assessed
from onboard.risk.bsm_data import BsmDataStore
from onboard.risk.driver_reaction import for_driver
from onboard.risk.left_turn import (
    begun_turn_radius_m,
    has_known_turn,
    left_turn_crossing,
    left_turn_radius_m,
)
from onboard.risk.mean_collision_probability import (
    BRAKING_M_S2,
    MAX_ACCELERATION_M_S2,
    DrivenVehicle,
    mean_collision_probabilities,
)
from onboard.risk.path_crossing import CovarianceError, PathCrossing, path_crossing
from onboard.risk.settings import RiskSettings
from onboard.risk.signal_intent import Intent, signal_intent
from onboard.risk.situation import Situation
from onboard.risk.slow_vehicle import with_heading
from onboard.tracking.perceived_object import ObjectSource, PerceivedObject

IMA, LTA = Cause("ima"), Cause("lta")
MAX_AGE_S = 1.0
"""Older data raise no alarm."""
KNOWN_FOR_S = 0.6
"""Longest interval of BSMs (SAE J2945/1). By older data another driver may have begun to brake, and
is not taken to drive on."""
HORIZON_S = 4.0
"""A vehicle that cannot be at the crossing by then, even if it accelerates, raises none yet."""
LARGEST_CROSSING_M = 20.0
"""From a stop line to the place that both cross. Behind a line that is farther away a driver may
stop at another one, whatever a message says of this one."""
_Found = tuple[PerceivedObject, PathCrossing, DrivenVehicle]


class _CrossingPaths(Application):
    """Assesses all perceived objects whose path crosses the host vehicle's."""

    host_turns_left: ClassVar[bool]

    def __init__(self, settings: RiskSettings) -> None:
        """Start; the reaction time is that of FCW."""
        self._settings = settings

    @override
    def assess(self, situation: Situation) -> Assessed:
        """Assess those that may be met; vehicles with an invalid covariance are discarded.

        Who is expected to stop at a red signal, crosses nobody's path.
        """
        if situation.own is None:
            return []
        own = with_heading(situation.own, situation.heading)
        signals = situation.host.turn_signals(situation.now) == {"left"}  # both: hazard signal
        yaw_rate = situation.host.yaw_rate(situation.now)
        radius_m = begun_turn_radius_m(math.hypot(*own.state[2:]), yaw_rate, signals=signals)
        if radius_m is None:
            radius_m = _left_turn_radius_m(own, situation, signals=signals)
        if (radius_m is not None) is not self.host_turns_left:
            return []
        reaction_s = for_driver(self._settings.fcw, situation.reaction_s).reaction_s
        known_m_s2 = situation.host.acceleration_m_s2(situation.now)
        along_m_s2 = _along_m_s2(own, known_m_s2, situation)
        intent = signal_intent(
            situation.own,
            situation.own_size_m[0],
            situation.signals,
            along_m_s2,
            braking_m_s2=BRAKING_M_S2,
        )
        if intent is Intent.STOPS:
            return []
        found, discarded = _find(own, radius_m, situation)
        if not found:
            return discarded
        p_c = mean_collision_probabilities(
            [crossing for _, crossing, _ in found],
            [driven for *_, driven in found],
            _driven(
                own,
                situation.own_size_m,
                along_m_s2,
                situation,
                turns=radius_m is not None,
                intent=intent,
            ),
            reaction_s=reaction_s,
        )
        assessed = (
            self._assessment(each, float(p), own) for (each, *_), p in zip(found, p_c, strict=True)
        )
        return [*discarded, *assessed]

    def _assessment(self, other: PerceivedObject, p_c: float, own: PerceivedObject) -> Assessment:
        level, settings = Level.NONE, self._settings.ima
        if p_c >= settings.caution_p_c:
            level = Level.WARNING if p_c >= settings.warning_p_c else Level.CAUTION
        return Assessment(level, p_c, (object_reason(other, own),), other.name)


class IntersectionMovementAssist(_CrossingPaths):
    """Paths cross, and the host vehicle does not turn left."""

    cause = IMA
    host_turns_left = False


class LeftTurnAssist(_CrossingPaths):
    """The host vehicle turns left across the path of an oncoming vehicle."""

    cause = LTA
    host_turns_left = True


def _find(
    own: PerceivedObject, own_radius_m: float | None, situation: Situation
) -> tuple[list[_Found], list[Discarded]]:
    """Return the vehicles that may be met soon, and those that cannot be used."""
    found: list[_Found] = []
    discarded: list[Discarded] = []
    data = situation.bsm_data
    for other in situation.others:
        if other.age_s > MAX_AGE_S:
            continue
        each = with_heading(other, data.heading(other.name))
        radius_m = _left_turn_radius_m(each, situation, signals=data.signals_left(other.name))
        try:
            crossing = _crossing(own, each, own_radius_m, radius_m)
        except CovarianceError as error:
            detail = f"{each.name}: {error}"
            discarded.append(Discarded(situation.now, "risk", "covariance", detail))
            continue
        if crossing is None or not _is_soon(crossing) or _is_bridge(each, crossing, data):
            continue
        size_m = data.size_m(each.name)
        along_m_s2 = _along_m_s2(each, each.acceleration_m_s2, situation)
        intent = signal_intent(each, size_m[0], situation.signals, along_m_s2)
        if intent is Intent.PASSES_RED and _is_far_behind_its_line(each, crossing, situation):
            intent = None
        if intent is not Intent.STOPS:
            turns = radius_m is not None
            driven = _driven(each, size_m, along_m_s2, situation, turns=turns, intent=intent)
            found.append((each, crossing, driven))
    return found, discarded


def _along_m_s2(
    each: PerceivedObject, known_m_s2: float | None, situation: Situation
) -> float | None:
    """Return the acceleration along the course; a known one comes before the estimate."""
    return situation.motions[each.name].acceleration_m_s2 if known_m_s2 is None else known_m_s2


def _is_far_behind_its_line(
    other: PerceivedObject, crossing: PathCrossing, situation: Situation
) -> bool:
    line_m = situation.signals.red_light_m(other)
    return line_m is not None and float(crossing.mean[2]) - line_m > LARGEST_CROSSING_M


def _left_turn_radius_m(
    each: PerceivedObject, situation: Situation, *, signals: bool
) -> float | None:
    if not has_known_turn(each):  # most of many objects end here
        return None
    lateral_m_s2 = situation.motions[each.name].lateral_m_s2
    return left_turn_radius_m(each, lateral_m_s2, signals=signals)


def _driven(
    each: PerceivedObject,
    size_m: tuple[float, float],
    along_m_s2: float | None,
    situation: Situation,
    *,
    turns: bool,
    intent: Intent | None,
) -> DrivenVehicle:
    """Return size, accelerations and intent."""
    lateral_m_s2 = situation.motions[each.name].lateral_m_s2
    if turns:
        lateral_m_s2 = 0.0  # the distance is along the turn
    if each.age_s > KNOWN_FOR_S and each.source is not ObjectSource.HOST:
        lateral_m_s2 = None
    return DrivenVehicle(
        *size_m,
        along_m_s2,
        lateral_m_s2,
        turns_left=turns,
        passes_red=intent is Intent.PASSES_RED,
        passes_green=intent is Intent.PASSES_GREEN and not turns,
    )


def _crossing(
    own: PerceivedObject,
    other: PerceivedObject,
    own_radius_m: float | None,
    radius_m: float | None,
) -> PathCrossing | None:
    """Return where the paths cross, of which one may turn left; raises `CovarianceError`."""
    if own_radius_m is None and radius_m is None:
        return path_crossing(own, other)
    if own_radius_m is not None:
        return None if radius_m is not None else left_turn_crossing(own, other, own_radius_m)
    assert radius_m is not None  # noqa: S101 (one of both turns)
    crossing = left_turn_crossing(other, own, radius_m)
    return None if crossing is None else crossing.of_other()


def _is_soon(crossing: PathCrossing) -> bool:
    distances_m, speeds_m_s = crossing.mean[[0, 2]], crossing.mean[[1, 3]]
    soon_m = HORIZON_S * (speeds_m_s + MAX_ACCELERATION_M_S2 * HORIZON_S / 2.0)
    return bool(np.all(distances_m <= soon_m))


def _is_bridge(other: PerceivedObject, crossing: PathCrossing, data: BsmDataStore) -> bool:
    distance_m = abs(float(crossing.mean[0])) + abs(float(crossing.mean[2]))
    return data.crosses_on_a_bridge(other, distance_m)
