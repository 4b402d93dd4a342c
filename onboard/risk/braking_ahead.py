"""Hard braking ahead: a vehicle farther ahead in the lane than the lead brakes hard.

Vehicles without a radio may drive in between, so nobody of the warning group passes this on. A
vehicle on the air sets the hard braking flag in its BSM; whether it is ahead in the own lane
follows by Bayes' rule from its motion until then (`stream_motion`) and, if both have one, its
place on the path. What is not certain enough for a warning is shown as a caution, and never
brakes. Who is near enough, and placed well enough, for EEBL is left to that.
"""

import math
from functools import partial

from typing_extensions import override

from onboard.risk.alarm import AlarmReason, Assessment, Cause, Level
from onboard.risk.application import Application, Assessed
from onboard.risk.bsm_data import BsmData
from onboard.risk.eebl import ASSUMED_DECELERATION_M_S2, FLAG_HOLD_S
from onboard.risk.settings import RiskSettings
from onboard.risk.situation import Situation
from onboard.risk.stream_motion import StreamMotion
from onboard.tracking.perceived_object import PerceivedObject

BRAKING_AHEAD = Cause("braking_ahead")
AHEAD = 0.5
"""Probability of being ahead in the own lane from which a driver is cautioned."""
IN_STREAM = 0.12
"""The same of a vehicle on the air of which nothing else is known: on a dense road with three lanes
each way, one of twelve is; a few more where some of these drive elsewhere."""
OWN_LANE = 1.0 / 3.0
"""Of one whose position is ahead, in one of three lanes."""
FARTHEST_M = 300.0
"""Farther ahead a braking is no reason for a caution yet: 10 s at 30 m/s."""
LANE_M, IN_LANE_M = 3.5, 0.4
"""Width of a lane; sigma of the difference of two vehicles' places in one."""
ANYWHERE_1_M = 0.01
"""Density of all other places, such as beside the road, and of gross errors of positions."""
FRESH_S = 1.0
"""Age from which the speed in a BSM is none."""


class BrakingAhead(Application):
    """Judges each hard braking once, when it begins."""

    cause = BRAKING_AHEAD

    def __init__(self, settings: RiskSettings) -> None:
        """Start without speeds."""
        self._least_speed_m_s = settings.least_speed_m_s
        self._stream = StreamMotion()
        self._ahead: dict[str, bool] = {}
        """Of the vehicles that brake hard, whether they are ahead in the own lane."""

    @override
    def assess(self, situation: Situation) -> Assessed:
        """Assess each vehicle whose flag is set."""
        now, speed_m_s = situation.now, _own_m_s(situation)
        flagged = {
            name: data
            for name, data in situation.bsm_data.items()
            if now - data.braked_hard_s <= FLAG_HOLD_S
        }
        is_slow = speed_m_s is None or speed_m_s < self._least_speed_m_s
        self._ahead = {
            name: self._ahead[name]
            if name in self._ahead
            else not is_slow and self._is_ahead(name, situation)
            for name in flagged
        }
        self._stream.receive_speeds(speed_m_s, _speeds_m_s(situation), now)
        return [_assess(name, data, now) for name, data in flagged.items() if self._ahead[name]]

    def _is_ahead(self, name: str, situation: Situation) -> bool:
        odds = place_odds(name, situation) * math.exp(self._stream.log_ratio(name))
        return odds >= AHEAD / (1.0 - AHEAD)


def place_odds(name: str, situation: Situation) -> float:
    """Return the odds of a vehicle being ahead in the own lane, and not EEBL's, by its place."""
    own, data = situation.own, situation.bsm_data
    received = data.get(name)
    has_place = received is not None and received.last.core.latitude_deg is not None
    if own is None or not has_place:
        return IN_STREAM / (1.0 - IN_STREAM)
    other = next((each for each in situation.others if each.name == name), None)
    if other is None:
        return 0.0
    history_m = partial(data.path_history_m, name)
    place = situation.path.place_in_any_lane(own, other, history_m, FARTHEST_M)
    if place is None or data.is_on_another_deck(other, place.ahead_m):
        return 0.0
    if situation.path.place(own, other, history_m) is not None:
        return 0.0  # one braking, one alarm: EEBL's
    sigma_m = math.hypot(place.left_sigma_m, _sigma_m(own), _sigma_m(other), IN_LANE_M)
    in_lane, left, right = (
        _density_1_m(place.left_m - lane_m, sigma_m) for lane_m in (0.0, LANE_M, -LANE_M)
    )
    return OWN_LANE * in_lane / ((1.0 - OWN_LANE) * (0.5 * (left + right) + ANYWHERE_1_M))


def _assess(name: str, data: BsmData, now: float) -> Assessment:
    braking_m_s2 = -(data.last.core.acceleration.longitudinal_m_s2 or 0.0)
    return Assessment(
        Level.CAUTION,
        max(ASSUMED_DECELERATION_M_S2, braking_m_s2),
        (AlarmReason("bsm", name, now - data.braked_hard_s),),
    )


def _own_m_s(situation: Situation) -> float | None:
    """Return the host vehicle's speed on its bus, or else by its fixes."""
    if situation.speed is not None:
        return situation.speed.speed_m_s
    return None if situation.own is None else math.hypot(*situation.own.state[2:])


def _speeds_m_s(situation: Situation) -> dict[str, float]:
    return {
        name: data.last.core.speed_m_s
        for name, data in situation.bsm_data.items()
        if data.last.core.speed_m_s is not None and situation.now - data.received_s < FRESH_S
    }


def _sigma_m(of: PerceivedObject) -> float:
    """Sigma of a position on either axis."""
    return math.sqrt((of.covariance[0][0] + of.covariance[1][1]) / 2.0)


def _density_1_m(off_m: float, sigma_m: float) -> float:
    return math.exp(-0.5 * (off_m / sigma_m) ** 2) / (math.sqrt(2.0 * math.pi) * sigma_m)
