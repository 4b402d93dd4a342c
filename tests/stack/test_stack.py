"""Whole cars, joined by a wire that loses nothing: from observations to the other car's warning."""

import numpy as np
import pytest

from onboard.config import CarConfig
from onboard.observations import (
    DetectionList,
    Position,
    Sensor,
    SensorLost,
    SensorRecovered,
    VehicleDetection,
)
from onboard.settings import parse_settings
from onboard.stack import Stack
from onboard.tools.decode.describe import describe
from onboard.trace.trace_line import as_record
from tests.stack.platoon import Platoon, car


def test_the_brake_button_of_the_first_warns_the_second_and_third_and_not_itself() -> None:
    platoon = Platoon({plate: car(plate) for plate in ("AAA1", "BBB2", "CCC3")})
    platoon.drive(3.0)

    platoon.cars["AAA1"].press_brake_button(platoon.now)
    platoon.drive(0.3)

    warned = {
        plate: [as_record(event) for event in platoon.said(plate, "warning")]
        for plate in platoon.cars
    }
    assert [len(warned[plate]) for plate in platoon.cars] == [0, 1, 1]
    assert warned["CCC3"][0]["group_number"] == 3
    assert warned["CCC3"][0]["origin_number"] == 1


def test_no_plate_is_ever_on_the_air() -> None:
    platoon = Platoon({plate: car(plate) for plate in ("AAA1", "BBB2")})
    platoon.drive(2.0)

    assert platoon.on_air
    assert not any(plate.encode() in wsm for plate in platoon.cars for wsm in platoon.on_air)


def test_a_group_outlives_the_change_of_everybodys_id() -> None:
    platoon = Platoon({plate: car(plate, epoch_s=10.0) for plate in ("AAA1", "BBB2")})
    platoon.drive(25.0)

    transitions = [as_record(event) for event in platoon.said("BBB2", "transition")]
    assert all(record["state"] == "member" for record in transitions)
    assert len({record["leader_id"] for record in transitions}) > 1, "the ID did change"

    platoon.cars["AAA1"].press_brake_button(platoon.now)
    platoon.drive(0.3)
    assert len(list(platoon.said("BBB2", "warning"))) == 1


@pytest.mark.parametrize(
    ("datagram", "component"),
    [(b"", "wsmp"), (b"\x03", "wsmp"), (b"garbage from a port scanner", "wsmp")],
)
def test_garbage_from_the_radio_is_counted_and_the_car_goes_on(
    datagram: bytes, component: str
) -> None:
    platoon = Platoon({plate: car(plate) for plate in ("AAA1", "BBB2")})
    platoon.cars["BBB2"].receive_wsm(datagram, 0.0)
    platoon.drive(2.0)

    first = next(platoon.said("BBB2", "discarded"))
    assert as_record(first)["component"] == component
    assert next(platoon.said("BBB2", "transition"), None) is not None


def test_a_car_without_samples_says_which_sensors_are_lost() -> None:
    stack = car("AAA1")
    now = stack.get_timer()
    while now < 1.0:
        stack.handle_timer(now)
        stack.can_to_send(now)
        stack.wsms_to_send(now)
        now = max(stack.get_timer(), now + 1e-6)
    lost = [event for event in iter(stack.next_event, None) if isinstance(event, SensorLost)]

    assert {event.sensor for event in lost} == {Sensor.SPEED, Sensor.CAMERA}


@pytest.mark.parametrize("step", [1, -1])
def test_sensors_that_are_lost_at_once_are_told_in_one_order(step: int) -> None:
    """A set of them has another order in each process, and a replay must say the same again."""
    sensors = [Sensor.SPEED, Sensor.CAMERA, Sensor.POSITION]
    config = parse_settings({"car": {"plate": "AAA1"}}, CarConfig, "test")
    stack = Stack(config, sensors[::step], np.random.default_rng(1), now=0.0, utc_s=0.0)
    stack.handle_timer(60.0)
    lost = [event.sensor for event in iter(stack.next_event, None) if isinstance(event, SensorLost)]

    assert lost == sensors


