"""A whole vehicle that shares in SDSMs and hears those of others."""

from dataclasses import replace

import numpy as np
import pytest

from onboard.messages import sdsm
from onboard.messages.date_time import DateTime
from onboard.messages.sdsm import SensorDataSharingMessage
from onboard.observations import Position, Sensor
from onboard.security import ieee1609dot2, p256
from onboard.security.credentials import Credentials
from onboard.security.rejection import RejectionReason
from onboard.security.security_services import SecurityServices
from onboard.settings import parse_settings
from onboard.step import ReceivedWsm
from onboard.tools.test_ca.authority import make_trial
from onboard.trace.trace_line import as_trace_record
from onboard.vehicle.config import CarConfig
from onboard.vehicle.stack import Stack
from onboard.wave_udp import psid, wsmp
from onboard.wave_udp.wsmp import WaveShortMessage
from tests.messages.test_sdsm import MESSAGE

UTC_S = 1_790_000_000.0
TRIAL = make_trial(
    ["car", "other", "third"], psid.OF_VEHICLES, UTC_S, p256.key_from(np.random.default_rng(9))
)


def vehicle(credentials: Credentials | None = None, shared_in: str = "footer") -> Stack:
    tree = {
        "car": {"plate": "AAA1"},
        "security": {"plate_digest": {"scrypt_log2_n": 1}},
        "mvs": {"shared_in": shared_in},
    }
    return Stack(
        parse_settings(tree, CarConfig, "car"),
        (Sensor.POSITION,),
        np.random.default_rng(1),
        now=0.0,
        utc_s=UTC_S,
        credentials=credentials,
    )


def discarded(
    stack: Stack, frame: bytes, sender: Credentials | None = None
) -> list[tuple[str, RejectionReason]] | list[tuple[str, str]]:
    """Let the vehicle, which has a position, receive a frame; return reasons of what it drops."""
    payload = ieee1609dot2.encode_unsecured(frame) if sender is None else None
    if payload is None:
        payload = SecurityServices(UTC_S, sender).secure(frame, psid.SENSOR_SHARING, 0.1)
    wsm = wsmp.encode(WaveShortMessage(psid.SENSOR_SHARING, payload))
    fix = Position(0.1, 48.1, 11.5, None, 0.5, 10.0, 0.0)
    events = stack.step((fix, ReceivedWsm(0.1, wsm)), 0.1).events
    records = map(as_trace_record, events)
    return [(each["component"], each["reason"]) for each in records if each["kind"] == "discarded"]


def of_now(message: SensorDataSharingMessage) -> SensorDataSharingMessage:
    return replace(message, time=DateTime.of_utc(round((UTC_S + 0.1) * 1000)))


def test_an_sdsm_of_a_vehicle_that_was_not_heard_is_not_placed() -> None:
    assert discarded(vehicle(), sdsm.encode(of_now(MESSAGE))) == [("mvs", "unplaced_sender")]


def test_one_of_a_road_side_unit_is_used() -> None:
    unit = replace(of_now(MESSAGE), equipment=sdsm.EquipmentType.RSU)
    assert discarded(vehicle(), sdsm.encode(unit)) == []
    assert discarded(vehicle(TRIAL["car"]), sdsm.encode(unit), TRIAL["other"]) == []


def test_with_keys_only_a_sender_with_the_permission_is_believed() -> None:
    frame = sdsm.encode(of_now(MESSAGE))
    assert discarded(vehicle(TRIAL["car"]), frame) == [("security", "unsigned")]


def test_bytes_that_are_no_sdsm_are_counted() -> None:
    frame = sdsm.encode(MESSAGE)
    assert discarded(vehicle(), b"\x00\x14\x00") == [("sdsm", "not_a_sdsm")]
    assert discarded(vehicle(), frame[:-4]) == [("sdsm", "too_short")]


def test_a_second_signer_with_the_id_of_another_is_not_believed() -> None:
    car = vehicle(TRIAL["car"])
    unit = replace(of_now(MESSAGE), equipment=sdsm.EquipmentType.RSU)
    assert discarded(car, sdsm.encode(unit), TRIAL["other"]) == []
    twin = replace(unit, msg_cnt=78)
    reasons = discarded(car, sdsm.encode(twin), TRIAL["third"])
    assert reasons == [("sdsm", "implausible_identity")]


@pytest.mark.parametrize(
    ("shared_in", "psids"),
    [("footer", {psid.LCCA, psid.BSM}), ("sdsm", psid.OF_VEHICLES), ("both", psid.OF_VEHICLES)],
)
def test_the_keys_must_permit_what_is_sent(
    shared_in: str, psids: frozenset[int] | set[int]
) -> None:
    config = parse_settings(
        {"car": {"plate": "AAA1"}, "mvs": {"shared_in": shared_in}}, CarConfig, "car"
    )
    assert config.psids == psids
