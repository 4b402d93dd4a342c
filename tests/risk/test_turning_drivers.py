"""Drivers who pull out from a stop, and who turn left across oncoming traffic."""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from onboard.kinematics.heading import Heading
from onboard.kinematics.units import KM_H
from onboard.messages.bsm import BasicSafetyMessage
from onboard.messages.bsm_core import CoreData
from onboard.messages.bsm_safety import ExteriorLights, VehicleSafetyExtensions
from onboard.observations import Side, Speed, TurnSignal, YawRate
from onboard.risk.alarm import Alarm, Level
from onboard.risk.ima import IMA, LTA
from onboard.risk.left_turn import begun_turn_radius_m, left_turn_crossing, left_turn_radius_m
from onboard.risk.monitor import RiskMonitor
from onboard.risk.settings import RiskSettings
from onboard.tracking.perceived_object import ObjectSource, PerceivedObject

Motion = Callable[[float], tuple[float, float, float, float]]
"""Position east and north, course from east, and speed at a time."""
OTHER = "0a0b0c0d"
NORTH = math.pi / 2.0


def perceived(name: str, at: tuple[float, float, float, float], now: float) -> PerceivedObject:
    x_m, y_m, course_rad, speed_m_s = at
    velocity = speed_m_s * math.cos(course_rad), speed_m_s * math.sin(course_rad)
    rows = tuple(map(tuple, np.diag([0.5, 0.5, 0.25, 0.25]).tolist()))
    source = ObjectSource.HOST if name == "own" else ObjectSource.BSM
    return PerceivedObject(now, name, source, (x_m, y_m, *velocity), rows, 0.1, frozenset())


def warnings(
    mine: Motion,
    others: Motion,
    until_s: float,
    sides: tuple[Side, ...] = (),
    other_lights: ExteriorLights | None = None,
    *,
    has_yaw_rate: bool = False,
) -> list[Alarm]:
    """Of a host whose turn signals `sides` are on."""
    monitor = RiskMonitor(RiskSettings(), 5.0, 1.75)
    seen: list[Alarm] = []
    for k in range(round(until_s * 10)):
        now = k / 10
        own, other = mine(now), others(now)
        floor_m_s = math.floor(own[3] / KM_H) * KM_H
        monitor.host.receive_observation(Speed(now, floor_m_s, KM_H, "obd:7E8"))
        if has_yaw_rate:
            left_rad_s = (own[2] - mine(now - 0.02)[2]) / 0.02
            monitor.host.receive_observation(YawRate(now, -left_rad_s, "can"))
        core = CoreData(1, bytes.fromhex(OTHER), heading_rad=NORTH - other[2])
        safety = None if other_lights is None else VehicleSafetyExtensions(lights=other_lights)
        monitor.receive_bsm(BasicSafetyMessage(core, safety), now)
        for side in sides:
            monitor.host.receive_observation(TurnSignal(now, side, now % 0.8 < 0.4, "can"))
        monitor.assess(
            perceived("own", own, now),
            [perceived(OTHER, other, now)],
            now,
            heading=Heading(NORTH - own[2], 0.04),
        )
        seen += [each for each in iter(monitor.next_event, None) if isinstance(each, Alarm)]
    return [each for each in seen if each.level is Level.WARNING]


def pull_out(from_s: float) -> Motion:
    """Stands 8.5 m before the middle, and drives north with 2 m/s^2."""

    def at(now: float) -> tuple[float, float, float, float]:
        driven_s = max(now - from_s, 0.0)
        return 0.0, driven_s**2 - 8.5, NORTH, 2.0 * driven_s

    return at


def straight(meets_s: float, speed_m_s: float = 14.0, beside_m: float = 0.0) -> Motion:
    """Drives west, and passes the middle at `meets_s`."""
    return lambda now: (speed_m_s * (meets_s - now), beside_m, math.pi, speed_m_s)


def turn_left(begins_s: float, radius_m: float = 10.0, speed_m_s: float = 6.0) -> Motion:
    """Drives east, and turns left from the middle on."""

    def at(now: float) -> tuple[float, float, float, float]:
        along_m = speed_m_s * (now - begins_s)
        turned = min(max(along_m / radius_m, 0.0), NORTH)
        after_m = along_m - radius_m * turned if turned else 0.0
        east_m = min(along_m, 0.0) + radius_m * math.sin(turned)
        north_m = radius_m * (1.0 - math.cos(turned)) + after_m
        return east_m, north_m, turned, speed_m_s

    return at