def test_a_radio_is_lost_when_its_wire_says_so_and_never_for_being_silent() -> None:
    tree = {
        "car": {"plate": "AAA1"},
        "radio": {"endpoint": "iwcu", "listen_port": 1, "unit_port": 2},
    }
    config = parse_settings(tree, CarConfig, "test")
    stack = Stack(config, config.sensors(), np.random.default_rng(1), now=0.0, utc_s=0.0)
    said = []
    for now in np.arange(0.0, 20.0, 0.1).tolist():
        if now == pytest.approx(5.0):
            stack.receive_observation(SensorLost(now, Sensor.RADIO, None, "no route"), now)
        if now == pytest.approx(9.0):
            stack.receive_observation(SensorRecovered(now, Sensor.RADIO), now)
        stack.handle_timer(now)
        stack.wsms_to_send(now)
        said += [
            e for e in iter(stack.next_event, None) if isinstance(e, SensorLost | SensorRecovered)
        ]

    assert [(type(event), event.sensor) for event in said] == [
        (SensorLost, Sensor.RADIO),
        (SensorRecovered, Sensor.RADIO),
    ]
    assert [event.stamp_s for event in said] == pytest.approx([5.0, 9.0])


def test_a_car_that_has_stopped_tells_the_heading_at_which_it_came() -> None:
    tree = {"car": {"plate": "AAA1"}, "gnss": {}}
    config = parse_settings(tree, CarConfig, "test")
    stack = Stack(config, config.sensors(), np.random.default_rng(1), now=0.0, utc_s=0.0)
    said = []
    for k in range(30):
        now, is_driving = k / 10, k < 10
        course_rad = 2.0 if is_driving else float(k) % 6.0
        fix = Position(now, 48.1, 11.5, None, 0.5, 10.0 if is_driving else 0.1, course_rad)
        stack.receive_observation(fix, now)
        stack.handle_timer(now)
        for _, wsm in stack.wsms_to_send(now):
            frame = describe(wsm).get("messageframe", {"basic_safety_message": None})
            said.append(frame["basic_safety_message"])

    headings = [each["core"]["heading_rad"] for each in said if each is not None]
    assert len(headings) > 20
    assert headings == pytest.approx([2.0] * len(headings), abs=0.001)


def test_where_there_is_a_detector_its_cars_are_shared_and_those_by_plates_are_not() -> None:
    tree = {"car": {"plate": "AAA1"}, "gnss": {}, "detector": {}}
    config = parse_settings(tree, CarConfig, "test")
    stack = Stack(config, config.sensors(), np.random.default_rng(1), now=0.0, utc_s=0.0)
    for k in range(20):
        now = k / 10
        stack.receive_observation(Position(now, 48.1, 11.5, None, 0.5, 10.0, 0.0), now)
        stack.receive_observation(VehicleDetection(now, 1, 50.0, 0.5, 0.4, 0.01), now)
        stack.receive_observation(
            DetectionList(now, (VehicleDetection(now, 1, 20.0, 0.5, 0.0, 0.01),)), now
        )
        stack.handle_timer(now)
        stack.wsms_to_send(now)

    (known,) = stack.perceived_objects(1.9)
    own, _ = stack.surroundings
    assert own is not None
    assert known.state[1] - own.state[1] == pytest.approx(22.2, abs=0.5)


def test_a_detector_that_finds_nobody_is_there_and_one_that_says_nothing_is_lost() -> None:
    tree = {"car": {"plate": "AAA1"}, "detector": {}}
    config = parse_settings(tree, CarConfig, "test")
    stack = Stack(config, config.sensors(), np.random.default_rng(1), now=0.0, utc_s=0.0)
    said = []
    for now in np.arange(0.0, 6.0, 0.1).tolist():
        if not 2.0 < now < 4.0:
            stack.receive_observation(DetectionList(now, ()), now)
        stack.handle_timer(now)
        stack.wsms_to_send(now)
        said += [
            e for e in iter(stack.next_event, None) if isinstance(e, SensorLost | SensorRecovered)
        ]

    assert [(type(event), event.sensor) for event in said] == [
        (SensorLost, Sensor.DETECTOR),
        (SensorRecovered, Sensor.DETECTOR),
    ]
