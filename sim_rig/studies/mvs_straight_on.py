"""The alarm of the MVS paper, as we read it: whatever is on the way is a potential collision.

"A DSRC-vehicle triggers an alert whenever it detects potential collision", from the states of both
cars (section V-C); the paper counts no false alarms. Here it is judged beside our own alarm, in the
same runs, and a crash is played again with drivers who are warned by it.
"""

import math

import numpy as np

from onboard.mvs.perceived_object import PerceivedObject
from onboard.risk.path_crossing import has_course
from onboard.risk.settings import RiskSettings
from sim_rig.roads.cars import Cars
from sim_rig.roads.crashes import first_crash

_STANDS_M_S = 1.0
"""A slower car has no course, and is in the way as well."""


def touched_straight_on(
    own: PerceivedObject,
    cars: list[PerceivedObject],
    own_size_m: tuple[float, float],
    settings: RiskSettings,
    within_s: float,
) -> PerceivedObject | None:
    """Who is touched first if all keep speed and course; `None` if nobody is within that time."""
    others = [
        car
        for car in cars
        if car.age_s <= settings.ima.oldest_s
        and (math.hypot(*car.state[2:]) < _STANDS_M_S or has_course(car, settings.ima))
        and _comes_near(own, car, own_size_m, settings, within_s)
    ]
    if not others:
        return None
    states = np.array([car.state for car in (own, *others)])
    n = len(others)

    def straight_on(after_s: float) -> Cars:
        return Cars(
            after_s,
            ("own", *map(str, range(n))),
            states[:, :2] + after_s * states[:, 2:],
            np.arctan2(states[:, 3], states[:, 2]),
            np.hypot(states[:, 2], states[:, 3]),
            np.zeros(n + 1),
            np.array([own_size_m[0], *np.full(n, settings.other_length_m)]),
            np.array([own_size_m[1], *np.full(n, settings.other_width_m)]),
        )

    crash = first_crash(
        straight_on(0.0), straight_on(within_s), lambda one, other: "own" in (one, other)
    )
    if crash is None:
        return None
    (touched,) = (name for name in crash.names if name != "own")
    return others[int(touched)]


def _comes_near(
    own: PerceivedObject,
    car: PerceivedObject,
    own_size_m: tuple[float, float],
    settings: RiskSettings,
    within_s: float,
) -> bool:
    """Whether the circles around both cars meet within that time."""
    apart, closing = np.subtract(car.state, own.state).reshape(2, 2)
    speed2 = float(closing @ closing)
    nearest_s = min(max(-float(apart @ closing) / speed2, 0.0), within_s) if speed2 else 0.0
    reach_m = np.hypot(*own_size_m) + np.hypot(settings.other_length_m, settings.other_width_m)
    return bool(np.hypot(*(apart + nearest_s * closing)) <= reach_m / 2.0)
