"""Whole vehicles on a lossless channel: from observations to the other vehicle's warning."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

from onboard.bsm_transmission.transmitter import BsmTransmitter
from onboard.kinematics.units import KM_H
from onboard.messages import bsm
from onboard.messages.bit_io import BitWriter
from onboard.messages.bsm import BasicSafetyMessage
from onboard.messages.bsm_core import CoreData
from onboard.observations import (
    DetectionList,
    Discarded,
    HardBrake,
    Position,
    Sensor,
    SensorLost,
    SensorRecovered,
    Speed,
    VehicleDetection,
)
from onboard.security import ieee1609dot2, oer
from onboard.settings import parse_settings
from onboard.step import BrakeButton, Input, ReceivedWsm, SentWsm
from onboard.tools.decode.describe import describe
from onboard.trace.trace_line import Event, as_record
from onboard.tracking.perceived_object import PerceivedObject
from onboard.vehicle.config import CarConfig
from onboard.vehicle.stack import Stack
from onboard.vehicle.surroundings import ASSESSMENT_INTERVAL_S, Surroundings
from onboard.wave_udp import psid, wsmp
from onboard.wave_udp.wsmp import WaveShortMessage
from tests.vehicle.platoon import Platoon, car


def test_the_brake_button_of_the_first_warns_the_second_and_third_and_not_itself() -> None:
    platoon = Platoon({plate: car(plate) for plate in ("AAA1", "BBB2", "CCC3")})
    platoon.drive(3.0)

    platoon.receive("AAA1", BrakeButton(platoon.now))
    platoon.drive(0.3)

    warned = {
        plate: [as_record(event) for event in platoon.events_of(plate, "warning")]
        for plate in platoon.cars
    }
    assert [len(warned[plate]) for plate in platoon.cars] == [0, 1, 1]
    assert warned["CCC3"][0]["group_number"] == 3
    assert warned["CCC3"][0]["origin_number"] == 1


def test_a_warning_leaves_before_the_bsm_that_reports_the_same_braking_is_composed(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    platoon = Platoon({plate: car(plate) for plate in ("AAA1", "BBB2")})
    platoon.drive(3.0)
    order: list[str] = []
    compose = BsmTransmitter.bsm

    def composing(*arguments: Any) -> BasicSafetyMessage:
        order.append("bsm")
        return compose(*arguments)

    monkeypatch.setattr(BsmTransmitter, "bsm", composing)
    given: list[SentWsm] = []

    def send(wsm: SentWsm) -> None:
        order.append("sent")
        given.append(wsm)

    brake = HardBrake(platoon.now + 0.01, 6.0, source="obd")
    outputs = platoon.cars["AAA1"].step([brake], platoon.now + 0.01, send=send)

    assert order == ["sent", "bsm"]
    assert given == outputs.wsms
    assert wsmp.decode(given[0].data).psid == psid.LCCA


def test_a_warning_leaves_before_the_surroundings_are_assessed_in_the_same_step(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Of a hundred vehicles that takes milliseconds."""
    platoon = Platoon({plate: car(plate) for plate in ("AAA1", "BBB2")})
    platoon.drive(3.0)
    order: list[str] = []
    assess = Surroundings.assess

    def assessing(*arguments: Any) -> Sequence[PerceivedObject]:
        order.append("assessed")
        return assess(*arguments)

    monkeypatch.setattr(Surroundings, "assess", assessing)
    due_at = platoon.now + 2.0 * ASSESSMENT_INTERVAL_S

    brake = HardBrake(due_at, 6.0, source="obd")
    platoon.cars["AAA1"].step([brake], due_at, send=lambda _wsm: order.append("sent"))

    assert order[:2] == ["sent", "assessed"]


def test_no_plate_is_ever_on_the_air() -> None:
    platoon = Platoon({plate: car(plate) for plate in ("AAA1", "BBB2")})
    platoon.drive(2.0)

    assert platoon.on_air
    assert not any(plate.encode() in wsm for plate in platoon.cars for wsm in platoon.on_air)


def test_a_group_persists_when_all_ids_change() -> None:
    platoon = Platoon({plate: car(plate, epoch_s=10.0) for plate in ("AAA1", "BBB2")})
    leaders = set()
    for _ in range(5):
        platoon.drive(5.0)
        leaders.add(platoon.cars["BBB2"].group.leader_id)

    transitions = [as_record(event) for event in platoon.events_of("BBB2", "transition")]
    assert [record["state"] for record in transitions] == ["member"]
    assert len(leaders) == 3, "the ID changes twice"

    platoon.receive("AAA1", BrakeButton(platoon.now))
    platoon.drive(0.3)
    assert len(list(platoon.events_of("BBB2", "warning"))) == 1


