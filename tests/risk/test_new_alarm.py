"""A new alarm is one file and one row (`toy_alarm.py`): all else reads the row."""

import json
from dataclasses import replace

import numpy as np
import pytest
from pydantic import TypeAdapter, ValidationError

from onboard.brake_request import datagram
from onboard.brake_request.brake_requester import BrakeRequest
from onboard.hmi.display import Display
from onboard.hmi.driver_view import DriverView
from onboard.hmi.metrics import Metrics
from onboard.observations import Lead, LeadIdentity, Sensor, Speed
from onboard.recorder.build import Build
from onboard.risk import alarm_table
from onboard.risk.alarm import Alarm, Level
from onboard.risk.alarm_table import Headline
from onboard.settings import parse_settings
from onboard.trace.trace_line import Event, as_line
from onboard.vehicle.config import CarConfig
from onboard.vehicle.stack import Stack
from sim_rig.scenario.expectations import Expectation
from sim_rig.scenario.expected_alarms import AlarmExpected
from tests.risk.toy_alarm import ROW, TOY
from tests.typed import a

EXPECTED = {"what": "alarm", "car": "ann", "cause": "toy", "from_s": 0.0, "by_s": 1.0}


@pytest.fixture
def _in_the_table(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(alarm_table, "ALARMS", (*alarm_table.ALARMS, ROW))


def drive() -> tuple[Stack, list[Event]]:
    """A vehicle at 30 m/s behind a lead vehicle that no other alarm is about."""
    tree = {
        "car": {"plate": "AAA1"},
        "brake_request": {},
        "security": {"plate_digest": {"scrypt_log2_n": 1}},
    }
    sensors = Sensor.SPEED, Sensor.CAMERA
    config, rng = parse_settings(tree, CarConfig, "a test"), np.random.default_rng(1)
    stack = Stack(config, sensors, rng, now=0.0, utc_s=1_700_000_100.0)
    lead = Lead(0.1, LeadIdentity.UNKNOWN, None, 90.0, 0.3, 0.0, 0.2)
    return stack, stack.step([Speed(0.1, 30.0, 0.28, "obd:7E8"), lead], 0.1).events


def shown(stack: Stack, events: list[Event]) -> DriverView:
    display = Display(
        sensors=(Sensor.SPEED,), speed_timeout_s=0.8, lead_timeout_s=0.8, safe_headway_s=1.98,
        length_m=4.5,
    )  # fmt: skip
    for event in events:
        display.receive_event(event)
    view = display.view_to_show(stack.group, None, 0.1)
    assert view is not None
    return view


def test_without_its_row_nothing_is_raised() -> None:
    _, events = drive()

    assert not any(isinstance(event, Alarm | BrakeRequest) for event in events)


@pytest.mark.usefixtures("_in_the_table")
def test_it_reaches_the_trace() -> None:
    _, events = drive()

    (line,) = [as_line(event) for event in events if isinstance(event, Alarm)]
    assert json.loads(line) == {
        "stamp_s": 0.1, "kind": "alarm", "cause": "toy", "level": "warning", "value": 4.0,
        "reasons": [{"what": "lead", "name": "unknown", "age_s": 0.0}], "vehicle": "",
    }  # fmt: skip


@pytest.mark.usefixtures("_in_the_table")
def test_it_reaches_the_driver_s_page_with_its_words() -> None:
    (alarm,) = json.loads(as_line(shown(*drive())))["alarms"]

    words = alarm["cause"], alarm["headline"], alarm["sign"], alarm["sentence"]
    assert words == ("toy", Headline.BRAKE, "brake", "You drive fast behind a car")


@pytest.mark.usefixtures("_in_the_table")
def test_it_requests_braking() -> None:
    _, events = drive()

    request, *_ = [event for event in events if isinstance(event, BrakeRequest)]
    assert (request.deceleration_m_s2, request.causes) == (4.0, (TOY,))
    assert datagram.decode(datagram.encode(request)).causes == (TOY,)


def test_a_row_that_may_not_brake_does_not(monkeypatch: pytest.MonkeyPatch) -> None:
    row = replace(ROW, may_brake=False)
    monkeypatch.setattr(alarm_table, "ALARMS", (*alarm_table.ALARMS, row))

    _, events = drive()

    assert [event.kind for event in events if isinstance(event, Alarm | BrakeRequest)] == ["alarm"]


@pytest.mark.usefixtures("_in_the_table")
def test_metrics_count_it_from_the_start() -> None:
    metrics = Metrics(frozenset(), Build("0.2.0", "4f463bb4b", "20261124"))
    assert b'onboard_alarm_level{cause="toy"} 0.0' in metrics.exposition()[0]

    metrics.receive_event(Alarm(1.0, TOY, Level.CAUTION, 4.0, ()))
    assert b'onboard_alarm_level{cause="toy"} 1.0' in metrics.exposition()[0]


@pytest.mark.usefixtures("_in_the_table")
def test_a_scenario_may_expect_it() -> None:
    assert a(AlarmExpected, TypeAdapter(Expectation).validate_python(EXPECTED)).cause == TOY


def test_a_scenario_may_expect_no_cause_that_is_not_in_the_table() -> None:
    with pytest.raises(
        ValidationError, match="must be one of lcca, fcw, eebl, braking_ahead, ima, lta"
    ):
        TypeAdapter(Expectation).validate_python(EXPECTED)
