"""A speed that collapses is a collision, unless the bus shows a fault."""

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from onboard.kinematics.units import KM_H
from onboard.obd.braking import Braking
from onboard.obd.speed_collapse import COLLISION_S, CONFIRM_S
from onboard.observations import BrakeCause, HardBrake, Speed

ENGINE, GEARBOX = "obd:7E8", "obd:7EA"


def reports(
    speed_m_s: Callable[..., float],
    hz: int = 20,
    end_s: float = 8.0,
    source: str = ENGINE,
    offset_s: float = 0.0,
) -> Iterator[Speed]:
    """Whole km/h of `speed_m_s(t)`."""
    for t in np.arange(offset_s, end_s, 1 / hz).tolist():
        yield Speed(t, speed_m_s(t) // KM_H * KM_H, KM_H, source)


def changes(
    speeds: Iterator[Any] | list[Speed], used: str = ENGINE, end_s: float = 20.0
) -> list[HardBrake]:
    """Every change of the braking; other sources than `used` are compared only."""
    braking = Braking(0.4)
    found: list[HardBrake] = []
    for speed in sorted(speeds, key=lambda each: each.stamp_s):
        receive = braking.receive_speed if speed.source == used else braking.receive_other_speed
        receive(speed, speed.stamp_s)
        found += iter(braking.next_event, None)
    while (at := braking.get_timer()) < end_s:
        braking.handle_timer(at)
        found += iter(braking.next_event, None)
    return found


def crash(
    at_s: float = 2.0, from_m_s: float = 20.0, lasting_s: float = 0.1, to_m_s: float = 0.0
) -> Callable[..., Any]:
    return lambda t: np.interp(t, [at_s, at_s + lasting_s], [from_m_s, to_m_s])


@pytest.mark.parametrize("hz", [2, 10, 20, 50])
@pytest.mark.parametrize("lasting_s", [0.001, 0.1, 0.2])
@pytest.mark.parametrize("from_m_s", [8.0, 20.0, 35.0])
def test_a_collision_is_shown_as_soon_as_the_speed_stays_low(
    hz: int, lasting_s: float, from_m_s: float
) -> None:
    found = changes(reports(crash(2.02, from_m_s, lasting_s), hz))
    if hz == 2 and from_m_s < 20.0:
        return  # a tyre can stop from 8 m/s between two samples
    collision = next(each for each in found if each.cause is BrakeCause.COLLISION)
    assert 2.02 + CONFIRM_S < collision.stamp_s <= 2.02 + lasting_s + CONFIRM_S + 2 / hz
    assert collision.deceleration_m_s2 > 12.0
    assert collision.source == ENGINE


def test_60_m_s2_at_50_hz_is_a_collision_though_no_single_step_is_impossible() -> None:
    found = changes(reports(crash(lasting_s=20.0 / 60.0), 50))
    assert BrakeCause.COLLISION in {each.cause for each in found}


def test_a_collision_into_a_moving_car_leaves_some_speed() -> None:
    found = changes(reports(crash(from_m_s=25.0, to_m_s=12.0)))
    assert found[0].cause is BrakeCause.COLLISION


def test_a_collision_is_over_after_its_time_also_on_a_bus_that_it_silenced() -> None:
    for end_s in (2.6, 12.0):
        begin, end = changes(reports(crash(), end_s=end_s))
        assert end.is_over
        assert end.stamp_s - begin.stamp_s == pytest.approx(COLLISION_S, abs=0.06)


@pytest.mark.parametrize("hz", [10, 20, 50])
@pytest.mark.parametrize("low_m_s", [0.0, 5.0, 14.0])
def test_a_single_wrong_sample_is_no_collision(hz: int, low_m_s: float) -> None:
    speeds = list(reports(lambda t: 20.0, hz))
    n = len(speeds) // 2
    speeds[n] = Speed(speeds[n].stamp_s, low_m_s, KM_H, ENGINE)
    assert changes(speeds) == []


def test_a_single_wrong_sample_that_is_too_high_is_no_collision() -> None:
    speeds = list(reports(lambda t: 20.0))
    speeds[80] = Speed(speeds[80].stamp_s, 50.0, KM_H, ENGINE)
    assert changes(speeds) == []


@pytest.mark.parametrize("hz", [2, 10, 20])
def test_an_ecu_that_restarts_at_0_is_contradicted_by_another_one(hz: int) -> None:
    restarted = reports(lambda t: 0.0 if 3.0 <= t < 6.0 else 20.0, hz)
    other = reports(lambda t: 20.3, hz, source=GEARBOX, offset_s=0.001)
    assert changes([*restarted, *other]) == []


@pytest.mark.parametrize("hz", [2, 10, 20])
@pytest.mark.parametrize("late_s", [0.0, 0.1])
def test_another_ecu_that_stops_too_confirms_a_collision(hz: int, late_s: float) -> None:
    """Its values may be up to 100 ms old."""
    other = reports(lambda t: crash()(t - late_s), hz, source=GEARBOX, offset_s=0.001)
    begin, *_ = changes([*reports(crash(), hz), *other])
    assert begin.cause is BrakeCause.COLLISION
    assert begin.stamp_s < 2.4 + 2 / hz


def test_a_contradiction_after_the_alarm_ends_it() -> None:
    late = [Speed(t, 20.0, KM_H, GEARBOX) for t in (1.9, 2.9)]
    begin, end = changes([*reports(crash()), *late])
    assert (begin.cause, end.is_over, end.stamp_s) == (BrakeCause.COLLISION, True, 2.9)


def test_with_one_source_a_sensor_that_dies_at_0_warns_once() -> None:
    """The price of warning of a collision that leaves one source."""
    found = changes(reports(lambda t: 20.0 if t < 3.0 else 0.0, end_s=15.0))
    assert [each.is_over for each in found] == [False, True]


@pytest.mark.parametrize("locked_s", [0.3, 0.6, 1.0])
def test_wheels_that_lock_are_hard_braking(locked_s: float) -> None:
    """Without ABS: the vehicle loses 7 m/s2 meanwhile."""

    def wheels(t: float) -> float:
        if 2.0 <= t < 2.0 + locked_s:
            return 0.0
        return 20.0 - 7.0 * min(max(t - 2.0, 0.0), locked_s)

    begin, *_, end = changes(reports(wheels))
    assert begin.stamp_s < 2.31
    assert end.is_over
    assert 2.0 + locked_s <= end.stamp_s < 2.0 + locked_s + 0.2


def test_a_loose_contact_warns_at_most_once_while_it_lasts() -> None:
    flapping = reports(lambda t: 0.0 if t >= 2.0 and t % 0.7 < 0.35 else 20.0)
    assert len([each for each in changes(flapping) if each.is_over]) <= 1


def test_one_collision_follows_another() -> None:
    def twice(t: float) -> float:
        return np.interp(t, [2.0, 2.1, 9.0, 12.0, 14.0, 14.1], [20.0, 0.0, 0.0, 12.0, 12.0, 0.0])

    found = changes(reports(twice, end_s=16.0), end_s=30.0)
    assert [each.is_over for each in found] == [False, True, False, True]


@pytest.mark.long
@given(
    seed=st.integers(0, 2**32 - 1),
    hz=st.sampled_from([2, 10, 20]),
    loss=st.sampled_from([0.0, 0.3, 0.6]),
    refresh_s=st.sampled_from([0.005, 0.1]),
)
def test_no_drive_that_tyres_can_drive_has_a_collision(
    seed: int, hz: int, loss: float, refresh_s: float
) -> None:
    rng = np.random.default_rng(seed)
    grid_s = np.arange(0.0, 30.0, 0.005)
    acceleration = np.repeat(rng.uniform(-10.0, 6.0, 60), len(grid_s) // 60)
    speed = np.maximum(np.cumsum(acceleration * 0.005) + rng.uniform(0.0, 50.0), 0.0)
    times = np.arange(0.2, 29.5, 1 / hz)
    times = times[rng.random(len(times)) >= loss]
    stamps = np.sort(times + rng.uniform(0.0, 0.02, len(times)))
    reported = np.floor(speed[(times // refresh_s * refresh_s / 0.005).astype(int)] / KM_H) * KM_H
    speeds = [
        Speed(at, value, KM_H, ENGINE)
        for at, value in zip(stamps.tolist(), reported.tolist(), strict=True)
    ]
    assert BrakeCause.COLLISION not in {each.cause for each in changes(speeds)}