@pytest.mark.parametrize(
    ("datagram", "component"),
    [(b"", "wsmp"), (b"\x03", "wsmp"), (b"garbage from a port scanner", "wsmp")],
)
def test_malformed_frames_are_discarded_and_the_vehicle_drives_on(
    datagram: bytes, component: str
) -> None:
    platoon = Platoon({plate: car(plate) for plate in ("AAA1", "BBB2")})
    platoon.receive("BBB2", ReceivedWsm(0.0, datagram))
    platoon.drive(2.0)

    first = next(platoon.events_of("BBB2", "discarded"))
    assert as_record(first)["component"] == component
    assert next(platoon.events_of("BBB2", "transition"), None) is not None


@pytest.mark.parametrize(
    ("service", "payload", "discarded"),
    [
        (psid.BSM, b"?", "bsm too_short"),
        (psid.SENSOR_SHARING, b"?", "sdsm too_short"),
        (psid.MAP, b"\x00\x13\x01\x00", "map not_a_map"),
        (psid.SPAT, b"\x00\x13", "spat too_short"),
        (psid.LCCA, b"?", "lcca too_short"),
    ],
)
def test_bytes_that_are_no_message_are_discarded_under_their_service(
    service: int, payload: bytes, discarded: str
) -> None:
    wsm = wsmp.encode(WaveShortMessage(service, ieee1609dot2.encode_unsecured(payload)))
    assert _received(car("AAA1"), wsm) == [discarded]


def test_a_number_too_long_to_be_printed_is_discarded_from_whomever_it_comes() -> None:
    """Python refuses to print 4,300 digits, which 1,800 bytes have; frames have up to 2,302."""
    to_be_signed = ieee1609dot2.encode_to_be_signed(b"", psid.BSM, 1)
    certificates = b"\x81" + oer.octets(b"\x01" * 1800)
    signed = b"\x03\x81\x00" + to_be_signed + certificates
    events = _received(car("AAA1"), wsmp.encode(WaveShortMessage(psid.BSM, signed)))
    assert events == ["security unsupported"]


def test_event_flags_of_any_number_are_a_bsm() -> None:
    flags = BitWriter()
    flags.put(0b0_1000_1, 6)
    flags.put_length(16_383)
    flags.put((1 << 16_383) - 1, 16_383)
    part = bsm.OtherPart(0, flags.finish())
    message = bsm.BasicSafetyMessage(CoreData(1, b"abcd"), other_parts=(part,))
    payload = ieee1609dot2.encode_unsecured(bsm.encode(message))
    assert _received(car("AAA1"), wsmp.encode(WaveShortMessage(psid.BSM, payload))) == []


def _received(vehicle: Stack, wsm: bytes) -> list[str]:
    """Return why a vehicle discards a frame."""
    events = vehicle.step([ReceivedWsm(0.0, wsm)], 0.0).events
    return [f"{each.component} {each.reason}" for each in events if isinstance(each, Discarded)]


def test_a_vehicle_without_samples_reports_its_lost_sensors() -> None:
    stack = car("AAA1")
    now = stack.get_timer()
    events: list[Event] = []
    while now < 1.0:
        outputs = stack.step((), now)
        events += outputs.events
        now = max(outputs.timer_at, now + 1e-6)
    lost = [event for event in events if isinstance(event, SensorLost)]

    assert {event.sensor for event in lost} == {Sensor.SPEED, Sensor.CAMERA}


def test_a_speed_that_freezes_while_the_receiver_moves_on_is_lost_until_it_changes() -> None:
    stack, events = car("AAA1"), []
    for step in range(60):
        now = step / 10
        bus_m_s = 14.0 if now < 4.0 else 5.0
        seen: list[Input] = [
            Position(now, 48.0, 11.0, None, 1.0, 14.0 if now < 1.0 else 5.0, 0.0),
            Speed(now, bus_m_s, KM_H, "obd:7E8"),
        ]
        events += stack.step(seen, now).events
    used_s = [event.stamp_s for event in events if isinstance(event, Speed)]
    changes = [
        (type(event), event.stamp_s, getattr(event, "reason", ""))
        for event in events
        if isinstance(event, SensorLost | SensorRecovered) and event.sensor is Sensor.SPEED
    ]

    assert changes == [(SensorLost, 2.0, "frozen"), (SensorRecovered, 4.0, "")]
    assert not any(2.0 <= at_s < 4.0 for at_s in used_s)


