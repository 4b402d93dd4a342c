"""Signals: who has red is expected to stop while it comfortably can, and to pass once it cannot."""

import math
from collections.abc import Callable
from typing import Any

import pytest
from typing_extensions import override

from onboard.risk.alarm import Alarm, Level
from onboard.risk.signal_intent import COMFORTABLE_M_S2, NO_SIGNALS, Intent, Signals, signal_intent
from onboard.tracking.perceived_object import PerceivedObject
from tests.risk.test_monitor import alarms, east, known, monitor, north, own, worst

STOP_LINE_M = 8.0


class Lights:
    """Signals of those who drive north and of those who drive east, at lines before the middle."""

    def __init__(self, north: str = "", east: str = "", line_m: float = STOP_LINE_M) -> None:
        self._shown = {"north": north, "east": east}
        self._line_m = line_m

    def red_light_m(self, vehicle: PerceivedObject, /) -> float | None:
        return self._light_m(vehicle, "red")

    def green_light_m(self, vehicle: PerceivedObject, /) -> float | None:
        return self._light_m(vehicle, "green")

    def _light_m(self, vehicle: PerceivedObject, colour: str) -> float | None:
        east_m, north_m, east_m_s, north_m_s = vehicle.state
        to, at_m = ("north", north_m) if north_m_s > east_m_s else ("east", east_m)
        left_m = -self._line_m - at_m
        return left_m if self._shown[to] == colour and left_m > 0.0 else None


RED_NORTH, RED_EAST = Lights(north="red"), Lights(east="red")


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
    signals: Signals,
    until_s: float = 5.0,
) -> list[Alarm]:
    of = monitor()
    for k in range(round(until_s * 10)):
        now = k / 10
        of.assess(own(mine(now), now), [known(other(now), now, sigma_m=0.5)], now, signals)
    return alarms(of)


def intent(at_m: float, speed_m_s: float = 14.0, signals: Signals = RED_NORTH, **how: Any) -> Any:
    """Of a vehicle of 5 m that drives north, `at_m` before the middle."""
    state = (0.0, -at_m, 0.0, speed_m_s)
    return signal_intent(known(state, 0.0), 5.0, signals, how.pop("along_m_s2", 0.0), **how)


def test_who_has_red_is_expected_to_stop_while_he_can_comfortably_and_then_to_pass() -> None:
    """(48 - 2.5 m) take 14 m/s at 2.2 m/s^2; (30 - 2.5 m) at 3.6 m/s^2."""
    assert intent(56.0) is Intent.STOPS
    assert intent(38.0) is Intent.PASSES_RED
    assert intent(38.0, along_m_s2=-1.0) is None, "he may yet brake harder"
    assert intent(38.0, along_m_s2=None) is None
    assert intent(56.0, signals=NO_SIGNALS) is None


def test_who_has_green_is_expected_to_pass_unless_he_brakes() -> None:
    assert intent(56.0, signals=Lights(north="green")) is Intent.PASSES_GREEN
    assert intent(56.0, signals=Lights(north="green"), along_m_s2=-1.0) is None


def test_a_longer_vehicle_has_less_way_left() -> None:
    car = known((0.0, -40.0, 0.0, 14.0), 0.0)
    limit_m = 2.0 * (32.0 - 14.0**2 / (2.0 * COMFORTABLE_M_S2))
    assert signal_intent(car, limit_m - 0.1, RED_NORTH, 0.0) is Intent.STOPS
    assert signal_intent(car, limit_m + 0.1, RED_NORTH, 0.0) is Intent.PASSES_RED


def test_who_creeps_over_the_stop_line_neither_stops_nor_passes() -> None:
    assert intent(9.0, 1.5) is None


