"""VAM and PSM: bits and values as of other decoders; other bytes refused; said as a BSM."""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pycrate_asn1dir.ITS_VAM_3 import VAM_PDU_Descriptions

from onboard.errors import DecodeError
from onboard.its_g5.road_users import bsm_of_vam
from onboard.messages import psm, vam
from onboard.messages.cam import BasicContainer
from onboard.messages.psm import PersonalDeviceUser
from onboard.messages.psm_as_bsm import BICYCLE, PERSON, bsm_of_psm
from onboard.messages.record import Record
from sim_rig.road_side.person_messages import a_psm, a_vam
from tests.messages.strategies import records
from tests.messages.test_cam import few

UTC_S = 1_790_000_000.25
PLACE_DEG = 48.1, 11.5
STANDING = vam.encode(a_vam(b"walk", PLACE_DEG, UTC_S))


def oracle_value(data: bytes) -> Any:
    oracle = VAM_PDU_Descriptions.VAM
    oracle.from_uper(data)
    return oracle.get_val()


def a_cyclist() -> bytes:
    """By pycrate: with all containers that say something of a single cyclist."""
    value = oracle_value(STANDING)
    parameters = value["vam"]["vamParameters"]
    parameters["basicContainer"]["stationType"] = 2
    parameters["vruHighFrequencyContainer"] |= {
        "heading": {"headingValue": 900, "headingConfidence": 10},
        "speed": {"speedValue": 450, "speedConfidence": 20},
        "environment": "onVehicleRoad",
        "vruLanePosition": ("offRoadLanePosition", "bikeLane"),
    }
    parameters["vruLowFrequencyContainer"] = {
        "profileAndSubprofile": ("bicyclist", "bicyclist"),
        "sizeClass": "medium",
    }
    oracle = VAM_PDU_Descriptions.VAM
    oracle.set_val(value)
    data: bytes = oracle.to_uper()
    return data


@few
@given(
    records(Record(BasicContainer)),
    records(Record(vam.VruMotion)),
    st.integers(0, 65_535).map(lambda ms: ms / 1e3),
)
def test_position_and_motion_of_a_vam_are_those_of_another_codec(
    basic: BasicContainer, motion: vam.VruMotion, generation_delta_time_s: float
) -> None:
    motion = replace(motion, has_additions=False, present=0)
    parameters = vam.VruParameters(
        has_additions=False, present=vam.MOTION_PRESENT, basic=basic, motion=motion
    )
    data = vam.encode(vam.Vam(b"walk", generation_delta_time_s, parameters))
    value = oracle_value(data)
    VAM_PDU_Descriptions.VAM.set_val(value)
    assert VAM_PDU_Descriptions.VAM.to_uper() == data
    theirs = value["vam"]["vamParameters"]
    high = theirs["vruHighFrequencyContainer"]
    assert value["header"]["stationID"] == int.from_bytes(b"walk")
    assert value["vam"]["generationDeltaTime"] == round(generation_delta_time_s * 1e3)
    assert theirs["basicContainer"]["stationType"] == basic.station_type
    latitude = theirs["basicContainer"]["referencePosition"]["latitude"]
    assert latitude == (
        900_000_001 if (north := basic.position.latitude_deg) is None else round(north * 1e7)
    )
    speed_m_s, heading_rad = motion.speed.speed_m_s, motion.heading.heading_rad
    assert high["speed"]["speedValue"] == (16383 if speed_m_s is None else round(speed_m_s * 100))
    if heading_rad is not None:
        assert high["heading"]["headingValue"] % 3600 == round(math.degrees(heading_rad) * 10)


def test_a_cyclist_by_another_codec_is_read_and_kept_to_the_bit() -> None:
    data = a_cyclist()
    message = vam.decode(data)
    assert vam.encode(message) == data
    core = bsm_of_vam(message, UTC_S + 0.1).core
    assert core.temporary_id == b"walk"
    assert (core.latitude_deg, core.longitude_deg) == pytest.approx(PLACE_DEG)
    assert (core.speed_m_s, core.heading_rad) == pytest.approx((4.5, math.pi / 2))
    assert core.sec_mark_s == pytest.approx(UTC_S % 60.0, abs=0.002)
    assert core.accuracy.semi_major_m == pytest.approx(0.5, abs=0.01)
    assert core.size == BICYCLE


