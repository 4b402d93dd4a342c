"""FCW of vehicles ahead that are known by radio, own sensors or others."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pytest

from onboard.kinematics.units import KM_H
from onboard.observations import Lead, LeadIdentity, Speed
from onboard.risk.alarm import Alarm, AlarmReason, Level
from onboard.risk.fcw import FCW
from onboard.risk.monitor import RiskMonitor
from onboard.risk.path_ahead import PathAhead
from onboard.risk.settings import RiskSettings
from onboard.tracking.perceived_object import ObjectSource, PerceivedObject
from tests.risk.bends import Road, as_object, noisy_fix

SPEED_M_S = 15.0
HALF_LENGTHS_M = (4.8 + 5.0) / 2.0
SOURCES = (ObjectSource.BSM, ObjectSource.SENSOR, ObjectSource.SHARED)
Motion = Callable[[float], tuple[float, float]]
"""Time in s -> (gap in m, speed in m/s)."""


def vehicle(
    gap_m: float,
    speed_m_s: float,
    now: float,
    *,
    source: ObjectSource = ObjectSource.SENSOR,
    left_m: float = 0.0,
    sigma_m_s: float = 0.2,
    acceleration_m_s2: float | None = None,
    name: str = "lead",
) -> PerceivedObject:
    rows = tuple(map(tuple, np.diag([0.25, 0.25, sigma_m_s**2, sigma_m_s**2]).tolist()))
    state = (gap_m + HALF_LENGTHS_M, left_m, speed_m_s, 0.0)
    return PerceivedObject(
        now, name, source, state, rows, 0.0, frozenset(), acceleration_m_s2, tracked_for_s=5.0
    )


def own(now: float, speed_m_s: float = SPEED_M_S) -> PerceivedObject:
    middle = vehicle(-HALF_LENGTHS_M, speed_m_s, now, name="own")
    return replace(middle, source=ObjectSource.HOST)


def drive(
    seen: Callable[[float], Sequence[PerceivedObject]],
    until_s: float = 1.0,
    camera: Motion | None = None,
) -> list[Alarm]:
    """Assessed at 10 Hz; the camera's images at 20 Hz."""
    monitor = RiskMonitor(RiskSettings(), 4.8, 1.8)
    for step in range(round(until_s * 20)):
        now = step / 20
        monitor.host.receive_observation(Speed(now, SPEED_M_S, KM_H, "obd:7E8"))
        if camera is not None:
            gap_m, speed_m_s = camera(now)
            monitor.receive_event(
                Lead(now, LeadIdentity.UNKNOWN, None, gap_m, 0.3, SPEED_M_S - speed_m_s, 0.5), now
            )
        if step % 2 == 0:
            monitor.assess(own(now), seen(now), now)
    return fcw_alarms(monitor)


def fcw_alarms(monitor: RiskMonitor) -> list[Alarm]:
    events = iter(monitor.next_event, None)
    return [event for event in events if isinstance(event, Alarm) and event.cause == FCW]


def is_warned(seen: Callable[[float], Sequence[PerceivedObject]], until_s: float = 1.0) -> bool:
    return any(alarm.level is Level.WARNING for alarm in drive(seen, until_s))


@pytest.mark.parametrize("source", SOURCES)
def test_a_standing_vehicle_ahead_is_warned_of_by_any_source(source: ObjectSource) -> None:
    alarms = drive(lambda now: [vehicle(30.0 - SPEED_M_S * now, 0.0, now, source=source)])

    assert alarms[0].level is Level.WARNING
    assert alarms[0].stamp_s <= 0.1
    assert alarms[0].reasons[0].what == f"perceived_object:{source.value}"
    assert alarms[0].reasons[0].name == "lead"


