"""SDSM: bits of other makers, values as of another codec, and what is refused."""

import math
from dataclasses import replace
from pathlib import Path

import asn1tools
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from onboard.errors import DecodeError
from onboard.messages import sdsm
from onboard.messages.bsm_core import AccelerationSet, PositionalAccuracy, VehicleSize
from onboard.messages.date_time import DateTime
from onboard.messages.fields import Chosen
from onboard.messages.map_data import ReferencePoint
from onboard.messages.sdsm import (
    SDSM,
    DetectedObject,
    DetectedObjectData,
    DetectedVehicle,
    EquipmentType,
    ObjectType,
    PositionConfidenceSet,
    PositionOffset,
    SensorDataSharingMessage,
)
from tests.messages.strategies import records

ORACLE = asn1tools.compile_files(str(Path(__file__).with_name("sdsm_oracle.asn1")), "uper")

CAR = DetectedObject(
    type=ObjectType.VEHICLE,
    type_confidence_percent=98,
    object_id=513,
    measurement_time_ms=-250,
    time_confidence_s=0.02,
    offset=PositionOffset(-12.3, 45.6, 0.7),
    confidence=PositionConfidenceSet(2.0, None),
    speed_m_s=13.5,
    speed_confidence_m_s=1.0,
    speed_up_m_s=0.2,
    speed_up_confidence_m_s=0.1,
    heading_rad=math.pi / 2,
    heading_confidence_deg=5.0,
    acceleration=AccelerationSet(-1.5, 0.2, None, math.radians(3.0)),
    longitudinal_confidence_m_s2=1.0,
    lateral_confidence_m_s2=0.1,
    vertical_confidence_m_s2=5.0,
    yaw_rate_confidence_deg_s=10.0,
)
MESSAGE = SensorDataSharingMessage(
    msg_cnt=77,
    source_id=b"\x01\x02\x03\x04",
    equipment=EquipmentType.OBU,
    time=DateTime(2026, 11, 23, 16, 59, 58.25, 3600.0),
    reference=ReferencePoint(48.1, 11.5, 520.0),
    reference_accuracy=PositionalAccuracy(1.5, 1.0, 0.0),
    elevation_confidence_m=5.0,
    objects=(
        DetectedObjectData(
            CAR, Chosen("vehicle", DetectedVehicle(size=VehicleSize(1.8, 4.5), vehicle_class=10))
        ),
    ),
)


@pytest.mark.parametrize(
    ("frame", "expected"),
    [
        pytest.param(
            "0029250a010c0c0a101f9c37ea97fc66b10b430c34000a00000020002bba0a000200004400240009",
            {
                "msg_cnt": 10,
                "source_id": "010c0c0a",
                "equipment": "unknown",
                "type": "unknown",
                "object_id": 1,
                "measurement_time_ms": 1,
                "time_confidence_s": 100.0,
                "position_m": 500.0,
                "speed_confidence_m_s": 100.0,
                "heading_confidence_deg": 10.0,
            },
            id="V2X-Hub, test of its encoder",
        ),
        pytest.param(
            "0029250a010c0c0a301fa04edb8816396666f30c34000a00002c43e94bba4200020002ec00280002",
            {
                "msg_cnt": 10,
                "equipment": "rsu",
                "type": "vru",
                "type_confidence_percent": 98,
                "object_id": 8010,
                "time_confidence_s": 0.2,
                "position_m": 0.2,
                "speed_m_s": 0.02,
            },
            id="jpo-ode, sample of a sender",
        ),
        pytest.param(
            "00292b7f303030303001ec35a4edd26b49d6d1ffffffff00802c800f6cae4a002e1344000180000000901401"
            "4140",
            {
                "msg_cnt": 127,
                "source_id": "30303030",
                "type": "vru",
                "object_id": 123,
                "measurement_time_ms": 123,
                "east_m": 1.2,
                "north_m": 123.4,
                "position_m": None,
                "width_m": 0.1,
                "vehicle_class": 10,
            },
            id="pyV2XLib, sample for its decoder",
        ),
    ],
)
def test_messages_of_other_makers_are_read_and_written_again_to_the_bit(
    frame: str, expected: dict[str, float | str | None]
) -> None:
    data = bytes.fromhex(frame)
    message = sdsm.decode(data)
    assert sdsm.encode(message) == data
    (detected,) = sdsm.as_dict(message)["objects"]
    common, vehicle = detected["common"], (detected["optional"] or {}).get("vehicle") or {}
    values = sdsm.as_dict(message) | common | common["offset"] | common["confidence"]
    values |= vehicle | (vehicle.get("size") or {})
    assert {name: values[name] for name in expected} == expected