def test_a_host_driver_who_is_about_to_brake_for_his_red_is_not_warned() -> None:
    """With 2.5 m/s^2, as at signals; the other has green, and is not about to stop."""
    way_m = 14.0**2 / 5.0 + 2.5 + STOP_LINE_M
    drive = braking(north(14.0, way_m + 28.0), 2.0, 2.5)

    def stops(t: float) -> tuple[float, float, float, float]:
        _, at_m, _, speed_m_s = drive(t)
        return at_m, 0.0, speed_m_s, 0.0

    goes = north(14.0, way_m + 27.0)
    assert seen(stops, goes, Lights(north="green", east="red"), 7.6) == []


@pytest.mark.parametrize("braking_m_s2", [1.5, 2.5, 3.0])
def test_a_vehicle_that_stops_at_red_raises_no_alarm(braking_m_s2: float) -> None:
    way_m = 14.0**2 / (2.0 * braking_m_s2) + 2.5 + STOP_LINE_M
    stops = braking(north(14.0, way_m + 14.0), 1.0, braking_m_s2)
    until_s = 1.0 + 14.0 / braking_m_s2
    meets_at_the_line = east(14.0, (way_m + 14.0) * 0.9)

    for own_light in ("", "green"):
        signals = Lights(north="red", east=own_light)
        assert seen(meets_at_the_line, stops, signals, until_s) == []


def first_warning_s(host_m_s: float, other_m_s: float, signals: Signals) -> float:
    """How long before they meet, at 5 s, a vehicle that passes from the south is warned of."""
    warned = seen(east(host_m_s, 5.0 * host_m_s), north(other_m_s, 5.0 * other_m_s), signals)
    return 5.0 - next(alarm.stamp_s for alarm in warned if alarm.level is Level.WARNING)


def test_a_vehicle_that_passes_red_is_warned_of() -> None:
    assert first_warning_s(14.0, 14.0, RED_NORTH) >= 2.0


@pytest.mark.parametrize(("host_m_s", "other_m_s"), [(14.0, 10.0), (6.0, 14.0)])
def test_a_red_that_is_passed_and_the_own_green_warn_sooner(
    host_m_s: float, other_m_s: float
) -> None:
    """Who drives 10 m/s could stop before the crossing, but not any more at his line."""
    signals = Lights(north="red", east="green", line_m=15.0)

    sooner_s = first_warning_s(host_m_s, other_m_s, signals)

    assert sooner_s >= first_warning_s(host_m_s, other_m_s, NO_SIGNALS) + 0.3


def test_two_that_have_green_are_warned_as_without_signals() -> None:
    both = Lights(north="green", east="green")

    assert first_warning_s(6.0, 14.0, both) == first_warning_s(6.0, 14.0, NO_SIGNALS)


def test_a_red_far_before_the_crossing_says_nothing_of_the_crossing() -> None:
    far = Lights(north="red", east="green", line_m=30.0)
    green = Lights(east="green")

    assert first_warning_s(14.0, 17.0, far) <= first_warning_s(14.0, 17.0, green)


def test_a_host_driver_who_drives_on_at_red_is_warned() -> None:
    warned = seen(east(14.0, 60.0), north(14.0, 60.0), RED_EAST)

    first = next(alarm for alarm in warned if alarm.level is Level.WARNING)
    left_m = 60.0 - 14.0 * first.stamp_s - STOP_LINE_M - 2.4
    assert left_m >= 14.0**2 / (2.0 * 8.0), "enough to stop at the line, braking hard"


def test_a_host_driver_who_may_still_stop_at_red_is_not_warned() -> None:
    assert worst(seen(east(14.0, 90.0), north(14.0, 90.0), RED_EAST, 1.5)) is Level.NONE


def test_a_signal_of_others_changes_nothing() -> None:
    class Elsewhere(Lights):
        @override
        def red_light_m(self, vehicle: PerceivedObject, /) -> float | None:
            return 500.0 if math.hypot(*vehicle.state[2:]) < 1.0 else None

    with_signal = seen(east(14.0, 60.0), north(14.0, 60.0), Elsewhere())
    without = seen(east(14.0, 60.0), north(14.0, 60.0), NO_SIGNALS)
    assert with_signal == without != []
