"""Scenes of a crossing and of a lane: alarms, their causes, and cases without any."""

import math
from collections.abc import Callable, Iterable
from dataclasses import replace

import numpy as np
import pytest

from onboard.kinematics.units import KM_H
from onboard.lcca.events import WarningLevel, WarningOver
from onboard.messages.bsm import BasicSafetyMessage
from onboard.messages.bsm_core import CoreData, VehicleSize
from onboard.messages.bsm_safety import VehicleEventFlags, VehicleSafetyExtensions
from onboard.observations import (
    BrakeCause,
    Discarded,
    Lead,
    LeadIdentity,
    Position,
    Speed,
    TurnSignal,
)
from onboard.risk.alarm import RELEASE_S, Alarm, Cause, Level
from onboard.risk.braking_ahead import BRAKING_AHEAD
from onboard.risk.bsw import BSW
from onboard.risk.eebl import EEBL
from onboard.risk.fcw import FCW
from onboard.risk.ima import IMA
from onboard.risk.lcca_warning import LCCA
from onboard.risk.lcw import LCW
from onboard.risk.monitor import RiskMonitor
from onboard.risk.raised_alarms import MOST_VEHICLES
from onboard.risk.settings import RiskSettings
from onboard.trace.trace_line import as_line
from onboard.tracking.evidence import measurement_id
from onboard.tracking.perceived_object import ObjectSource, PerceivedObject
from tests.risk.lcca_warnings import lcca_warning
from tests.typed import about

OTHER_ID = bytes.fromhex("0a0b0c0d")
State = tuple[float, float, float, float]
Drive = Callable[[float], State]


def monitor() -> RiskMonitor:
    return RiskMonitor(RiskSettings(), 4.8, 1.8)


def known(
    state: State,
    now: float,
    source: ObjectSource = ObjectSource.BSM,
    *,
    sigma_m: float = 0.5,
    age_s: float = 0.05,
    name: str = OTHER_ID.hex(),
) -> PerceivedObject:
    rows = tuple(map(tuple, np.diag([sigma_m**2, sigma_m**2, 0.25, 0.25]).tolist()))
    provenance = (
        frozenset({measurement_id(b"seen", 1)}) if source is ObjectSource.SHARED else frozenset()
    )
    return PerceivedObject(now, name, source, state, rows, age_s, provenance)


def own(state: State, now: float) -> PerceivedObject:
    return known(state, now, ObjectSource.HOST, name="own")


def bsm(
    height_m: float | None = None, *, brakes_hard: bool = False, size: VehicleSize | None = None
) -> BasicSafetyMessage:
    core = CoreData(
        1, OTHER_ID, elevation_m=height_m, size=size or VehicleSize(width_m=1.8, length_m=4.5)
    )
    events = VehicleEventFlags.HARD_BRAKING if brakes_hard else None
    return BasicSafetyMessage(core, VehicleSafetyExtensions(events=events) if events else None)


def alarms(of: RiskMonitor) -> list[Alarm]:
    events = iter(of.next_event, None)
    return [event for event in events if isinstance(event, Alarm)]


def east(speed_m_s: float, distance_m: float) -> Drive:
    """Towards the origin from the west."""
    return lambda t: (speed_m_s * t - distance_m, 0.0, speed_m_s, 0.0)


def north(speed_m_s: float, distance_m: float) -> Drive:
    """Towards the origin from the south."""
    return lambda t: (0.0, speed_m_s * t - distance_m, 0.0, speed_m_s)


def drive(of: RiskMonitor, mine: Drive, other: Drive, until_s: float, **how: object) -> list[Alarm]:
    """Both drive on for `until_s`; judged at 10 Hz."""
    for k in range(round(until_s * 10)):
        now = k / 10
        of.assess(own(mine(now), now), [known(other(now), now, **how)], now)  # type: ignore[arg-type]
    return alarms(of)


def bend(speed_m_s: float, radius_m: float, meets_s: float) -> Drive:
    """Round the origin, to the left if `radius_m` is positive; northmost at `meets_s`."""

    def at(t: float) -> State:
        angle = math.pi / 2 + speed_m_s * (t - meets_s) / radius_m
        across, up = abs(radius_m) * math.cos(angle), abs(radius_m) * math.sin(angle)
        turned = math.copysign(speed_m_s, radius_m)
        return across, up, -turned * math.sin(angle), turned * math.cos(angle)

    return at


