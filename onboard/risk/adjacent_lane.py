"""The vehicles in the lane into which the driver is about to change."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from statistics import NormalDist

from onboard.observations import Side
from onboard.risk.alarm import Assessment, Level, object_reason
from onboard.risk.bsm_data import BsmDataStore
from onboard.risk.path_ahead import PathAhead
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
    """A vehicle that may be in the lane into which the driver is about to change."""

    behind_m: float
    """From its front to the rear of the host vehicle; negative while both overlap."""
    closing_speed_m_s: float
    """By which it is faster than the host vehicle."""
    warning: Assessment
    """Of changing over; its value is the probability that the vehicle is in that lane."""

    def is_there(self, *, was_there: bool = False) -> bool:
        """Whether it is in that lane; `was_there` says if it was at the last assessment."""
        return self.warning.value >= (STILL_LIKELY if was_there else LIKELY)


def adjacent_vehicles(
    own: PerceivedObject,
    own_length_m: float,
    others: Sequence[PerceivedObject],
    side: Side,
    *,
    path: PathAhead,
    bsm_data: BsmDataStore,
) -> Iterator[AdjacentVehicle]:
    """Yield the vehicles beside and behind that may be in the lane on that side.

    Args:
        own: the host vehicle.
        own_length_m: its length.
        others: the perceived objects.
        side: on which the lane is.
        path: the host vehicle's.
        bsm_data: what the others report beside their motion.
    """
    own_m_s = math.hypot(*own.state[2:])
    if own_m_s < LEAST_SPEED_M_S:
        return
    for other in others:
        place = path.predicted_place(own, other) if other.age_s <= OLDEST_S else None
        if place is None or bsm_data.is_on_another_deck(other, abs(place.ahead_m)):
            continue
        lengths_m = (own_length_m + bsm_data.size_m(other.name)[0]) / 2.0
        if place.ahead_m > lengths_m:
            continue
        along = math.cos(place.course_rad), math.sin(place.course_rad)
        speed_m_s = sum(map(math.prod, zip(along, other.state[2:], strict=True)))
        variance = place.left_sigma_m**2 + _across_m2(own, along) + _across_m2(other, along)
        to_side = NormalDist(place.left_m if side == "left" else -place.left_m, math.sqrt(variance))
        probability = to_side.cdf(1.5 * LANE_M) - to_side.cdf(0.5 * LANE_M)
        yield AdjacentVehicle(
            -place.ahead_m - lengths_m,
            speed_m_s - own_m_s,
            Assessment(Level.WARNING, probability, (object_reason(other, own),), other.name),
        )


def _across_m2(vehicle: PerceivedObject, along: tuple[float, float]) -> float:
    """Variance of a position across a direction."""
    (xx, xy), (_, yy) = (row[:2] for row in vehicle.covariance[:2])
    east, north = along
    return max(xx * north**2 - 2.0 * xy * north * east + yy * east**2, 0.0)
