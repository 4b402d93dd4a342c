"""The vehicles in the lane into which the driver is about to change."""

import math
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from statistics import NormalDist

from onboard.observations import Side
from onboard.risk.alarm import Assessment, Level, object_reason
from onboard.risk.situation import Situation
from onboard.tracking.perceived_object import PerceivedObject

LEAST_SPEED_M_S = 8.0
"""Below this host speed a turn signal announces a turn rather than a change of lanes."""
LANE_M = 3.5
"""Width of a lane. The middle of a vehicle in the adjacent one is 0.5 to 1.5 times as far to the
side."""
LIKELY, STILL_LIKELY = 0.5, 0.25
"""Probability from which a vehicle is in the adjacent lane, and down to which it stays there: the
errors of positions come and go in seconds."""
OLDEST_S = 0.6
"""Age of a vehicle's last measurement or BSM above which its place is unknown."""


@dataclass(frozen=True, slots=True)
class AdjacentVehicle:
    """A vehicle in the lane into which the driver is about to change, beside the host or behind."""

    behind_m: float
    """From its front to the rear of the host vehicle; negative while both overlap."""
    closing_speed_m_s: float
    """By which it is faster than the host vehicle."""
    warning: Assessment
    """Of changing over; its value is the probability that the vehicle is in that lane."""


def adjacent_vehicles(
    situation: Situation, warned_of: Collection[str] = ()
) -> Iterator[AdjacentVehicle]:
    """Yield the vehicles beside and behind in the lane to which the host vehicle signals.

    Both turn signals at once are the hazard signal, and announce nothing.

    Args:
        situation: at present.
        warned_of: names of those that were there at the last assessment.
    """
    own, sides = situation.own, situation.host.turn_signals(situation.now)
    if own is None or len(sides) != 1 or math.hypot(*own.state[2:]) < LEAST_SPEED_M_S:
        return
    (side,) = sides
    for other in situation.others:
        if other.age_s <= OLDEST_S:
            found = _adjacent(own, other, side, situation)
            likely = STILL_LIKELY if other.name in warned_of else LIKELY
            if found is not None and found.warning.value >= likely:
                yield found


def _adjacent(
    own: PerceivedObject, other: PerceivedObject, side: Side, situation: Situation
) -> AdjacentVehicle | None:
    place = situation.path.predicted_place(own, other)
    if place is None or situation.bsm_data.is_on_another_level(other, abs(place.ahead_m)):
        return None
    lengths_m = (situation.own_size_m[0] + situation.bsm_data.size_m(other.name)[0]) / 2.0
    if place.ahead_m > lengths_m:
        return None
    along = math.cos(place.course_rad), math.sin(place.course_rad)
    speed_m_s = sum(map(math.prod, zip(along, other.state[2:], strict=True)))
    variance = place.left_sigma_m**2 + _across_m2(own, along) + _across_m2(other, along)
    to_side = NormalDist(place.left_m if side == "left" else -place.left_m, math.sqrt(variance))
    probability = to_side.cdf(1.5 * LANE_M) - to_side.cdf(0.5 * LANE_M)
    return AdjacentVehicle(
        -place.ahead_m - lengths_m,
        speed_m_s - math.hypot(*own.state[2:]),
        Assessment(Level.WARNING, probability, (object_reason(other, own),), other.name),
    )


def _across_m2(vehicle: PerceivedObject, along: tuple[float, float]) -> float:
    """Variance of a position across a direction."""
    (xx, xy), (_, yy) = (row[:2] for row in vehicle.covariance[:2])
    east, north = along
    return max(xx * north**2 - 2.0 * xy * north * east + yy * east**2, 0.0)