def worst(seen: Iterable[Alarm]) -> Level:
    return max((alarm.level for alarm in seen), key=lambda level: level.rank, default=Level.NONE)


def test_a_car_that_runs_the_light_is_warned_of_in_time_to_brake() -> None:
    seen = drive(monitor(), east(14.0, 60.0), north(14.0, 60.0), 4.2)

    warning = next(alarm for alarm in seen if alarm.level is Level.WARNING)
    assert warning.cause == IMA
    left_m = 60.0 - 14.0 * warning.stamp_s - 3.3
    assert left_m > 14.0**2 / (2 * 8.0)  # Braking at the warning stands before the other's path.


def test_a_car_that_only_a_third_car_sees_is_warned_of_and_named_so() -> None:
    """The MVS case: without radio, only shared by others, with the covariance of several looks."""
    seen = drive(
        monitor(), east(14.0, 60.0), north(14.0, 60.0), 4.2,
        source=ObjectSource.SHARED, sigma_m=1.0, age_s=0.3,
    )  # fmt: skip

    warning = next(alarm for alarm in seen if alarm.level is Level.WARNING)
    assert [(each.what, each.name, each.age_s) for each in warning.reasons] == [
        ("perceived_object:shared", OTHER_ID.hex(), 0.3)
    ]


def test_a_car_that_comes_out_of_the_side_road_of_a_t_junction() -> None:
    seen = drive(monitor(), east(13.0, 50.0), north(6.0, 50.0 * 6 / 13), 3.8)

    assert worst(seen) is Level.WARNING


@pytest.mark.parametrize(
    ("radius_m", "speed_m_s"), [(75.0, 14.0), (150.0, 20.0), (300.0, 25.0), (300.0, 30.0)]
)
def test_who_comes_towards_us_in_a_bend_is_not_taken_to_drive_into_us(
    radius_m: float, speed_m_s: float
) -> None:
    """Each in its own lane; their courses cross between them, as far from the one as the other."""
    inner, outer = bend(speed_m_s, radius_m - 1.75, 5.0), bend(speed_m_s, -radius_m - 1.75, 5.0)

    assert worst(drive(monitor(), inner, outer, 5.0)) is not Level.WARNING
    assert worst(drive(monitor(), outer, inner, 5.0)) is not Level.WARNING


