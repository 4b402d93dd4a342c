"""Crossing traffic at a red signal: expected to stop while it comfortably can."""

import math
from collections.abc import Callable
from typing import Any

import pytest

from onboard.risk.alarm import Alarm, Level
from onboard.risk.expected_stop import COMFORTABLE_M_S2, is_expected_to_stop
from onboard.tracking.perceived_object import PerceivedObject
from tests.risk.test_monitor import alarms, east, known, monitor, north, own, worst

STOP_LINE_M = 8.0


def red_from_the_south(vehicle: PerceivedObject) -> float | None:
    """The stop line of those who drive north."""
    east_m_s, north_m_s = vehicle.state[2:]
    left_m = -STOP_LINE_M - vehicle.state[1]
    return left_m if north_m_s > east_m_s and left_m > 0.0 else None


def red_from_the_west(vehicle: PerceivedObject) -> float | None:
    east_m_s, north_m_s = vehicle.state[2:]
    left_m = -STOP_LINE_M - vehicle.state[0]
    return left_m if east_m_s > north_m_s and left_m > 0.0 else None


def braking(
    drive: Callable[..., tuple[float, float, float, float]], until_s: float, braking_m_s2: float
) -> Callable[..., tuple[float, float, float, float]]:
    """Like `drive`, a drive north, until the driver brakes."""

    def at(t: float) -> tuple[float, float, float, float]:
        _, start_m, _, speed_m_s = drive(until_s)
        braked_s = min(max(t - until_s, 0.0), speed_m_s / braking_m_s2)
        if t < until_s:
            return drive(t)
        covered_m = speed_m_s * braked_s - braking_m_s2 * braked_s**2 / 2.0
        return 0.0, start_m + covered_m, 0.0, speed_m_s - braking_m_s2 * braked_s

    return at


def seen(
    mine: Callable[..., Any],
    other: Callable[..., tuple[float, float, float, float]],
    red: Callable[..., float | None],
    until_s: float = 5.0,
) -> list[Alarm]:
    of = monitor()
    for k in range(round(until_s * 10)):
        now = k / 10
        of.assess(own(mine(now), now), [known(other(now), now, sigma_m=0.5)], now, red)
    return alarms(of)


def test_who_has_red_is_expected_to_stop_while_he_can_comfortably() -> None:
    """(48 - 2.5 m) take 14 m/s at 2.2 m/s^2; (30 - 2.5 m) at 3.6 m/s^2."""
    car = known((0.0, -56.0, 0.0, 14.0), 0.0)
    assert is_expected_to_stop(car, 5.0, red_from_the_south)
    closer = known((0.0, -38.0, 0.0, 14.0), 0.0)
    assert not is_expected_to_stop(closer, 5.0, red_from_the_south)
    assert not is_expected_to_stop(car, 5.0, lambda _vehicle: None)


def test_a_longer_vehicle_has_less_way_left() -> None:
    car = known((0.0, -40.0, 0.0, 14.0), 0.0)
    limit_m = 2.0 * (32.0 - 14.0**2 / (2.0 * COMFORTABLE_M_S2))
    assert is_expected_to_stop(car, limit_m - 0.1, red_from_the_south)
    assert not is_expected_to_stop(car, limit_m + 0.1, red_from_the_south)


def test_beyond_the_stop_line_nobody_is_expected_to_stop() -> None:
    slow = known((0.0, -9.0, 0.0, 1.5), 0.0)
    assert not is_expected_to_stop(slow, 5.0, red_from_the_south)


def test_the_host_driver_needs_his_reaction_time_as_well() -> None:
    car = known((0.0, -48.0, 0.0, 14.0), 0.0)
    assert is_expected_to_stop(car, 5.0, red_from_the_south)
    assert not is_expected_to_stop(car, 5.0, red_from_the_south, reaction_s=1.0)


@pytest.mark.parametrize("braking_m_s2", [1.5, 2.5, 3.0])
def test_a_vehicle_that_stops_at_red_raises_no_alarm(braking_m_s2: float) -> None:
    way_m = 14.0**2 / (2.0 * braking_m_s2) + 2.5 + STOP_LINE_M
    stops = braking(north(14.0, way_m + 14.0), 1.0, braking_m_s2)
    until_s = 1.0 + 14.0 / braking_m_s2
    meets_at_the_line = east(14.0, (way_m + 14.0) * 0.9)

    assert seen(meets_at_the_line, stops, red_from_the_south, until_s) == []


def test_a_vehicle_that_passes_red_is_warned_of() -> None:
    warned = seen(east(14.0, 60.0), north(14.0, 60.0), red_from_the_south)

    first = next(alarm for alarm in warned if alarm.level is Level.WARNING)
    assert first.stamp_s <= 60.0 / 14.0 - 2.0, "two seconds before they meet"


def test_a_host_driver_who_drives_on_at_red_is_warned() -> None:
    warned = seen(east(14.0, 60.0), north(14.0, 60.0), red_from_the_west)

    first = next(alarm for alarm in warned if alarm.level is Level.WARNING)
    left_m = 60.0 - 14.0 * first.stamp_s - STOP_LINE_M - 2.4
    assert left_m >= 14.0**2 / (2.0 * 8.0), "enough to stop at the line, braking hard"


def test_a_host_driver_who_may_still_stop_at_red_is_not_warned() -> None:
    assert worst(seen(east(14.0, 90.0), north(14.0, 90.0), red_from_the_west, 1.5)) is Level.NONE


def test_a_signal_of_others_changes_nothing() -> None:
    def elsewhere(vehicle: PerceivedObject) -> float | None:
        return 500.0 if math.hypot(*vehicle.state[2:]) < 1.0 else None

    with_signal = seen(east(14.0, 60.0), north(14.0, 60.0), elsewhere)
    without = seen(east(14.0, 60.0), north(14.0, 60.0), lambda _vehicle: None)
    assert with_signal == without != []
