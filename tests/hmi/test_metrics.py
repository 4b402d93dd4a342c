"""Metrics, as Prometheus' own parser reads them."""

import math

from prometheus_client.parser import text_string_to_metric_families

from onboard.hmi.metrics import Metrics
from onboard.lcca.events import Transition
from onboard.lcca.transitions import GroupEvent, GroupState
from onboard.messages.exchanged import MessageReceived, MessageSent
from onboard.observations import (
    Discarded,
    Lead,
    LeadIdentity,
    Sensor,
    SensorLost,
    SensorRecovered,
    Speed,
)
from onboard.recorder.build import Build
from onboard.risk.alarm import Alarm, Level
from onboard.risk.ima import IMA
from onboard.risk.lcca_warning import LCCA

BUILD = Build("0.2.0", "4f463bb4b", "20261124")


def read(metrics: Metrics) -> dict[str, float]:
    text = metrics.exposition()[0].decode()
    return {
        " ".join([sample.name, *(f"{k}={v}" for k, v in sorted(sample.labels.items()))]): (
            sample.value
        )
        for family in text_string_to_metric_families(text)
        for sample in family.samples
    }


def test_the_build_is_a_metric_with_labels() -> None:
    (build,) = (name for name in read(Metrics(frozenset(), BUILD)) if "build_info" in name)

    assert build == (
        "onboard_build_info commit=4f463bb4b date=20261124 is_modified=false version=0.2.0"
    )


def test_events_are_counted() -> None:
    metrics = Metrics(frozenset({Sensor.CAMERA}), BUILD)
    for event in (
        Discarded(1.0, "lcca", "duplicate"),
        Discarded(1.1, "lcca", "duplicate"),
        Discarded(1.2, "security", "wrong_signature"),
        MessageSent(1.3, "warn", 7, 200, {}),
        MessageReceived(1.4, "join", None, {}),
        Alarm(1.5, LCCA, Level.WARNING, 6.0, ()),
        SensorLost(1.6, Sensor.CAMERA, 0.8, "frozen"),
        Transition(
            1.7, GroupEvent.JOINED, GroupState.REGULAR, GroupState.MEMBER, bytes(8), 3, "answered"
        ),
        Lead(1.8, LeadIdentity.UNKNOWN, None, 21.5),
    ):
        metrics.receive_event(event)

    counted = read(metrics)

    assert counted["onboard_discarded_total component=lcca reason=duplicate"] == 2
    assert counted["onboard_discarded_total component=security reason=wrong_signature"] == 1
    assert counted["onboard_events_total kind=discarded"] == 3
    assert counted["onboard_messages_sent_total message=warn"] == 1
    assert counted["onboard_messages_received_total message=join"] == 1
    assert counted["onboard_alarms_total cause=lcca level=warning"] == 1
    assert counted["onboard_alarm_level cause=lcca"] == 2
    assert counted["onboard_sensor_up sensor=camera"] == 0
    assert counted["onboard_group_state state=member"] == 1
    assert counted["onboard_group_state state=regular"] == 0
    assert counted["onboard_group_number"] == 3
    assert counted["onboard_gap_metres"] == 21.5


def test_a_lost_sensor_has_no_value() -> None:
    metrics = Metrics(frozenset({Sensor.CAMERA, Sensor.SPEED}), BUILD)
    metrics.receive_event(Speed(1.0, 20.0, 0.28, "obd:7E8"))
    metrics.receive_event(Lead(1.0, LeadIdentity.UNKNOWN, None, 21.5))
    metrics.receive_event(SensorLost(2.0, Sensor.SPEED, 0.8, "silent"))
    assert math.isnan(read(metrics)["onboard_speed_metres_per_second"])
    assert read(metrics)["onboard_gap_metres"] == 21.5

    metrics.receive_event(SensorLost(2.0, Sensor.CAMERA, 0.8, "silent"))
    assert math.isnan(read(metrics)["onboard_gap_metres"])


def test_gauges_follow_the_end_of_an_alarm_and_a_recovery() -> None:
    metrics = Metrics(frozenset({Sensor.CAMERA}), BUILD)
    metrics.receive_event(Alarm(1.0, LCCA, Level.WARNING, 6.0, ()))
    metrics.receive_event(Alarm(2.0, LCCA, Level.NONE, 0.0, ()))
    metrics.receive_event(SensorLost(1.0, Sensor.CAMERA, 0.8, "frozen"))
    metrics.receive_event(SensorRecovered(2.0, Sensor.CAMERA))

    counted = read(metrics)

    assert counted["onboard_alarm_level cause=lcca"] == 0
    assert counted["onboard_alarms_total cause=lcca level=warning"] == 1
    assert counted["onboard_sensor_up sensor=camera"] == 1


def test_the_level_of_a_cause_is_that_of_its_most_urgent_vehicle() -> None:
    metrics = Metrics(frozenset(), BUILD)
    metrics.receive_event(Alarm(1.0, IMA, Level.WARNING, 0.6, (), "7"))
    metrics.receive_event(Alarm(1.0, IMA, Level.CAUTION, 0.4, (), "8"))
    both = read(metrics)["onboard_alarm_level cause=ima"]
    metrics.receive_event(Alarm(2.0, IMA, Level.NONE, 0.0, (), "7"))

    assert (both, read(metrics)["onboard_alarm_level cause=ima"]) == (2, 1)


def test_two_vehicles_in_one_process_have_separate_metrics() -> None:
    one, other = Metrics(frozenset(), BUILD), Metrics(frozenset(), BUILD)
    one.count_refusal("wrong_token")

    assert read(one)["onboard_page_refused_total reason=wrong_token"] == 1
    assert "onboard_page_refused_total reason=wrong_token" not in read(other)
