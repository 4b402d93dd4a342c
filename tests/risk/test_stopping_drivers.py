"""Drivers who stop at a crossing, with the receivers and the OBD speed that cars have."""

import math
from collections.abc import Iterator

import numpy as np
import pytest

from onboard.kinematics.units import KM_H
from onboard.observations import Speed
from onboard.risk.alarm import Alarm, Level
from onboard.risk.monitor import RiskMonitor
from onboard.risk.settings import RiskSettings
from onboard.tracking.perceived_object import ObjectSource, PerceivedObject

LINE_M = 8.5
"""Of a vehicle's centre before the middle of the crossing, when it stands at the stop line."""
BRAKES_S = 2.0
SHOWN_S = 0.15
"""Until speeds of 10 Hz, 0.05 s old, show a braking."""


def stop(now: float, speed_m_s: float, braking_m_s2: float) -> tuple[float, float]:
    """Place and speed of a driver who brakes from `BRAKES_S` on and stands at the line."""
    braked_s = min(max(now - BRAKES_S, 0.0), speed_m_s / braking_m_s2)
    present_m_s = speed_m_s - braking_m_s2 * braked_s
    way_m = speed_m_s * min(now, BRAKES_S) + (speed_m_s + present_m_s) / 2.0 * braked_s
    return way_m - stop_way_m(speed_m_s, braking_m_s2), present_m_s


def stop_way_m(speed_m_s: float, braking_m_s2: float) -> float:
    return speed_m_s * BRAKES_S + speed_m_s**2 / (2.0 * braking_m_s2) + LINE_M


def perceived(
    name: str, state: tuple[float, ...], now: float, age_s: float, acceleration_m_s2: float | None
) -> PerceivedObject:
    rows = tuple(map(tuple, np.diag([0.53, 0.53, 0.25, 0.25]).tolist()))
    source = ObjectSource.HOST if name == "own" else ObjectSource.BSM
    return PerceivedObject(
        now, name, source, state, rows, age_s, frozenset(), acceleration_m_s2=acceleration_m_s2
    )


def warnings(
    speed_m_s: float, braking_m_s2: float, *, meets_s: float, fixes_hz: float, seed: int
) -> Iterator[Alarm]:
    """A driver stops for another, who comes from the right and drives on at 14 m/s."""
    rng = np.random.default_rng(seed)
    monitor = RiskMonitor(RiskSettings(), 5.0, 1.75)
    phase_s = rng.uniform(0.0, 1.0 / fixes_hz)
    for k in range(80):
        now = k / 10
        read_m_s = stop(now - 0.05, speed_m_s, braking_m_s2)[1]
        floor_m_s = math.floor(read_m_s / KM_H) * KM_H
        monitor.host.receive_observation(Speed(now - 0.05, floor_m_s, KM_H, "obd:7E8"))
        age_s = (now - phase_s) % (1.0 / fixes_hz)
        place_m, fix_m_s = stop(now - age_s, speed_m_s, braking_m_s2)
        velocity_m_s = fix_m_s + 0.1 * rng.normal()
        mine = (place_m + 0.2 * rng.normal() + age_s * velocity_m_s, 0.0, velocity_m_s, 0.0)
        other = (0.0, 14.0 * (now - meets_s), 0.0, 14.0)
        monitor.assess(
            perceived("own", mine, now, age_s, None),
            [perceived("0a0b0c0d", other, now, 0.15, 0.0)],
            now,
        )
        for event in iter(monitor.next_event, None):
            if isinstance(event, Alarm) and event.level is Level.WARNING:
                yield event


@pytest.mark.parametrize("seed", range(16))
def test_an_ordinary_stop_with_one_fix_a_second_raises_no_warning(seed: int) -> None:
    """The acceleration is the OBD speed's: held velocities change by all of a second at once."""
    meets_s = BRAKES_S + 2.0 + seed / 4

    assert not list(warnings(10.0, 1.5, meets_s=meets_s, fixes_hz=1.0, seed=seed))


@pytest.mark.parametrize("seed", range(15))
def test_a_driver_who_brakes_needs_no_second_reaction_time(seed: int) -> None:
    meets_s = BRAKES_S + 1.5 + seed / 5

    seen = warnings(14.0, 3.0, meets_s=meets_s, fixes_hz=10.0, seed=seed)

    assert not [each for each in seen if each.stamp_s > BRAKES_S + SHOWN_S]


@pytest.mark.parametrize(("age_s", "is_warned"), [(0.15, True), (0.6, True), (0.8, False)])
def test_by_old_data_the_other_driver_may_have_begun_to_brake(
    age_s: float, is_warned: bool
) -> None:
    """Both are at 14 m/s until 2.1 s before the middle: too near to stop without braking hard."""
    monitor = RiskMonitor(RiskSettings(), 5.0, 1.75)
    seen: list[Level] = []
    for k in range(20):
        now = k / 10
        left_m = 14.0 * (4.0 - now)
        monitor.host.receive_observation(Speed(now, 14.0, KM_H, "obd:7E8"))
        mine, other = (-left_m, 0.0, 14.0, 0.0), (0.0, -left_m, 0.0, 14.0)
        monitor.assess(
            perceived("own", mine, now, 0.1, None),
            [perceived("0a0b0c0d", other, now, age_s, 0.0)],
            now,
        )
        events = iter(monitor.next_event, None)
        seen += [event.level for event in events if isinstance(event, Alarm)]
    assert (Level.WARNING in seen) == is_warned