@pytest.mark.parametrize("source", SOURCES)
def test_hard_braking_close_ahead_is_warned_of_within_0_4_s(source: ObjectSource) -> None:
    """With speeds as radar or radio give them: gap of 10 m, 6 m/s^2 from 0.5 s on."""

    def braking(now: float) -> Sequence[PerceivedObject]:
        for_s = max(now - 0.5, 0.0)
        gap_m = 10.0 - 3.0 * for_s**2
        return [vehicle(gap_m, SPEED_M_S - 6.0 * for_s, now, source=source)]

    first = next(alarm for alarm in drive(braking, 1.5) if alarm.level is Level.WARNING)
    assert 0.5 < first.stamp_s <= 0.9


@pytest.mark.parametrize("left_m", [-3.5, 3.5, 1.8])
def test_a_vehicle_beside_the_path_is_not(left_m: float) -> None:
    assert not is_warned(lambda now: [vehicle(30.0 - SPEED_M_S * now, 0.0, now, left_m=left_m)])


@pytest.mark.parametrize("away_m", [0.0, 1e-188, 0.4])
def test_what_is_where_the_host_is_is_not_ahead(away_m: float) -> None:
    here = replace(own(0.0), name="other", source=ObjectSource.BSM)
    here = replace(here, state=(here.state[0] + away_m, *here.state[1:]))
    assert PathAhead().place(own(0.0), here, tuple) is None
    crawling = replace(own(0.0), state=(0.0, 0.0, 1e-190, 0.0))
    assert PathAhead().place(crawling, vehicle(20.0, 10.0, 0.0), tuple) is None


def test_a_wrong_speed_in_one_bsm_raises_no_alarm() -> None:
    """Even if it is assessed again with the camera's images until the next measurement."""

    def odd(now: float) -> Sequence[PerceivedObject]:
        speed_m_s = SPEED_M_S - (6.0 if now == 0.4 else 0.0)
        return [vehicle(12.0, speed_m_s, now, source=ObjectSource.BSM)]

    assert drive(odd, camera=lambda _: (40.0, SPEED_M_S)) == []
    assert is_warned(lambda now: [vehicle(12.0, SPEED_M_S - 6.0, now)])


def test_an_uncertain_closing_speed_is_reduced() -> None:
    assert not is_warned(lambda now: [vehicle(12.0, SPEED_M_S - 6.0, now, sigma_m_s=3.5)])


def test_a_vehicle_that_others_have_just_begun_to_tell_of_is_not_assessed() -> None:
    """A second track of the lead, as in live runs under load: 14 m, 1.3 m/s +- 2.9 m/s."""

    def warned(source: ObjectSource, until_s: float) -> bool:
        track = vehicle(14.0, 1.3, 0.0, source=source, sigma_m_s=2.9)
        seen = lambda now: [replace(track, stamp_s=now, tracked_for_s=0.1 + now)]  # noqa: E731
        return is_warned(seen, until_s)

    assert not warned(ObjectSource.SHARED, 0.9)
    assert warned(ObjectSource.SHARED, 1.2)
    assert warned(ObjectSource.SENSOR, 0.9)


def test_the_braking_that_a_remote_vehicle_reports_counts() -> None:
    def reporting(said_m_s2: float) -> Callable[[float], Sequence[PerceivedObject]]:
        return lambda now: [
            vehicle(17.0, SPEED_M_S, now, source=ObjectSource.BSM, acceleration_m_s2=said_m_s2)
        ]

    assert not is_warned(reporting(0.0))
    assert is_warned(reporting(-7.0))


def test_the_cameras_lead_and_its_object_are_one_vehicle() -> None:
    """By gap and closing speed; the object is 1 m off and knows the braking."""

    def heard(now: float) -> Sequence[PerceivedObject]:
        return [vehicle(18.0, SPEED_M_S, now, source=ObjectSource.BSM, acceleration_m_s2=-7.0)]

    (raised,) = drive(heard, camera=lambda _: (17.0, SPEED_M_S))

    assert raised.level is Level.WARNING
    assert [AlarmReason(each.what, each.name, 0.0) for each in raised.reasons] == [
        AlarmReason("lead", "unknown", 0.0),
        AlarmReason("perceived_object:bsm", "lead", 0.0),
        AlarmReason("speed", "obd:7E8", 0.0),
    ]


