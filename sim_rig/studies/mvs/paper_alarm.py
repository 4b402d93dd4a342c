"""The alarm of the MVS paper, as we read it: every car on the path is a potential collision.

"A DSRC-vehicle triggers an alert whenever it detects potential collision", from the states of both
cars (section V-C); the paper counts no false alarms. The studies evaluate it beside our own alarms
in the same runs, and simulate each crash once more with the drivers that it warns.
"""

import math

import numpy as np

from onboard.risk.bsm_data import DEFAULT_LENGTH_M, DEFAULT_WIDTH_M
from onboard.risk.ima import MAX_AGE_S
from onboard.risk.path_crossing import has_course
from onboard.tracking.perceived_object import PerceivedObject
from sim_rig.roads.cars import Cars
from sim_rig.roads.crashes import first_crash

_STANDING_M_S = 1.0
"""A slower car needs no course to be an obstacle."""


def paper_alarm(
    own: PerceivedObject,
    cars: list[PerceivedObject],
    own_size_m: tuple[float, float],
    within_s: float,
) -> PerceivedObject | None:
    """Find the first car that is hit if all cars keep speed and course.

    Args:
        own: the host vehicle.
        cars: its perceived objects.
        own_size_m: length and width of the host vehicle.
        within_s: prediction horizon.

    Returns:
        The car that is hit, or None if there is no contact within the horizon.
    """
    others = [
        car
        for car in cars
        if car.age_s <= MAX_AGE_S
        and (math.hypot(*car.state[2:]) < _STANDING_M_S or has_course(car))
        and _comes_near(own, car, own_size_m, within_s)
    ]
    if not others:
        return None
    states = np.array([car.state for car in (own, *others)])
    n = len(others)

    def constant_velocity(after_s: float) -> Cars:
        return Cars(
            after_s,
            ("own", *map(str, range(n))),
            states[:, :2] + after_s * states[:, 2:],
            np.arctan2(states[:, 3], states[:, 2]),
            np.hypot(states[:, 2], states[:, 3]),
            np.zeros(n + 1),
            np.array([own_size_m[0], *np.full(n, DEFAULT_LENGTH_M)]),
            np.array([own_size_m[1], *np.full(n, DEFAULT_WIDTH_M)]),
        )

    crash = first_crash(
        constant_velocity(0.0),
        constant_velocity(within_s),
        lambda one, other: "own" in (one, other),
    )
    if crash is None:
        return None
    (hit,) = (name for name in crash.names if name != "own")
    return others[int(hit)]


def _comes_near(
    own: PerceivedObject,
    car: PerceivedObject,
    own_size_m: tuple[float, float],
    within_s: float,
) -> bool:
    """Whether the circumscribed circles of both cars touch within that time."""
    apart, closing = np.subtract(car.state, own.state).reshape(2, 2)
    speed2 = float(closing @ closing)
    nearest_s = min(max(-float(apart @ closing) / speed2, 0.0), within_s) if speed2 else 0.0
    reach_m = np.hypot(*own_size_m) + np.hypot(DEFAULT_LENGTH_M, DEFAULT_WIDTH_M)
    return bool(np.hypot(*(apart + nearest_s * closing)) <= reach_m / 2.0)
