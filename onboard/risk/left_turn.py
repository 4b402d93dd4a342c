"""Where a vehicle that turns left crosses the path of one that goes straight on."""

import math

import numpy as np

from onboard.kinematics.arrays import Array
from onboard.observations import YawRate
from onboard.risk.path_crossing import MIN_ANGLE_RAD, PathCrossing, has_course, linearised
from onboard.tracking.perceived_object import ObjectSource, PerceivedObject

MAX_RADIUS_M = 30.0
"""Of a turn at a crossing; larger circles are bends of the road, which others follow too."""
MIN_RADIUS_M = 4.0
"""No car turns in a smaller circle."""
MIN_LATERAL_M_S2 = 1.0
"""With less lateral acceleration, noise could be a turn."""
MOST_TURNED_RAD = 2.2
"""Largest part of the turn that is left: a quarter of a circle, and some."""
ONCOMING_COS = 0.2
"""Largest cosine of the angle between the courses of a turning and an oncoming vehicle: who has
turned by a quarter of a circle is across the other's path."""
SIGNALLED_LATERAL_M_S2 = 0.4
"""The same with the turn signal on, three sigmas of a receiver's noise over `TREND_WINDOW_S`."""
SIGNALLED_RADIUS_M = 15.0
"""Largest radius of a turn with the turn signal on."""
SIGNALLED_BEND_M = 60.0
"""Radius of larger bends of the road, in which a turn signal left on is no turn. The estimate is
still too large when a turn begins."""
_REPORTED = (ObjectSource.HOST, ObjectSource.BSM)
TURNING_RAD_S = 0.04
"""Least yaw rate of a slow vehicle that turns with its turn signal on: eight sigmas of a sensor."""
TURNING_M_S = (2.5, 7.0)
"""Speeds of such a turn. Larger ones are those of bends; a vehicle that sets off to turn when there
is a gap is slower, and how fast it will cross is not known yet."""
PAST_RAD = 0.6
"""A vehicle that has turned past the other's path by less may still be in its way."""


def has_known_turn(vehicle: PerceivedObject) -> bool:
    """Whether a turn can be told from its velocities: whether it reports them itself.

    The noise of a track's velocities looks like turns, also of vehicles that drive side by side.
    """
    return vehicle.source in _REPORTED


def left_turn_radius_m(
    vehicle: PerceivedObject, lateral_m_s2: float | None, *, signals: bool = False
) -> float | None:
    """Return the radius of a vehicle's turn to the left; `None` if it does not turn so.

    A turn signal alone is no turn, it may have been left on; with it, less of a turn counts.

    Args:
        vehicle: its velocity counts.
        lateral_m_s2: across its course, to the left; `None` if it is not known.
        signals: whether its left turn signal is on.
    """
    least_m_s2 = SIGNALLED_LATERAL_M_S2 if signals else MIN_LATERAL_M_S2
    if lateral_m_s2 is None or lateral_m_s2 < least_m_s2 or not has_known_turn(vehicle):
        return None
    radius_m = math.hypot(*vehicle.state[2:]) ** 2 / lateral_m_s2
    if not MIN_RADIUS_M <= radius_m <= (SIGNALLED_BEND_M if signals else MAX_RADIUS_M):
        return None
    return min(radius_m, SIGNALLED_RADIUS_M) if signals else radius_m


def begun_turn_radius_m(
    speed_m_s: float, yaw_rate: YawRate | None, *, signals: bool
) -> float | None:
    """Return the radius of a slow turn to the left that has just begun; `None` without one.

    Velocities show it only half a second later.

    Args:
        speed_m_s: of the host vehicle.
        yaw_rate: its own.
        signals: whether its left turn signal is on.
    """
    if yaw_rate is None or not signals or not TURNING_M_S[0] <= speed_m_s <= TURNING_M_S[1]:
        return None
    left_rad_s = -yaw_rate.yaw_rate_rad_s
    if left_rad_s < TURNING_RAD_S:
        return None
    return float(np.clip(speed_m_s / left_rad_s, MIN_RADIUS_M, SIGNALLED_RADIUS_M))


def left_turn_crossing(
    turning: PerceivedObject, straight: PerceivedObject, radius_m: float
) -> PathCrossing | None:
    """Return where the circle of `turning` crosses the path of the oncoming `straight`.

    Distance and speed of `turning` come first, its distance along the circle. `None` where they do
    not cross, or `straight` is not oncoming, or a course is unknown.

    Raises:
        CovarianceError: the covariance of either state is invalid.
    """
    states = np.array([*turning.state, *straight.state])
    if not np.isfinite(states).all() or not (has_course(turning) and has_course(straight)):
        return None
    ways = _both_ways(states[:, None], radius_m)[:, :, 0]
    first = int(np.argmin(np.abs(ways[0])))
    turned_rad = float(ways[0, first])
    if not abs(turned_rad) <= MOST_TURNED_RAD:  # also where they do not cross
        return None
    courses = np.arctan2(states[[3, 7]], states[[2, 6]])
    if math.cos(courses[1] - courses[0]) > ONCOMING_COS:
        return None
    angle_rad = math.remainder(float(courses[1] - courses[0]) - turned_rad, 2.0 * math.pi)
    if abs(math.sin(angle_rad)) < math.sin(MIN_ANGLE_RAD):
        return None

    def approaches(states: Array) -> Array:
        turned, other_m = _both_ways(states, radius_m)[:, first]
        speeds = np.hypot(states[[2, 6]], states[[3, 7]])
        return np.stack([radius_m * turned, speeds[0], other_m, speeds[1]])

    return PathCrossing(*linearised(approaches, turning, straight), angle_rad)


def _both_ways(states: Array, radius_m: float) -> Array:
    """Ways to both points where circle and line meet, (2, 2, k); not a number if they do not.

    The first index is the way: the angle that is left to turn, and metres along the line.
    """
    p, v, q, w = states.reshape(4, 2, -1)
    along = w / np.hypot(*w)
    centre = p + radius_m * np.stack([-v[1], v[0]]) / np.hypot(*v)
    foot_m = np.sum((centre - q) * along, axis=0)
    aside = centre - q - foot_m * along
    with np.errstate(invalid="ignore"):
        half_m = np.sqrt(radius_m**2 - np.sum(aside**2, axis=0))
    other_m = np.stack([foot_m - half_m, foot_m + half_m])
    points = q + other_m[:, None] * along - centre
    start = p - centre
    turned = np.arctan2(points[:, 1], points[:, 0]) - np.arctan2(start[1], start[0])
    turned = np.mod(turned + PAST_RAD, 2.0 * math.pi) - PAST_RAD
    return np.stack([turned, other_m])
