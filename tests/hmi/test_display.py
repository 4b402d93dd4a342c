"""Views of the driver's page from events of the stack, without clock and browser."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from onboard.brake_request.brake_requester import BrakeRequest
from onboard.hmi.display import SHOW_S, Display
from onboard.hmi.driver_view import BrakeRequestView, Direction, DriverView
from onboard.lcca.events import (
    Identified,
    IdentityLost,
    Inquired,
    WarningLevel,
    WarningRaised,
)
from onboard.lcca.group import WarningGroup
from onboard.lcca.identification import CarIdentity
from onboard.lcca.parameters import GroupParameters
from onboard.lcca.transitions import GroupState
from onboard.messages.lcca import Join
from onboard.observations import (
    BrakeCause,
    DetectionList,
    Impairment,
    Lead,
    LeadIdentity,
    Sensor,
    SensorImpaired,
    SensorLost,
    SensorRecovered,
    Speed,
    VehicleDetection,
)
from onboard.recorder.records import RecorderState
from onboard.risk.alarm import Alarm, AlarmReason, Cause, Level
from onboard.risk.eebl import EEBL
from onboard.risk.fcw import FCW
from onboard.risk.ima import IMA
from onboard.risk.lcca_warning import LCCA
from onboard.trace.file_failure import FileFailure, FileUse
from onboard.trace.trace_line import as_record
from onboard.tracking.perceived_object import ObjectSource, PerceivedObject

HOST = bytes.fromhex("00112233445566aa")
OTHER = bytes.fromhex("ffeeddccbbaa9988")


def display(**more: Any) -> Display:
    given: dict[str, Any] = {
        "sensors": (Sensor.SPEED, Sensor.CAMERA),
        "speed_timeout_s": 0.8,
        "lead_timeout_s": 0.8,
        "safe_headway_s": 1.98,
        "length_m": 4.5,
    }
    return Display(**(given | more))


def no_group() -> WarningGroup:
    return WarningGroup(GroupParameters(), HOST, np.random.default_rng(1))


def shown(
    on: Display, now: float, group: WarningGroup | None = None, identity: CarIdentity | None = None
) -> DriverView:
    view = on.view_to_show(group or no_group(), identity, now)
    assert view is not None
    return view


def speed(now: float, speed_m_s: float = 20.0) -> Speed:
    return Speed(now, speed_m_s, 0.28, "obd:7E8")


def lead(now: float, gap_m: float = 14.0, text: str = "RD288HX") -> Lead:
    return Lead(now, LeadIdentity.KNOWN, text, gap_m, 0.3, 1.0, 0.3)


def perceived(east_m: float, north_m: float, source: ObjectSource, **more: Any) -> PerceivedObject:
    given: dict[str, Any] = {
        "stamp_s": 0.0,
        "name": "7",
        "state": (east_m, north_m, 0.0, 20.0),
        "covariance": ((0.0,) * 4,) * 4,
        "age_s": 0.1,
        "provenance": frozenset(),
    }
    return PerceivedObject(source=source, **(given | more))


def alarm(now: float, cause: Cause, level: Level, name: str = "7") -> Alarm:
    return Alarm(now, cause, level, 6.0, (AlarmReason("perceived_object", name, 0.1),))


def test_the_first_view_is_empty() -> None:
    view = shown(display(), 0.0)

    assert (view.speed_m_s, view.lead, view.vehicles, view.alarms) == (None, None, (), ())
    assert view.group.state is GroupState.REGULAR
    assert view.group.group_number == 1
    assert not any(sensor.is_lost for sensor in view.sensors)
    assert not view.brake_button


def test_a_view_is_due_five_times_a_second() -> None:
    page = display()
    shown(page, 10.0)

    assert page.view_to_show(no_group(), None, 10.0 + 0.9 * SHOW_S) is None
    shown(page, 10.0 + SHOW_S)


@pytest.mark.parametrize(
    "event",
    [
        alarm(10.01, LCCA, Level.WARNING),
        SensorLost(10.01, Sensor.CAMERA, 0.8, "silent"),
        SensorRecovered(10.01, Sensor.CAMERA),
        Identified(10.01, 3, OTHER, "RD288HX", 0.9995, "answer"),
        IdentityLost(10.01, 3, OTHER, "refuted"),
    ],
)
def test_an_urgent_event_is_shown_at_once(event: Any) -> None:
    page = display()
    shown(page, 10.0)

    page.receive_event(event)

    shown(page, 10.01)


def test_the_safety_distance_is_that_of_the_host_vehicle_s_speed() -> None:
    page = display()
    page.receive_event(speed(10.0, 15.0))
    page.receive_event(lead(10.0))

    view = shown(page, 10.0).lead

    assert view is not None
    assert (view.plate, view.gap_m, view.closing_speed_m_s) == ("RD288HX", 14.0, 1.0)
    assert view.safe_gap_m == pytest.approx(0.55 * 54.0)  # 0.55 m for each km/h


def test_the_plate_of_a_lead_that_was_asked_for_is_shown_once_answered() -> None:
    page = display()
    page.receive_event(Lead(10.0, LeadIdentity.UNKNOWN, None, 20.0, track_id=3))
    page.receive_event(Inquired(10.0, 3, names=5))

    asked = shown(page, 10.0).lead
    answered = shown(page, 10.3, identity=CarIdentity(OTHER, "RD288HX")).lead
    by_motion = shown(page, 10.6, identity=CarIdentity(OTHER, None)).lead

    assert asked is not None
    assert (asked.identity, asked.plate) == (LeadIdentity.UNKNOWN, None)
    assert (asked.names_asked, asked.is_answered) == (5, False)
    assert answered is not None
    assert (answered.identity, answered.plate) == (LeadIdentity.KNOWN, "RD288HX")
    assert (answered.names_asked, answered.is_answered) == (5, True)
    assert by_motion is not None
    assert (by_motion.identity, by_motion.plate) == (LeadIdentity.KNOWN, None)


def test_an_inquiry_about_another_vehicle_is_not_shown() -> None:
    page = display()
    page.receive_event(Inquired(9.9, 3, names=5))
    page.receive_event(Lead(10.0, LeadIdentity.UNKNOWN, None, 20.0, track_id=4))

    view = shown(page, 10.0).lead

    assert view is not None
    assert view.names_asked is None


def test_old_values_are_not_shown() -> None:
    page = display()
    page.receive_event(speed(10.0))
    page.receive_event(lead(10.3))

    view = shown(page, 10.9)
    assert view.speed_m_s is None
    assert view.lead is not None
    assert view.lead.safe_gap_m is None
    assert shown(page, 11.2).lead is None


def test_no_lead_an_unread_plate_and_a_lost_camera_are_distinguished() -> None:
    page = display()
    page.receive_event(Lead(10.0, LeadIdentity.NO_LEAD))
    no_lead = shown(page, 10.0).lead
    page.receive_event(Lead(10.5, LeadIdentity.UNKNOWN, None, 20.0))
    unread = shown(page, 10.5).lead
    page.receive_event(SensorLost(10.6, Sensor.CAMERA, 0.1, "frozen"))

    assert no_lead is not None
    assert unread is not None
    assert (no_lead.identity, no_lead.gap_m) == (LeadIdentity.NO_LEAD, None)
    assert (unread.identity, unread.plate, unread.gap_m) == (LeadIdentity.UNKNOWN, None, 20.0)
    assert shown(page, 10.6).lead is None


def test_without_a_position_the_detections_of_the_last_frame_are_shown() -> None:
    page = display()
    page.receive_event(Lead(10.0, LeadIdentity.NO_LEAD))
    first, second = (
        VehicleDetection(10.0, number, 20.0 + number, 1.0, 0.0, 0.01) for number in (1, 2)
    )
    page.receive_event(DetectionList(10.0, (first, second)))
    both = shown(page, 10.0).vehicles
    page.receive_event(DetectionList(10.3, (second,)))

    assert len(both) == 2
    assert len(shown(page, 10.3).vehicles) == 1


def test_what_impairs_a_sensor_is_shown_until_nothing_does() -> None:
    page = display()
    page.receive_event(SensorImpaired(10.0, Sensor.CAMERA, (Impairment.DIRTY,)))
    shown_then = {each.sensor: each.impairments for each in shown(page, 10.0).sensors}
    page.receive_event(SensorImpaired(10.1, Sensor.CAMERA, ()))

    assert shown_then == {Sensor.CAMERA: (Impairment.DIRTY,), Sensor.SPEED: ()}
    assert not any(each.impairments for each in shown(page, 10.1).sensors)


def test_a_lost_sensor_is_shown_with_its_reason_until_it_recovers() -> None:
    page = display()
    page.receive_event(SensorLost(10.0, Sensor.CAMERA, 0.8, "frozen"))
    lost = {each.sensor: (each.is_lost, each.reason) for each in shown(page, 10.0).sensors}
    page.receive_event(SensorRecovered(11.0, Sensor.CAMERA))

    assert lost == {Sensor.CAMERA: (True, "frozen"), Sensor.SPEED: (False, None)}
    assert not any(each.is_lost for each in shown(page, 11.0).sensors)


def test_a_failed_recorder_is_shown_with_its_reason_until_it_records() -> None:
    page = display()
    assert shown(page, 10.0).recorder_failure is None
    page.receive_event(RecorderState(10.01, is_recording=False, reason="disk full", dropped=3))
    assert shown(page, 10.01).recorder_failure == "disk full"
    page.receive_event(RecorderState(10.02, is_recording=True, reason="", dropped=3))
    assert shown(page, 10.02).recorder_failure is None


def test_a_file_that_cannot_be_written_is_shown_with_its_reason() -> None:
    page = display()
    assert shown(page, 10.0).failed_files == ()
    failure = FileFailure(10.01, FileUse.TRACE, "/var/log/trace.jsonl: Read-only file system")
    page.receive_event(failure)

    assert shown(page, 10.01).failed_files == (failure,)


def test_an_alarm_is_shown_until_it_ends_with_the_time_of_its_level() -> None:
    page = display()
    page.receive_event(alarm(10.0, FCW, Level.CAUTION))
    page.receive_event(alarm(10.5, FCW, Level.WARNING))
    (alarm_view,) = shown(page, 12.0).alarms
    page.receive_event(Alarm(13.0, FCW, Level.NONE, 0.0, ()))

    assert (alarm_view.level, alarm_view.raised_at_s, alarm_view.direction) == (
        Level.WARNING,
        10.5,
        Direction.AHEAD,
    )
    assert shown(page, 13.0).alarms == ()


def test_alarms_are_sorted_by_level_and_then_by_age() -> None:
    page = display()
    page.receive_event(alarm(10.0, LCCA, Level.WARNING))
    page.receive_event(alarm(11.0, FCW, Level.CAUTION))
    page.receive_event(alarm(12.0, EEBL, Level.WARNING))

    assert [each.cause for each in shown(page, 12.0).alarms] == [
        EEBL,
        LCCA,
        FCW,
    ]


def test_an_lcca_alarm_states_how_many_vehicles_ahead_it_began() -> None:
    page = display()
    page.receive_event(
        WarningRaised(
            stamp_s=10.0,
            origin_id=OTHER,
            sequence=1,
            origin_number=2,
            group_number=5,
            leader_id=OTHER,
            cause=BrakeCause.DECELERATION,
            deceleration_m_s2=6.0,
            age_s=0.01,
            hops=1,
        )
    )
    page.receive_event(alarm(10.0, LCCA, Level.WARNING, OTHER.hex()))

    assert shown(page, 10.0).alarms[0].vehicles_ahead == 3


def test_an_alarm_by_the_button_is_a_test_until_a_real_braking_takes_its_place() -> None:
    page = display()
    page.receive_event(
        WarningRaised(10.0, OTHER, 1, 1, 2, OTHER, BrakeCause.TEST, 3.9, 0.01, hops=1)
    )
    page.receive_event(alarm(10.0, LCCA, Level.WARNING, OTHER.hex()))
    (tested,) = shown(page, 10.0).alarms

    page.receive_event(WarningLevel(10.5, OTHER, 1, BrakeCause.DECELERATION, 7.0))
    (real,) = shown(page, 11.0).alarms

    assert (tested.is_test, tested.raised_at_s) == (True, 10.0)
    assert (real.is_test, real.raised_at_s) == (False, 10.5)


@pytest.mark.parametrize(
    ("east_m", "direction"), [(30.0, Direction.RIGHT), (-30.0, Direction.LEFT)]
)
def test_an_ima_alarm_states_the_side_of_the_vehicle(east_m: float, direction: Direction) -> None:
    page = display()
    page.receive_surroundings(
        perceived(0.0, 0.0, ObjectSource.HOST, name="host"),
        [
            perceived(-east_m, 5.0, ObjectSource.BSM, name="8"),
            perceived(east_m, 40.0, ObjectSource.BSM),
        ],
    )
    page.receive_event(alarm(10.0, IMA, Level.WARNING, "7"))

    assert shown(page, 10.0).alarms[0].direction is direction


def test_the_object_of_an_alarm_is_marked_until_the_alarm_ends() -> None:
    page = display()
    page.receive_surroundings(
        perceived(0.0, 0.0, ObjectSource.HOST, name="host"),
        [
            perceived(-20.0, 5.0, ObjectSource.BSM, name="8"),
            perceived(30.0, 40.0, ObjectSource.SHARED),
        ],
    )
    page.receive_event(alarm(10.0, IMA, Level.CAUTION, "7"))
    marked = [each.source for each in shown(page, 10.0).vehicles if each.in_alarm]
    page.receive_event(Alarm(11.0, IMA, Level.NONE, 0.0, ()))

    assert marked == [ObjectSource.SHARED]
    assert not any(each.in_alarm for each in shown(page, 11.0).vehicles)


def test_two_vehicles_from_two_sides_are_two_alarms_the_later_first() -> None:
    page = display()
    page.receive_surroundings(
        perceived(0.0, 0.0, ObjectSource.HOST, name="host"),
        [
            perceived(-30.0, 5.0, ObjectSource.BSM, name="8"),
            perceived(30.0, 40.0, ObjectSource.BSM),
        ],
    )
    for stamp_s, name in ((10.0, "7"), (10.5, "8")):
        raised = alarm(stamp_s, IMA, Level.WARNING, name)
        page.receive_event(replace(raised, vehicle=name))
    both = shown(page, 11.0)
    page.receive_event(Alarm(11.5, IMA, Level.NONE, 0.0, (), "7"))

    assert [each.direction for each in both.alarms] == [Direction.LEFT, Direction.RIGHT]
    assert sum(each.in_alarm for each in both.vehicles) == 2
    assert [each.direction for each in shown(page, 12.0).alarms] == [Direction.LEFT]


def test_an_ima_alarm_without_its_object_points_ahead() -> None:
    page = display()
    page.receive_event(alarm(10.0, IMA, Level.WARNING))

    assert shown(page, 10.0).alarms[0].direction is Direction.AHEAD


def test_the_lead_vehicle_is_shown_once() -> None:
    page = display()
    page.receive_event(lead(10.0, gap_m=14.0))
    page.receive_surroundings(
        perceived(0.0, 0.0, ObjectSource.HOST, name="host"),
        [perceived(0.3, 18.0, ObjectSource.BSM), perceived(3.5, 19.0, ObjectSource.SHARED)],
    )

    (other,) = shown(page, 10.0).vehicles
    assert (other.source, other.ahead_m, other.right_m) == (ObjectSource.SHARED, 19.0, 3.5)


def test_without_a_position_the_map_shows_the_camera_s_last_frame() -> None:
    page = display()
    page.receive_event(lead(10.0, gap_m=14.0))
    for stamp_s in (9.9, 10.0):
        page.receive_event(VehicleDetection(stamp_s, 1, 14.0, 0.3, 0.0, 0.01))
        page.receive_event(VehicleDetection(stamp_s, 2, 20.0, 0.3, 0.2, 0.01))

    (other,) = shown(page, 10.0).vehicles
    assert other.source is ObjectSource.SENSOR
    assert other.right_m == pytest.approx(20.0 * np.sin(0.2))
    assert shown(page, 11.0).vehicles == ()


def test_followers_are_counted() -> None:
    group = no_group()
    group.receive_message(
        Join(
            OTHER,
            OTHER,
            1,
            to_id=HOST,
            sequence=1,
            acknowledged_origin_id=bytes(8),
            acknowledged_sequence=0,
        ),
        10.0,
    )

    status = shown(display(), 10.0, group).group
    assert status.state is GroupState.LEADER
    assert (status.group_number, status.follower_count) == (1, 1)
    assert status.leader_id == HOST.hex()[:4]


def test_a_view_converts_to_json() -> None:
    page = display(brake_button=True)
    page.receive_event(speed(10.0))
    page.receive_event(lead(10.0))
    page.receive_event(alarm(10.0, LCCA, Level.WARNING))

    record = as_record(shown(page, 10.0))

    assert record["kind"] == "driver_view"
    assert record["group"]["state"] == "regular"
    assert record["lead"]["identity"] == "known"
    assert record["alarms"][0]["level"] == "warning"
    assert record["brake_button"] is True


def test_a_request_to_brake_is_shown_while_it_is_valid() -> None:
    page = display()
    page.receive_event(BrakeRequest(10.0, 5.2, 0.9, 0.3, 0, (FCW,)))

    assert shown(page, 10.0).brake_request == BrakeRequestView(5.2, 0.9)
    assert shown(page, 10.31).brake_request is None

    page.receive_event(BrakeRequest(10.4, 5.2, 0.9, 0.3, 1, (FCW,)))
    page.receive_event(BrakeRequest(10.5, 0.0, 0.0, 0.0, 2, ()))
    assert shown(page, 10.55).brake_request is None
