"""P_C during the approaches, from exact data and from received beacons (section V)."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from onboard.risk.collision_probability import Approach, collision_probability
from onboard.risk.conflict_zone import CarSize, ConflictZone, XCrossing
from onboard.risk.driver_behaviour import Behaviour, Triangular, Uniform
from sim_rig.studies.joerer.radio import BeaconSettings, is_received
from sim_rig.studies.joerer.traffic import Approaches, Array, TrafficSettings

NO_TOP_M_S = 100.0
"""The paper limits accelerations, not speeds (eq. 1); no car of the study reaches this speed."""

UNAVOIDABLE = 1.0 - 1e-9
"""P_C from which a crash counts as unavoidable."""

_PAIRS_AT_ONCE = 1000
"""Batch that fits the processor's cache."""

BEHAVIOURS = ("uniform", "triangular")


@dataclass(frozen=True, slots=True)
class Beacons:
    """The m beacons received at one beacon interval, in order of car and time."""

    car: NDArray[np.int64]
    """(m,) approach * 2 + receiving car."""
    tick: NDArray[np.int64]
    """(m,) tick of reception."""


def criticality(
    approaches: Approaches,
    behaviour: str,
    traffic: TrafficSettings,
    zone: ConflictZone | None = None,
) -> Array:
    """P_C (n, ticks) from exact data of both cars; NaN after the end of an approach.

    The last value is at the first tick at or after the crash or the end.

    Args:
        approaches: n approaches.
        behaviour: one of `BEHAVIOURS`.
        traffic: sizes of the cars, and limits of acceleration.
        zone: where they may touch; the paper's crossing at a right angle if `None`.
    """
    result = np.full(approaches.distance_m.shape[:2], np.nan)
    at = np.nonzero(~_ended(approaches))
    size = car_size(traffic)
    zone = zone or XCrossing(size, size, np.array(np.pi / 2))
    for begin in range(0, len(at[0]), _PAIRS_AT_ONCE):
        some = tuple(index[begin : begin + _PAIRS_AT_ONCE] for index in at)
        one, other = (
            Approach(
                approaches.distance_m[some][:, car, None].astype(np.float64),
                approaches.speed_m_s[some][:, car, None].astype(np.float64),
                np.array(NO_TOP_M_S),
                _behaviour(behaviour, approaches.acceleration_m_s2[some][:, car, None], traffic),
            )
            for car in (0, 1)
        )
        result[some] = collision_probability(one, other, zone)
    return result


def car_size(traffic: TrafficSettings) -> CarSize:
    """Return the size of all cars."""
    return CarSize(np.array(traffic.length_m), np.array(traffic.width_m))


def received(
    approaches: Approaches, interval_s: float, radio: BeaconSettings, rng: np.random.Generator
) -> Beacons:
    """Simulate the beacons of all cars until the crash.

    Args:
        approaches: n approaches.
        interval_s: beacon interval; every car has its own phase.
        radio: of the path loss.
        rng: source of the phases.
    """
    n, ticks, _ = approaches.distance_m.shape
    every = round(interval_s / approaches.tick_s)
    phase = rng.integers(every, size=(n, 2))  # of the sender
    sent = np.arange(ticks)[None, :, None] % every == phase[:, None, :]
    before_end = np.arange(ticks) * approaches.tick_s < approaches.end_s[:, None]
    arrived = is_received(approaches.distance_m, radio) & before_end
    approach, receiver, tick = np.nonzero((sent[:, :, ::-1] & arrived[:, :, None]).swapaxes(1, 2))
    return Beacons(approach * 2 + receiver, tick)


def highest(p_c: Array, beacons: Beacons) -> Array:
    """Highest P_C (2 n,) at the beacons that each car received; 0 without any."""
    result = np.zeros(2 * len(p_c))
    np.maximum.at(result, beacons.car, p_c[beacons.car // 2, beacons.tick])
    return result


def last_before_unavoidable(p_c: Array, beacons: Beacons) -> Array:
    """P_C (2 n,) at each car's last beacon before the first with 100 %; NaN without one."""
    values = p_c[beacons.car // 2, beacons.tick]
    unavoidable_from = np.full(2 * len(p_c), p_c.shape[1])
    certain = values >= UNAVOIDABLE
    np.minimum.at(unavoidable_from, beacons.car[certain], beacons.tick[certain])
    before = beacons.tick < unavoidable_from[beacons.car]
    result = np.full(2 * len(p_c), np.nan)
    result[beacons.car[before]] = values[before]  # in order of time: the last assignment remains
    return result


def _ended(approaches: Approaches) -> NDArray[np.bool_]:
    tick = np.arange(approaches.distance_m.shape[1])
    ended: NDArray[np.bool_] = (
        tick * approaches.tick_s >= approaches.end_s[:, None] + approaches.tick_s
    )
    return ended


def _behaviour(name: str, present_m_s2: Array, traffic: TrafficSettings) -> Behaviour:
    limits = np.array(-traffic.hardest_deceleration_m_s2), np.array(traffic.acceleration_m_s2)
    if name == "uniform":
        return Uniform(*limits)
    return Triangular(limits[0], present_m_s2.astype(np.float64), limits[1])