@pytest.mark.parametrize("step", [1, -1])
def test_sensors_lost_at_one_time_are_reported_in_a_fixed_order(step: int) -> None:
    """The order of a set differs between processes, and a replay must give the same events."""
    sensors = [Sensor.SPEED, Sensor.CAMERA, Sensor.POSITION]
    config = parse_settings({"car": {"plate": "AAA1"}}, CarConfig, "test")
    stack = Stack(config, sensors[::step], np.random.default_rng(1), now=0.0, utc_s=0.0)
    events = stack.step((), 60.0).events
    lost = [event.sensor for event in events if isinstance(event, SensorLost)]

    assert lost == sensors


def test_the_radio_is_lost_on_errors_of_its_wire_and_not_on_silence() -> None:
    tree = {
        "car": {"plate": "AAA1"},
        "radio": {"endpoint": "iwcu", "listen_port": 1, "unit_port": 2},
    }
    config = parse_settings(tree, CarConfig, "test")
    stack = Stack(config, config.sensors(), np.random.default_rng(1), now=0.0, utc_s=0.0)
    events: list[Event] = []
    for now in np.arange(0.0, 20.0, 0.1).tolist():
        inputs: list[Input] = []
        if now == pytest.approx(5.0):
            inputs.append(SensorLost(now, Sensor.RADIO, None, "no route"))
        if now == pytest.approx(9.0):
            inputs.append(SensorRecovered(now, Sensor.RADIO))
        events += stack.step(inputs, now).events

    changes = [event for event in events if isinstance(event, SensorLost | SensorRecovered)]
    assert [(type(event), event.sensor) for event in changes] == [
        (SensorLost, Sensor.RADIO),
        (SensorRecovered, Sensor.RADIO),
    ]
    assert [event.stamp_s for event in changes] == pytest.approx([5.0, 9.0])


def test_a_stopped_vehicle_sends_the_heading_at_which_it_arrived() -> None:
    tree = {"car": {"plate": "AAA1"}, "gnss": {}}
    config = parse_settings(tree, CarConfig, "test")
    stack = Stack(config, config.sensors(), np.random.default_rng(1), now=0.0, utc_s=0.0)
    sent = []
    for k in range(30):
        now, is_driving = k / 10, k < 10
        course_rad = 2.0 if is_driving else float(k) % 6.0
        fix = Position(now, 48.1, 11.5, None, 0.5, 10.0 if is_driving else 0.1, course_rad)
        for wsm in stack.step([fix], now).wsms:
            frame = describe(wsm.data).get("messageframe", {"basic_safety_message": None})
            sent.append(frame["basic_safety_message"])

    headings = [each["core"]["heading_rad"] for each in sent if each is not None]
    assert len(headings) > 20
    assert headings == pytest.approx([2.0] * len(headings), abs=0.001)


def test_with_a_detector_only_its_detections_are_shared_and_not_those_by_plates() -> None:
    tree = {"car": {"plate": "AAA1"}, "gnss": {}, "detector": {}}
    config = parse_settings(tree, CarConfig, "test")
    stack = Stack(config, config.sensors(), np.random.default_rng(1), now=0.0, utc_s=0.0)
    for k in range(20):
        now = k / 10
        inputs: list[Input] = [
            Position(now, 48.1, 11.5, None, 0.5, 10.0, 0.0),
            VehicleDetection(now, 1, 50.0, 0.5, 0.4, 0.01),
            DetectionList(now, (VehicleDetection(now, 1, 20.0, 0.5, 0.0, 0.01),)),
        ]
        stack.step(inputs, now)

    own, (known,) = stack.surroundings
    assert own is not None
    assert known.state[1] - own.state[1] == pytest.approx(22.2, abs=0.5)


def test_a_detector_with_empty_lists_is_present_and_a_silent_one_is_lost() -> None:
    tree = {"car": {"plate": "AAA1"}, "detector": {}}
    config = parse_settings(tree, CarConfig, "test")
    stack = Stack(config, config.sensors(), np.random.default_rng(1), now=0.0, utc_s=0.0)
    events: list[Event] = []
    for now in np.arange(0.0, 6.0, 0.1).tolist():
        inputs = [] if 2.0 < now < 4.0 else [DetectionList(now, ())]
        events += stack.step(inputs, now).events

    changes = [event for event in events if isinstance(event, SensorLost | SensorRecovered)]
    assert [(type(event), event.sensor) for event in changes] == [
        (SensorLost, Sensor.DETECTOR),
        (SensorRecovered, Sensor.DETECTOR),
    ]