def test_one_lost_beacon_in_two_still_warns() -> None:
    of, mine, other = monitor(), east(14.0, 60.0), north(14.0, 60.0)
    for k in range(42):
        now, heard_at = k / 10, (k // 2) / 5
        state, age_s = other(heard_at), now - heard_at + 0.05
        ahead = (state[0], state[1] + age_s * state[3], state[2], state[3])
        of.assess(own(mine(now), now), [known(ahead, now, age_s=age_s)], now)

    assert worst(alarms(of)) is Level.WARNING


def test_a_car_that_stops_in_time_raises_no_warning() -> None:
    """From 12 m/s with 2.5 m/s^2 to 5 m before the crossing."""

    def stopping(t: float) -> State:
        t = min(t, 4.8)
        return (0.0, -5.0 - 28.8 + 12.0 * t - 1.25 * t * t, 0.0, 12.0 - 2.5 * t)

    seen = drive(monitor(), east(12.0, 60.0), stopping, 6.0, sigma_m=0.5)

    assert worst(seen).rank < Level.WARNING.rank


def stopping(from_s: float, braking_m_s2: float) -> Drive:
    """Like `east(14.0, 60.0)` until the driver brakes."""

    def at(t: float) -> State:
        braked_s = min(max(t - from_s, 0.0), 14.0 / braking_m_s2)
        covered_m = 14.0 * (min(t, from_s) + braked_s) - braking_m_s2 * braked_s**2 / 2
        return covered_m - 60.0, 0.0, 14.0 - braking_m_s2 * braked_s, 0.0

    return at


@pytest.mark.parametrize("braking_m_s2", [3.0, 5.0, 8.0])
def test_a_driver_who_brakes_for_crossing_traffic_is_not_warned(
    braking_m_s2: float,
) -> None:
    """The host driver's braking is in P_C. The other drives on."""
    seen = drive(monitor(), stopping(1.0, braking_m_s2), north(14.0, 60.0), 5.5)

    assert worst(seen) is not Level.WARNING


@pytest.mark.parametrize("braking_m_s2", [5.0, 8.0])
def test_an_ima_warning_ends_once_the_driver_brakes_enough(braking_m_s2: float) -> None:
    seen = drive(monitor(), stopping(2.0, braking_m_s2), north(14.0, 60.0), 5.5)

    warned, *_, ended = seen
    assert (warned.level, ended.level) == (Level.WARNING, Level.NONE)
    assert ended.stamp_s <= 2.0 + 0.4 + RELEASE_S


@pytest.mark.parametrize("beside_m", [-3.5, 3.5, 12.0])
@pytest.mark.parametrize("speed_m_s", [-14.0, 10.0, 14.0])
def test_parallel_roads(beside_m: float, speed_m_s: float) -> None:
    seen = drive(
        monitor(), east(14.0, 60.0), lambda t: (speed_m_s * t, beside_m, speed_m_s, 0.0), 6.0
    )

    assert seen == []


@pytest.mark.parametrize(("height_m", "warned"), [(6.5, False), (-6.5, False), (0.5, True)])
def test_a_bridge_over_the_road(height_m: float, warned: bool) -> None:
    of = monitor()
    of.receive_event(Position(0.0, 47.0, 8.0, 400.0, 1.0, 14.0, 1.57), 0.0)
    of.receive_bsm(bsm(400.0 + height_m), 0.0)

    seen = drive(of, east(14.0, 50.0), north(14.0, 50.0), 3.4)

    assert (worst(seen) is Level.WARNING) == warned


@pytest.mark.parametrize(("height_m", "raised"), [(5.0, True), (-5.0, True), (9.0, False)])
@pytest.mark.parametrize(
    ("cause", "place", "speed_m_s"),
    [
        (FCW, (40.0, 0.0), 0.0),
        (EEBL, (40.0, 0.0), 14.0),
        (BRAKING_AHEAD, (180.0, 0.0), 14.0),
        (BSW, (-6.0, 3.5), 14.0),
        (LCW, (-20.0, 3.5), 24.0),
    ],
)
def test_a_road_above_the_road(
    cause: Cause, place: tuple[float, float], speed_m_s: float, height_m: float, raised: bool
) -> None:
    """Two receivers' heights can be metres apart: of one's own way, that makes no other road."""
    of = monitor()
    of.host.receive_observation(Speed(0.0, 14.0, KM_H, "obd:7E8"))
    of.host.receive_observation(TurnSignal(0.0, "left", is_on=True, source="can"))
    of.receive_event(Position(0.0, 47.0, 8.0, 400.0, 1.0, 14.0, 1.57), 0.0)
    message = bsm(400.0 + height_m, brakes_hard=True)
    placed = replace(message.core, latitude_deg=47.0, longitude_deg=8.0)
    of.receive_bsm(replace(message, core=placed), 0.0)

    def other(t: float) -> State:
        return place[0] + speed_m_s * t, place[1], speed_m_s, 0.0

    seen = drive(of, east(14.0, 0.0), other, 0.5)

    assert (cause in {alarm.cause for alarm in seen}) == raised


def test_the_own_echo_raises_nothing() -> None:
    of, mine = monitor(), east(14.0, 20.0)
    for k in range(20):
        now = k / 10
        state = mine(now)
        echo = known((state[0], state[1], 0.0, 14.0), now, name="own")
        itself = known((state[0], state[1], 0.0, 14.0), now, ObjectSource.HOST, name="before")
        of.assess(own(state, now), [echo, itself], now)

    assert alarms(of) == []


def test_without_a_position_nothing_is_claimed_of_crossings_or_of_braking_by_radio() -> None:
    of = monitor()
    of.receive_bsm(bsm(brakes_hard=True), 0.0)
    for k in range(10):
        of.assess(None, [known((0.0, -9.0, 0.0, 14.0), k / 10)], k / 10)

    assert of.next_event() is None


def test_data_older_than_a_second_raises_nothing() -> None:
    assert drive(monitor(), east(14.0, 60.0), north(14.0, 60.0), 4.2, age_s=1.1) == []


def test_an_invalid_covariance_is_reported_and_raises_nothing() -> None:
    of = monitor()
    rows = ((1.0, 5.0, 0.0, 0.0), (5.0, 1.0, 0.0, 0.0), (0.0, 0.0, 1.0, 0.0), (0.0, 0.0, 0.0, 1.0))
    odd = PerceivedObject(
        0.0, "b", ObjectSource.SHARED, (0.0, -9.0, 0.0, 14.0), rows, 0.1, frozenset()
    )

    of.assess(own((-9.0, 0.0, 14.0, 0.0), 0.0), [odd], 0.0)

    event = of.next_event()
    assert isinstance(event, Discarded)
    assert (event.component, event.reason) == ("risk", "covariance")
    assert of.next_event() is None


def test_of_a_hundred_cars_the_worst_raise_alarms_the_most_urgent_first() -> None:
    of = monitor()
    cars = [known((0.0, -14.0 - k, 0.0, 14.0), 0.0, name=f"{k:08x}") for k in range(100)]

    of.assess(own((-14.0, 0.0, 14.0, 0.0), 0.0), cars, 0.0)

    seen = alarms(of)
    assert [alarm.vehicle for alarm in seen] == [f"{k:08x}" for k in range(MOST_VEHICLES)]
    assert all(alarm.reasons[0].name == alarm.vehicle for alarm in seen)


def test_a_second_threat_is_not_hidden_behind_the_first() -> None:
    """The first, from the right, brakes at the last moment; the second comes from the left."""
    of, mine = monitor(), east(14.0, 60.0)
    for k in range(42):
        now = k / 10
        braked_s = max(now - 2.4, 0.0)
        first = (0.0, 14.0 * now - 60.0 - 4.0 * braked_s**2, 0.0, max(14.0 - 8.0 * braked_s, 0.0))
        second = (2.0, 62.0 - 14.0 * now, 0.0, -14.0)
        of.assess(own(mine(now), now), [known(first, now), known(second, now, name="ff")], now)

    seen = alarms(of)
    warned = [alarm for alarm in seen if alarm.level is Level.WARNING]
    assert {alarm.vehicle for alarm in warned} == {OTHER_ID.hex(), "ff"}
    (ended,) = (alarm for alarm in seen if alarm.level is Level.NONE)
    assert ended.vehicle == OTHER_ID.hex()


@pytest.mark.parametrize(
    ("place", "speed_m_s", "level"),
    [
        ((40.0, 0.0), 15.0, Level.CAUTION),
        ((15.0, 0.5), 15.0, Level.WARNING),
        ((40.0, 3.5), 15.0, Level.NONE),
        ((-40.0, 0.0), 15.0, Level.NONE),
        ((40.0, 0.0), -15.0, Level.NONE),
        ((200.0, 0.0), 15.0, Level.NONE),
    ],
    ids=["ahead", "near", "next lane", "behind", "oncoming", "far"],
)
def test_hard_braking_reported_by_radio(
    place: tuple[float, float], speed_m_s: float, level: Level
) -> None:
    of = monitor()
    of.receive_bsm(bsm(brakes_hard=True), 9.9)

    of.assess(own((0.0, 0.0, 16.0, 0.0), 10.0), [known((*place, speed_m_s, 0.0), 10.0)], 10.0)

    seen = [alarm for alarm in alarms(of) if alarm.cause == EEBL]
    assert worst(seen) is level
    if seen:
        assert seen[0].reasons[0].what == "bsm"
        assert seen[0].reasons[0].age_s == pytest.approx(0.1)


@pytest.mark.parametrize(
    ("said_m_s2", "level"),
    [(None, Level.CAUTION), (-2.0, Level.CAUTION), (-8.0, Level.WARNING)],
)
def test_a_reported_deceleration_above_that_of_the_flag_is_used(
    said_m_s2: float | None, level: Level
) -> None:
    of = monitor()
    of.receive_bsm(bsm(brakes_hard=True), 9.9)
    ahead = replace(known((27.0, 0.0, 16.0, 0.0), 10.0), acceleration_m_s2=said_m_s2)

    of.assess(own((0.0, 0.0, 16.0, 0.0), 10.0), [ahead], 10.0)

    assert worst(alarms(of)) is level


def test_a_hard_braking_flag_grows_old_and_its_alarm_ends() -> None:
    of = monitor()
    of.receive_bsm(bsm(brakes_hard=True), 0.0)
    for k in range(40):
        of.assess(own((0.0, 0.0, 16.0, 0.0), k / 10), [known((15.0, 0, 15.0, 0), k / 10)], k / 10)

    first, last = alarms(of)
    assert first.level is Level.WARNING
    assert (last.level, last.stamp_s) == (Level.NONE, about(2.0, 0.11))


def test_the_groups_warning_is_passed_on_at_once_and_lasts_until_it_is_over() -> None:
    of = monitor()
    origin = bytes(range(8))
    of.receive_event(lcca_warning(5.0, origin), 5.0)
    (raised,) = alarms(of)
    for k in range(51, 150):
        of.assess(None, [], k / 10)
    assert (raised.cause, raised.level, raised.stamp_s) == (LCCA, Level.WARNING, 5.0)
    assert (raised.reasons[0].name, raised.reasons[0].age_s) == (origin.hex(), 0.02)
    assert alarms(of) == []

    of.receive_event(WarningOver(15.0, origin, 7, "over"), 15.0)
    for k in range(151, 170):
        of.assess(None, [], k / 10)
    (ended,) = alarms(of)
    assert (ended.level, ended.stamp_s) == (Level.NONE, about(16.0, 0.11))


@pytest.mark.parametrize(
    ("speed_m_s", "cause", "is_warned"),
    [
        (1.9, BrakeCause.DECELERATION, False),
        (1.9, BrakeCause.TEST, True),
        (2.1, BrakeCause.DECELERATION, True),
    ],
)
def test_who_stands_is_warned_by_the_group_only_for_a_test(
    speed_m_s: float, cause: BrakeCause, *, is_warned: bool
) -> None:
    of = monitor()
    of.host.receive_observation(Speed(5.0, speed_m_s, 0.1, "obd"))
    of.receive_event(replace(lcca_warning(5.0, b"car-aaaa"), cause=cause), 5.0)

    assert bool(alarms(of)) is is_warned


def test_two_warnings_are_one_alarm_that_lasts_until_both_are_over() -> None:
    of = monitor()
    one, other = bytes(8), bytes(range(8))
    of.receive_event(lcca_warning(5.0, one), 5.0)
    of.receive_event(lcca_warning(5.1, other), 5.1)
    of.receive_event(WarningLevel(5.2, other, 7, BrakeCause.ABS, 9.0), 5.2)
    of.receive_event(WarningOver(6.0, one, 7, "over"), 6.0)
    for k in range(61, 100):
        of.assess(None, [], k / 10)

    (raised,) = alarms(of)
    assert raised.value == 6.0
    of.receive_event(WarningOver(10.0, other, 7, "expired"), 10.0)
    of.assess(None, [], 11.1)
    assert [each.level for each in alarms(of)] == [Level.NONE]


def test_a_change_of_a_warning_that_was_not_raised_has_no_effect() -> None:
    of = monitor()
    of.receive_event(WarningLevel(5.0, bytes(8), 7, BrakeCause.ABS, 9.0), 5.0)
    of.receive_event(WarningOver(5.0, bytes(8), 7, "over"), 5.0)
    assert alarms(of) == []


def test_an_alarm_can_be_written_to_the_trace() -> None:
    of = monitor()
    of.host.receive_observation(Speed(0.0, 20.0, KM_H, "obd:7E8"))
    for now in (0.0, 0.05):
        lead = Lead(now, LeadIdentity.UNKNOWN, gap_m=1.0, closing_speed_m_s=15.0)
        of.receive_event(lead, now)

    (alarm,) = alarms(of)
    line = as_line(alarm)
    assert '"cause":"fcw"' in line
    assert math.isfinite(alarm.value)


@pytest.mark.parametrize(
    ("speed_age_s", "lead_age_s", "speed_m_s", "raised"),
    [
        (0.0, 0.0, 20.0, 1),
        (1.2, 0.0, 20.0, 0),
        (0.0, 0.6, 20.0, 0),
        (0.0, 0.0, 1.0, 0),
        (-60.0, 0.0, 20.0, 0),
        (0.0, -60.0, 20.0, 0),
    ],
    ids=["good", "old speed", "old sight", "hardly moves", "speed to come", "sight to come"],
)
def test_a_gap_without_fresh_speed_or_sight_or_motion_raises_nothing(
    speed_age_s: float, lead_age_s: float, speed_m_s: float, raised: int
) -> None:
    of = monitor()
    for now in (5.0, 5.05):
        of.host.receive_observation(Speed(now - speed_age_s, speed_m_s, KM_H, "obd:7E8"))
        of.receive_event(
            Lead(now - lead_age_s, LeadIdentity.UNKNOWN, gap_m=3.0, closing_speed_m_s=2.0), now
        )
    of.assess(None, [], 5.05)

    assert len(alarms(of)) == raised