def test_each_kind_of_invalid_vam_has_its_reason() -> None:
    cases = {
        b"": "too_short",
        STANDING[:20]: "too_short",
        b"\x03" + STANDING[1:]: "unknown_version",
        STANDING[:1] + b"\x02" + STANDING[2:]: "not_a_vam",
        STANDING[:8] + bytes((STANDING[8] & 0xBF,)) + STANDING[9:]: "no_motion",
    }
    for data, reason in cases.items():
        with pytest.raises(DecodeError) as refused:
            vam.decode(data)
        assert refused.value.reason == reason


def test_a_vehicle_sends_no_vam() -> None:
    value = oracle_value(STANDING)
    value["vam"]["vamParameters"]["basicContainer"]["stationType"] = 5
    VAM_PDU_Descriptions.VAM.set_val(value)
    with pytest.raises(DecodeError, match="not_a_road_user"):
        bsm_of_vam(vam.decode(VAM_PDU_Descriptions.VAM.to_uper()), UTC_S)


REAL_PSM = bytes.fromhex(
    "00201a0000021bd86891de75f84da101c13f042e2214141fff00022c2000270000000163b2cc7986010000"
)
"""Of usdot-jpo-ode/jpo-ode, which decodes it by asn1c: the values below are its."""


def test_a_real_psm_is_read_and_kept_to_the_bit() -> None:
    message = psm.decode(REAL_PSM)
    assert message.basic_type is PersonalDeviceUser.PEDESTRIAN
    assert message.temporary_id == bytes.fromhex("24779d7e")
    assert message.msg_cnt == 26
    assert message.sec_mark_s == pytest.approx(3.564)
    place = message.position
    assert (place.latitude_deg, place.longitude_deg) == pytest.approx((40.2397377, -74.2761437))
    assert message.speed_m_s == 0.0
    assert math.degrees(message.heading_rad or 0.0) == pytest.approx(111.225)
    assert message.accuracy.semi_major_m == pytest.approx(1.0)
    assert math.degrees(message.accuracy.orientation_rad or 0.0) == pytest.approx(44.9952, abs=1e-4)
    assert REAL_PSM.startswith(psm.encode(message))  # the rest of the datagram is none of it


@pytest.mark.parametrize(("data", "reason"), [(b"", "too_short"), (b"\0\x14\0", "not_a_psm")])
def test_each_kind_of_invalid_psm_has_its_reason(data: bytes, reason: str) -> None:
    with pytest.raises(DecodeError) as refused:
        psm.decode(data)
    assert refused.value.reason == reason


def test_a_psm_says_what_a_bsm_says() -> None:
    core = bsm_of_psm(psm.decode(psm.encode(a_psm(b"walk", PLACE_DEG, UTC_S, 5)))).core
    assert core.temporary_id == b"walk"
    assert (core.latitude_deg, core.longitude_deg) == pytest.approx(PLACE_DEG)
    assert core.sec_mark_s == pytest.approx(UTC_S % 60.0, abs=0.002)
    assert core.size == PERSON
    assert a_psm(b"walk", PLACE_DEG, UTC_S, 5).basic_type is PersonalDeviceUser.PEDESTRIAN


@pytest.mark.parametrize("decode", [vam.decode, psm.decode])
@given(noise=st.binary(max_size=60))
def test_any_bytes_raise_only_decode_errors(
    decode: Callable[[bytes], object], noise: bytes
) -> None:
    heads = (b"", STANDING[:8], psm.encode(a_psm(b"walk", PLACE_DEG, UTC_S, 5))[:6])
    for head in heads:
        try:
            decode(head + noise)
        except DecodeError:
            continue