def test_a_driver_who_pulls_out_is_warned_as_soon_as_the_speed_shows_it() -> None:
    """The fronts touch 2.3 s after the host sets off."""
    (warning,) = warnings(pull_out(2.0), straight(4.4), 4.3)

    assert warning.cause == IMA
    assert warning.stamp_s <= 2.0 + 0.7


def test_who_pulls_out_before_the_host_is_warned_of_soon() -> None:
    (warning,) = warnings(straight(4.4), pull_out(2.0), 4.3)

    assert warning.stamp_s <= 2.0 + 0.9


@pytest.mark.parametrize("meets_s", [1.0, 9.0])
def test_who_pulls_out_with_room_is_not_warned(meets_s: float) -> None:
    assert warnings(pull_out(2.0), straight(meets_s), 6.0) == []


def test_a_driver_who_stands_at_the_line_is_not_warned() -> None:
    assert warnings(pull_out(99.0), straight(4.0), 6.0) == []


def test_a_left_turn_across_an_oncoming_vehicle_is_warned_of_by_its_name() -> None:
    """The circle reaches the oncoming lane 1.4 s after it begins."""
    (warning,) = warnings(turn_left(2.0), straight(4.0, beside_m=3.5), 3.6)

    assert warning.cause == LTA
    assert warning.stamp_s <= 2.0 + 0.5


def test_who_turns_left_before_the_host_is_warned_of() -> None:
    (warning,) = warnings(straight(4.0, beside_m=3.5), turn_left(2.0), 3.6)

    assert warning.cause == IMA
    assert warning.stamp_s <= 2.0 + 0.5


def test_with_its_signal_a_left_turn_is_warned_of_earlier() -> None:
    turning, oncoming = turn_left(2.0), straight(4.0, beside_m=3.5)
    (without,) = warnings(turning, oncoming, 3.6)
    (signalled,) = warnings(turning, oncoming, 3.6, ("left",))

    assert signalled.cause == LTA
    assert signalled.stamp_s <= without.stamp_s - 0.1
    (hazard,) = warnings(turning, oncoming, 3.6, ("left", "right"))
    assert hazard.stamp_s == without.stamp_s


def test_with_the_signal_of_who_turns_left_before_the_host_it_is_warned_of_earlier() -> None:
    turning, oncoming = turn_left(2.0), straight(4.0, beside_m=3.5)
    (without,) = warnings(oncoming, turning, 3.6)
    left = ExteriorLights.LEFT_TURN_SIGNAL
    (signalled,) = warnings(oncoming, turning, 3.6, other_lights=left)

    assert signalled.stamp_s <= without.stamp_s - 0.1


@pytest.mark.parametrize("meets_s", np.arange(1.0, 5.0, 0.5))
@pytest.mark.parametrize("radius_m", [80.0, 300.0, 1e6])
def test_a_turn_signal_left_on_raises_none(radius_m: float, meets_s: float) -> None:
    """On a straight road, and in bends."""

    def oncoming(now: float) -> tuple[float, float, float, float]:
        inner_m, turned = radius_m - 3.5, 9.0 * (meets_s - now) / radius_m
        x_m, y_m = inner_m * math.sin(turned), radius_m - inner_m * math.cos(turned)
        return x_m, y_m, turned + math.pi, 9.0

    bend = turn_left(-1.0, radius_m, 8.0)
    lights = ExteriorLights.LEFT_TURN_SIGNAL
    assert warnings(bend, oncoming, 5.0, ("left",), lights) == []


@pytest.mark.parametrize("meets_s", [1.5, 8.0])
@pytest.mark.parametrize("sides", [(), ("left",)])
def test_a_left_turn_with_room_is_not_warned_of(meets_s: float, sides: tuple[Side, ...]) -> None:
    assert warnings(turn_left(2.0), straight(meets_s, beside_m=3.5), 6.0, sides) == []


def slow_and_turn_left(begins_s: float, radius_m: float, speed_m_s: float) -> Motion:
    """As `turn_left`, after braking with 2 m/s^2."""
    turns = turn_left(begins_s, radius_m, speed_m_s)

    def at(now: float) -> tuple[float, float, float, float]:
        left_s = max(begins_s - now, 0.0)
        east_m, north_m, course_rad, _ = turns(max(now, begins_s))
        before_m = (speed_m_s + left_s) * left_s
        return east_m - before_m, north_m, course_rad, speed_m_s + 2.0 * left_s

    return at


