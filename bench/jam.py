"""State changes of the warning group, and FCW, of cars in a jam, in virtual time.

The first of thirty cars goes at up to 5 m/s and stops, again and again. Counted from when the
group has formed; the reference is how often a car stops.
"""

from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from bench import Figure
from onboard.risk.alarm import Level
from onboard.settings import parse_settings
from sim_rig.roads.car_following import CarFollowing, idm_acceleration
from sim_rig.roads.cars import Array
from sim_rig.runs.virtual import run_virtual
from sim_rig.scenario.schema import Scenario

CARS, FORMED_S, COUNTED_S, STEP_S = 30, 10.0, 60.0, 0.1
FIRST_ACCELERATION_M_S2, FIRST_BRAKING_M_S2 = 1.0, 2.0
WISHED_M_S, COMFORTABLE_M_S2 = 8.0, 2.0
MODEL = CarFollowing(acceleration_m_s2=1.5)
LENGTH_M = 4.5
LETTERS = "ABCDEFGHJKLMNPR"


def measure() -> Iterator[Figure]:
    """Yield state changes and FCW of a car and minute."""
    speeds_m_s = _speeds(np.random.default_rng(1))
    log = run_virtual(_scenario(speeds_m_s))
    car_minutes = CARS * COUNTED_S / 60.0
    is_at_rest = speeds_m_s[round(FORMED_S / STEP_S) :] == 0.0
    stops = int(np.count_nonzero(is_at_rest[1:] & ~is_at_rest[:-1])) / car_minutes
    changes = sum(1 for car in log.traces for _ in log.of(car, "transition", from_s=FORMED_S))
    alarms = sum(
        record["level"] != Level.NONE.value
        for car in log.traces
        for record in log.of(car, "alarm", from_s=FORMED_S, cause="fcw")
    )
    for name, number in (("state_changes", changes), ("fcw", alarms)):
        yield Figure(f"jam.{name}", number / car_minutes, "1/min", number, "stops", stops)


def _speeds(rng: np.random.Generator) -> Array:
    """(steps, cars) speeds, the first car's first."""
    steps = round((FORMED_S + COUNTED_S) / STEP_S)
    speeds = np.zeros((steps + 1, CARS))
    gaps_m = np.full(CARS - 1, MODEL.standing_gap_m)
    wished_m_s, left = 0.0, 0
    for before, after in pairwise(speeds):
        if left == 0:
            wished_m_s = float(rng.uniform(2.0, 5.0)) if wished_m_s == 0.0 else 0.0
            left = int(rng.uniform(4.0, 10.0) / STEP_S)
        left -= 1
        own, ahead = before[1:], before[:-1]
        acceleration = idm_acceleration(
            own, np.array(WISHED_M_S), np.maximum(gaps_m, 0.1), own - ahead, COMFORTABLE_M_S2, MODEL
        )
        after[0] = before[0] + np.clip(
            wished_m_s - before[0],
            -FIRST_BRAKING_M_S2 * STEP_S,
            FIRST_ACCELERATION_M_S2 * STEP_S,
        )
        after[1:] = np.maximum(own + acceleration * STEP_S, 0.0)
        after[after < 0.01] = 0.0
        gaps_m += (ahead + after[:-1] - own - after[1:]) / 2.0 * STEP_S
    return speeds


def _scenario(speeds_m_s: Array) -> Scenario:
    times_s = [round(number * STEP_S, 3) for number in range(len(speeds_m_s))]
    cars = {
        f"car{number}": {
            "plate": f"K{_letter(number)}{(137 * number + 101) % 1000:03d}{_letter(-number)}T",
            "start_m": 1000.0 - (LENGTH_M + MODEL.standing_gap_m) * number,
            "speed_m_s": list(zip(times_s, speeds_m_s[:, number].tolist(), strict=True)),
        }
        for number in range(CARS)
    }
    tree = {
        "title": "A jam goes and stops, again and again.",
        "seed": 1,
        "duration_s": FORMED_S + COUNTED_S,
        "radio": {"reach_m": 300.0},
        "cars": cars,
        "expect": [],
    }
    return parse_settings(tree, Scenario, __name__)


def _letter(number: int) -> str:
    return LETTERS[number % len(LETTERS)]
