"""P_C a second compared with brute force, and the time of a decision with 100 objects."""

import time
import timeit
from collections.abc import Callable, Iterator
from functools import partial
from statistics import median

import numpy as np

from bench import Figure
from onboard.kinematics.arrays import Array
from onboard.risk.collision_probability import Approach, collision_probability
from onboard.risk.conflict_zone import CarSize, XCrossing
from onboard.risk.driver_behaviour import Uniform
from onboard.risk.monitor import RiskMonitor
from onboard.risk.settings import RiskSettings
from onboard.risk.trajectory import reached_after_s, travelled_m
from onboard.tracking.perceived_object import ObjectSource, PerceivedObject

ROUNDS = 7
BATCH = 1000
LOWEST_M_S2, HIGHEST_M_S2 = np.array(-9.55), np.array(2.1)
TOP_M_S = np.array(100.0)
HALF_M = 0.5 * (5.0 + 1.75)
GRID = 400
"""Accelerations of each car in the brute force, which give it about the same error."""


def measure() -> Iterator[Figure]:
    """Yield evaluations/s of one pair and of 1,000, the errors, and the time of a decision."""
    rng = np.random.default_rng(0)
    pairs = rng.uniform(-3.0, 60.0, (2, BATCH, 1)), rng.uniform(0.0, 16.0, (2, BATCH, 1))
    one = _some(pairs, slice(1))
    brute_rate = _rate(partial(_brute_force, *one, GRID), 1)
    reference = f"brute force over {GRID} x {GRID} accelerations"
    for name, chosen, count in (("one", one, 1), ("batched", pairs, BATCH)):
        rate = _rate(partial(_exact, *chosen), count)
        yield Figure(f"collision_probability.{name}", rate, "P_C/s", ROUNDS, reference, brute_rate)
    some = _some(pairs, slice(40))
    truth = np.array([_brute_force(*_some(some, slice(k, k + 1)), 8 * GRID) for k in range(40)])
    brute = np.array([_brute_force(*_some(some, slice(k, k + 1)), GRID) for k in range(40)])
    yield Figure(
        "collision_probability.largest_error",
        float(np.abs(_exact(*some) - truth).max()),
        "1",
        40,
        reference,
        float(np.abs(brute - truth).max()),
    )
    for name, angle in (("right_angles", np.pi / 2), ("any_angles", None)):
        own, cars = _traffic(100, angle, rng)
        took_s = 1.0 / _rate(partial(_decide, own, cars), 1)
        yield Figure(
            f"collision_probability.decision_100_cars_{name}",
            took_s * 1e3,
            "ms",
            ROUNDS,
            "the interval of the BSM",
            100.0,
        )


def _exact(distance: Array, speed: Array) -> Array:
    limits = Uniform(LOWEST_M_S2, HIGHEST_M_S2)
    a, b = (Approach(distance[car], speed[car], TOP_M_S, limits) for car in (0, 1))
    size = CarSize(np.array(5.0), np.array(1.75))
    return collision_probability(a, b, XCrossing(size, size, np.array(np.pi / 2)))


def _brute_force(distance: Array, speed: Array, grid: int) -> float:
    """P_C of one pair from all pairs of accelerations, at a right angle."""
    drawn = LOWEST_M_S2 + (np.arange(grid) + 0.5) / grid * (HIGHEST_M_S2 - LOWEST_M_S2)
    entered, left = [], []
    for car in (0, 1):
        d, v = distance[car, 0], speed[car, 0]
        stops_m = travelled_m(np.array(np.inf), drawn, v, TOP_M_S)
        enters = (stops_m > d - HALF_M) & (d > -HALF_M)
        arrival_s = reached_after_s(d - HALF_M, drawn, v, TOP_M_S)
        departure_s = reached_after_s(d + HALF_M, drawn, v, TOP_M_S)
        entered.append(np.where(enters, arrival_s, np.inf))
        left.append(np.where(stops_m > d + HALF_M, departure_s, np.inf))
    meets = (entered[0][:, None] < left[1]) & (entered[1] < left[0][:, None])
    both = np.isfinite(entered[0])[:, None] & np.isfinite(entered[1])
    return float(np.mean(meets & both))


def _some(pairs: tuple[Array, Array], which: slice) -> tuple[Array, Array]:
    distance, speed = pairs
    return distance[:, which], speed[:, which]


def _traffic(
    count: int, angle: float | None, rng: np.random.Generator
) -> tuple[PerceivedObject, list[PerceivedObject]]:
    """A host vehicle from the west, and objects that cross its path."""
    rows = tuple(map(tuple, np.diag([1.0, 1.0, 0.25, 0.25]).tolist()))

    def perceived_object(name: str, state: tuple[float, ...]) -> PerceivedObject:
        return PerceivedObject(0.0, name, ObjectSource.SHARED, state, rows, 0.1, frozenset())

    cars = []
    for k in range(count):
        course = angle if angle is not None else rng.uniform(0.4, 2.7)
        along = np.array([np.cos(course), np.sin(course)])
        position_m = np.array([rng.uniform(-30.0, 10.0), 0.0]) - rng.uniform(5.0, 60.0) * along
        velocity = rng.uniform(5.0, 16.0) * along
        cars.append(perceived_object(f"{k:08x}", (*position_m.tolist(), *velocity.tolist())))
    return perceived_object("own", (-40.0, 0.0, 14.0, 0.0)), cars


def _decide(own: PerceivedObject, cars: list[PerceivedObject]) -> None:
    RiskMonitor(RiskSettings(), 5.0, 1.75).assess(own, cars, 0.0)


def _rate(work: Callable[[], object], count: int) -> float:
    """Evaluations a second of processor time."""
    rates = []
    for _ in range(ROUNDS):
        timer = timeit.Timer(work, timer=time.process_time)
        many = 20 if count == 1 else 3
        rates.append(count * many / timer.timeit(many))
    return median(rates)