@pytest.mark.parametrize("meets_s", [6.9, 7.2, 7.5])
def test_who_brakes_for_a_left_turn_does_not_brake_on_in_it(meets_s: float) -> None:
    """The oncoming vehicle comes 1 s and more after the turn has left its lane."""
    turning, oncoming = slow_and_turn_left(2.5, 11.0, 5.0), straight(meets_s, 15.0, 3.5)

    assert warnings(turning, oncoming, 6.5, ("left",), has_yaw_rate=True) == []


def test_who_turns_left_slowly_is_warned_while_braking_gently_is_still_enough() -> None:
    """At 10 km/h a driver stops within 2 m. The conflict zone is 6 m, or 2.2 s, ahead."""
    turning, oncoming = turn_left(1.0, 14.0, 10.0 * KM_H), straight(4.0, 14.0, 3.5)

    (warning,) = warnings(turning, oncoming, 4.0, ("left",), has_yaw_rate=True)
    assert warning.stamp_s <= 1.3


@pytest.mark.parametrize("turned", [0.0, 0.5])
def test_a_left_turn_crosses_where_its_circle_does(turned: float) -> None:
    radius_m, lane_m = 10.0, 3.5
    meets = math.acos(1.0 - lane_m / radius_m)
    x_m, y_m = radius_m * math.sin(turned), radius_m * (1.0 - math.cos(turned))
    turning = perceived("own", (x_m, y_m, turned, 6.0), 0.0)
    oncoming = perceived(OTHER, (40.0, lane_m, math.pi, 14.0), 0.0)

    crossing = left_turn_crossing(turning, oncoming, radius_m)

    assert crossing is not None
    other_m = 40.0 - radius_m * math.sin(meets)
    assert crossing.mean == pytest.approx([radius_m * (meets - turned), 6.0, other_m, 14.0])
    assert crossing.angle_rad == pytest.approx(math.pi - meets)


@pytest.mark.parametrize("beside_m", [-3.5, 25.0])
def test_a_circle_that_does_not_reach_the_line_crosses_nothing(beside_m: float) -> None:
    turning = perceived("own", (0.0, 0.0, 0.0, 6.0), 0.0)

    assert (
        left_turn_crossing(turning, perceived(OTHER, (40.0, beside_m, math.pi, 14.0), 0.0), 10.0)
        is None
    )


@pytest.mark.parametrize("beside_m", [-4.0, 4.0])
def test_the_vehicle_in_the_next_lane_is_not_oncoming(beside_m: float) -> None:
    """On a dense crossing, noise looked like a turn, and each was warned of the one beside it."""
    turning = perceived("own", (0.0, 0.0, NORTH, 11.5), 0.0)
    beside = perceived(OTHER, (beside_m, -1.0, NORTH, 11.5), 0.0)
    assert left_turn_crossing(turning, beside, 20.0) is None


def test_the_turn_of_a_track_is_unknown() -> None:
    seen = replace(perceived(OTHER, (0.0, 0.0, NORTH, 8.0), 0.0), source=ObjectSource.SENSOR)
    assert left_turn_radius_m(seen, 4.0) is None
    assert left_turn_radius_m(perceived(OTHER, (0.0, 0.0, NORTH, 8.0), 0.0), 4.0) == 16.0


def test_a_slow_turn_has_begun_once_the_yaw_rate_shows_it_and_the_signal_is_on() -> None:
    turns, sways = YawRate(0.0, -0.1, "can"), YawRate(0.0, -0.03, "can")

    assert begun_turn_radius_m(4.0, turns, signals=True) == 15.0, "it has only begun"
    turns_round = YawRate(0.0, -0.3, "can")
    assert begun_turn_radius_m(2.7, turns_round, signals=True) == pytest.approx(9.0)
    assert begun_turn_radius_m(1.2, turns_round, signals=True) is None, "it sets off"
    assert begun_turn_radius_m(4.0, turns, signals=False) is None
    assert begun_turn_radius_m(8.0, turns, signals=True) is None, "a bend of 80 m"
    assert begun_turn_radius_m(4.0, sways, signals=True) is None
    assert begun_turn_radius_m(4.0, None, signals=True) is None