def test_every_field_is_that_of_another_codec() -> None:
    theirs = ORACLE.decode("SensorDataSharingMessage", SDSM.encode(MESSAGE))
    (detected,) = theirs.pop("objects")
    assert theirs == {
        "msgCnt": 77,
        "sourceID": b"\x01\x02\x03\x04",
        "equipmentType": "obu",
        "sDSMTimeStamp": {
            "year": 2026,
            "month": 11,
            "day": 23,
            "hour": 16,
            "minute": 59,
            "second": 58_250,
            "offset": 60,
        },
        "refPos": {"lat": 481_000_000, "long": 115_000_000, "elevation": 5200},
        "refPosXYConf": {"semiMajor": 30, "semiMinor": 20, "orientation": 0},
        "refPosElConf": 7,
    }
    assert detected["detObjCommon"] == {
        "objType": "vehicle",
        "objTypeCfd": 98,
        "objectID": 513,
        "measurementTime": -250,
        "timeConfidence": 11,
        "pos": {"offsetX": -123, "offsetY": 456, "offsetZ": 7},
        "posConfidence": {"pos": 8, "elevation": 0},
        "speed": 675,
        "speedConfidence": 4,
        "speedZ": 10,
        "speedConfidenceZ": 5,
        "heading": 7200,
        "headingConf": 2,
        "accel4way": {"long": -150, "lat": 20, "vert": -127, "yaw": 300},
        "accCfdX": 4,
        "accCfdY": 5,
        "accCfdZ": 3,
        "accCfdYaw": 2,
    }
    assert detected["detObjOptData"] == (
        "detVeh",
        {"size": {"width": 180, "length": 450}, "vehicleClass": 10},
    )


def oracle_can_read(message: SensorDataSharingMessage) -> bool:
    """It knows no regional extensions, and no bit strings that are longer than declared."""
    vehicles = [each.optional.value for each in message.objects if each.optional is not None]
    return message.reference.regions is None and not any(
        vehicle.lights and vehicle.lights >= 1 << 9 for vehicle in vehicles
    )


@pytest.mark.long
@settings(max_examples=60, deadline=None, phases=[Phase.explicit, Phase.reuse, Phase.generate])
@given(records(SDSM, most=2).filter(oracle_can_read))
def test_every_message_has_the_bits_of_another_codec_and_is_read_again(
    message: SensorDataSharingMessage,
) -> None:
    data = SDSM.encode(message)
    theirs = ORACLE.decode("SensorDataSharingMessage", data)
    assert ORACLE.encode("SensorDataSharingMessage", theirs) == data
    assert SDSM.decode(data) == message


def test_a_bound_is_the_least_that_is_not_below_the_error() -> None:
    field = sdsm._POSITION
    for error_m, bound_m in ((0.3, 0.5), (0.5, 0.5), (2.1, 5.0), (501.0, None), (None, None)):
        assert field.from_raw(field.to_raw(error_m)) == bound_m


def test_data_of_an_object_that_is_not_read_refuses_the_message() -> None:
    for kind in (1, 2):
        body = {"objType": "vru"} | dict.fromkeys(("objTypeCfd", "objectID"), 1)
        theirs = ORACLE.decode("SensorDataSharingMessage", SDSM.encode(MESSAGE))
        theirs["objects"][0]["detObjCommon"] |= body
        theirs["objects"][0]["detObjOptData"] = (("detVeh", "detVRU", "detObst")[kind], None)
        with pytest.raises(DecodeError, match="unknown_object_data"):
            SDSM.decode(ORACLE.encode("SensorDataSharingMessage", theirs))


@given(st.integers(0, 4_000_000_000_000))
def test_a_time_is_read_as_it_was_written(utc_ms: int) -> None:
    assert DateTime.of_utc(utc_ms).utc_ms(near_ms=0) == utc_ms


def test_what_a_time_leaves_out_is_taken_from_the_receipt() -> None:
    received_ms = DateTime(2026, 11, 23, 16, 59, 58.3).utc_ms(0)
    assert DateTime(second_s=58.25).utc_ms(received_ms) == received_ms - 50
    assert DateTime(minute=59, second_s=58.25).utc_ms(received_ms) == received_ms - 50


def test_parts_of_a_time_that_are_unavailable_are_as_those_that_are_left_out() -> None:
    """SAE J2735, DYear, DMonth, DDay, DHour and DMinute: 0, 0, 0, 31 and 60."""
    received_ms = DateTime(2026, 11, 23, 16, 59, 58.3).utc_ms(0)
    assert DateTime(0, 0, 0, 31, 60, 58.25).utc_ms(received_ms) == received_ms - 50
    assert DateTime(2026, 0, 23, 16, 60, 58.25).utc_ms(received_ms) == received_ms - 50


def test_a_second_of_the_minute_before_or_after_the_receipt_is_not_a_minute_off() -> None:
    received_ms = DateTime(2026, 11, 23, 16, 59, 0.1).utc_ms(0)
    assert DateTime(second_s=59.9).utc_ms(received_ms) == received_ms - 200
    received_ms = DateTime(2026, 11, 23, 16, 59, 59.95).utc_ms(0)
    assert DateTime(second_s=0.05).utc_ms(received_ms) == received_ms + 100


@pytest.mark.parametrize(
    ("time", "reason"),
    [
        (DateTime(2026, 11, 23, 16, 59), "no_time"),
        (DateTime(second_s=65.535), "no_time"),
        (DateTime(2026, 2, 30, 1, 1, 0.0), "out_of_range"),
        (DateTime(2026, 1, 1, 24, 1, 0.0), "out_of_range"),
    ],
)
def test_a_time_that_is_none_is_refused(time: DateTime, reason: str) -> None:
    with pytest.raises(DecodeError, match=reason):
        time.utc_ms(0)


def test_a_message_of_another_type_is_named() -> None:
    with pytest.raises(DecodeError, match="not_a_sdsm"):
        sdsm.decode(bytes.fromhex("001400"))


def test_what_cannot_be_sent_is_an_error_that_names_the_field() -> None:
    with pytest.raises(ValueError, match=r"SensorDataSharingMessage.objects"):
        sdsm.encode(replace(MESSAGE, objects=()))
