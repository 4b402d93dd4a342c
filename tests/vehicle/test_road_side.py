"""A whole vehicle that hears a road-side unit."""

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import numpy as np

from onboard.messages import map_data, spat
from onboard.messages.map_data import ReferencePoint
from onboard.observations import Position, Sensor
from onboard.security import p256
from onboard.security.credentials import Credentials
from onboard.security.security_services import SecurityServices
from onboard.settings import parse_settings
from onboard.step import Input, ReceivedWsm
from onboard.tools.test_ca.authority import make_trial
from onboard.trace.trace_line import as_trace_record
from onboard.vehicle.config import CarConfig
from onboard.vehicle.stack import Stack
from onboard.wave_udp import psid, wsmp
from onboard.wave_udp.wsmp import WaveShortMessage
from tests.intersections.test_signal_phase import SENT_UTC_S
from tests.messages.crossing_messages import crossing_map, crossing_spat, intersections_of

TRIAL = make_trial(
    ["car", "other"],
    {psid.BSM, psid.LCCA},
    SENT_UTC_S,
    p256.key_from(np.random.default_rng(9)),
    others={"unit": psid.OF_ROAD_SIDE_UNITS},
)


def vehicle(credentials: Credentials | None) -> Stack:
    tree = {"car": {"plate": "AAA1"}, "security": {"plate_digest": {"scrypt_log2_n": 1}}}
    return Stack(
        parse_settings(tree, CarConfig, "car"),
        (Sensor.POSITION,),
        np.random.default_rng(1),
        now=0.0,
        utc_s=SENT_UTC_S,
        credentials=credentials,
    )


def events_of(stack: Stack, sender: Credentials | None) -> list[dict[str, Any]]:
    """Drive 0.5 s eastwards on lane 1, 40 m before its stop line, and hear MAP and SPAT."""
    security = SecurityServices(SENT_UTC_S, sender)
    events: list[dict[str, Any]] = []
    for tenth in range(6):
        now = tenth / 10
        fix = Position(now, 42.0, -83.0006, None, 0.5, 10.0, np.pi / 2)
        wsms = [
            wsmp.encode(WaveShortMessage(service, security.secure(frame, service, now)))
            for service, frame in (
                (psid.MAP, map_data.encode(crossing_map())),
                (psid.SPAT, spat.encode(crossing_spat(time_stamp_s=12.3 + now))),
            )
        ]
        inputs: list[Input] = [fix, *(ReceivedWsm(now, wsm) for wsm in wsms)]
        events += map(as_trace_record, stack.step(inputs, now).events)
    return events


def of_kind(events: Iterable[dict[str, Any]], kind: str) -> list[dict[str, Any]]:
    return [each for each in events if each["kind"] == kind]


def test_a_vehicle_knows_the_signal_ahead() -> None:
    events = events_of(vehicle(TRIAL["car"]), TRIAL["unit"])
    assert of_kind(events, "discarded") == []
    (shown,) = of_kind(events, "signal_ahead")
    assert (shown["intersection"], shown["lane_id"]) == (501, 1)
    assert shown["states"] == ["protected_movement_allowed"]


def test_with_keys_only_a_unit_with_its_permission_is_believed() -> None:
    for sender, reason in ((None, "unsigned"), (TRIAL["other"], "wrong_psid")):
        events = events_of(vehicle(TRIAL["car"]), sender)
        assert of_kind(events, "signal_ahead") == []
        assert {each["reason"] for each in of_kind(events, "discarded")} == {reason}


def test_without_keys_an_unsigned_unit_is_believed() -> None:
    assert of_kind(events_of(vehicle(None), None), "signal_ahead")


def test_a_map_of_another_town_is_discarded_with_its_reason() -> None:
    far = crossing_map()
    (crossing,) = intersections_of(far)
    far = replace(far, intersections=(replace(crossing, ref_point=ReferencePoint(43.0, -83.0)),))
    stack = vehicle(None)
    stack.step((Position(0.0, 42.0, -83.0006, None, 0.5, 10.0, np.pi / 2),), 0.0)
    unsigned = SecurityServices(SENT_UTC_S).secure(map_data.encode(far), psid.MAP, 0.1)
    wsm = wsmp.encode(WaveShortMessage(psid.MAP, unsigned))
    events = map(as_trace_record, stack.step((ReceivedWsm(0.1, wsm),), 0.1).events)
    (refused,) = of_kind(events, "discarded")
    assert (refused["component"], refused["reason"]) == ("map", "too_far")
    assert refused["detail"].startswith("intersection 501: 111")