def test_the_vehicle_ahead_of_the_lead_is_another() -> None:
    """It brakes hard, which the camera cannot see."""

    def hidden(now: float) -> Sequence[PerceivedObject]:
        lead, ahead = (
            vehicle(gap_m, SPEED_M_S, now, source=ObjectSource.BSM, name=name)
            for gap_m, name in ((16.0, "lead"), (19.0 + 5.0, "ahead"))
        )
        return [lead, replace(ahead, acceleration_m_s2=-9.0)]

    alarms = drive(hidden, camera=lambda _: (16.0, SPEED_M_S))
    assert [alarm.reasons[0].name for alarm in alarms] == ["ahead"]


def test_without_a_position_the_cameras_lead_is_still_assessed() -> None:
    monitor = RiskMonitor(RiskSettings(), 4.8, 1.8)
    for step in range(4):
        now = step / 20
        monitor.host.receive_observation(Speed(now, SPEED_M_S, KM_H, "obd:7E8"))
        monitor.receive_event(Lead(now, LeadIdentity.UNKNOWN, None, 20.0, 0.3, SPEED_M_S, 0.5), now)
        monitor.assess(None, [], now)

    assert monitor.next_event() is not None


@pytest.mark.parametrize("left_m", [-3.5, pytest.param(3.5, marks=pytest.mark.long)])
def test_a_standing_queue_in_the_lane_beside_raises_none(left_m: float) -> None:
    """The receiver's course scatters, and with it the predicted path."""
    road, began_m_s, braking_m_s2, queue_m = Road(lambda _: 0.0), 12.0, 2.0, 45.0
    for seed in range(40):
        rng, monitor = np.random.default_rng(seed), RiskMonitor(RiskSettings(), 4.8, 1.8)
        for step in range(45):
            now = step / 10
            speed_m_s = began_m_s - braking_m_s2 * now
            way_m = (began_m_s + speed_m_s) / 2.0 * now
            fix = noisy_fix(road.at(way_m, 0.0), speed_m_s, now, rng)
            monitor.receive_event(fix, now)
            monitor.host.receive_observation(Speed(now, speed_m_s, KM_H, "obd:7E8"))
            host = as_object(fix, "own", ObjectSource.HOST)
            queue = [
                replace(
                    vehicle(0.0, 0.0, now, name=str(place_m)),
                    state=(queue_m + place_m, left_m + 0.3 * rng.normal(), 0.3 * rng.normal(), 0.0),
                )
                for place_m in (0.0, 7.0)
            ]
            monitor.assess(host, queue, now)
        assert all(alarm.level is not Level.WARNING for alarm in fcw_alarms(monitor)), seed


@pytest.mark.parametrize("source", SOURCES)
def test_who_brakes_enough_within_the_error_of_the_gap_is_not_warned(source: ObjectSource) -> None:
    """Behind a queue, as in the dense crossing: 9.6 m/s, 25 m, and 1.8 of 1.84 m/s^2 needed."""

    def warned(braking_m_s2: float) -> bool:
        monitor = RiskMonitor(RiskSettings(), 4.8, 1.8)
        for step in range(15):
            now = step / 10
            after_s = now - 1.1
            speed_m_s = 9.6 - braking_m_s2 * after_s
            gap_m = 25.0 - (9.6 + speed_m_s) / 2.0 * after_s
            monitor.host.receive_observation(Speed(now, speed_m_s, 0.02, "study"))
            queue = vehicle(gap_m, 0.0, now, source=source, sigma_m_s=0.4)
            monitor.assess(own(now, speed_m_s), [queue], now)
        return any(alarm.level is Level.WARNING for alarm in fcw_alarms(monitor))

    assert not warned(1.8)
    assert warned(1.2)
