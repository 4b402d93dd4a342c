"""DENM: bits and values as of another codec, details kept as they are, other bytes refused."""

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pycrate_asn1dir.ITS_DENM_3 import DENM_PDU_Descriptions

from onboard.errors import DecodeError
from onboard.messages import denm
from onboard.messages.denm import Denm, Notification
from onboard.messages.record import Record
from tests.messages.its_oracle import assert_same, decoded
from tests.messages.strategies import records
from tests.messages.test_cam import few
from tests.tools.test_decode_its import a_denm

NOTIFICATION: Record[Notification] = Record(Notification)


@few
@given(records(denm.DENM, most=2))
def test_every_denm_is_that_of_another_codec_and_is_read_again(message: Denm) -> None:
    management = message.notification.management
    if management.validity_s == denm.DEFAULT_VALIDITY_S:  # which pycrate leaves out
        management = replace(management, validity_s=None)
    message = replace(message, notification=replace(message.notification, management=management))
    data = denm.encode(message)
    oracle = DENM_PDU_Descriptions.DENM
    oracle.from_uper(data)
    value = oracle.get_val()
    oracle.set_val(value)
    assert oracle.to_uper() == data
    assert value["header"]["stationID"] == int.from_bytes(message.station_id)
    encoded = NOTIFICATION.encode(message.notification)
    theirs = decoded(NOTIFICATION, encoded)
    if management.validity_s is None:
        theirs["management"].pop("validityDuration", None)  # its default
    assert_same(NOTIFICATION, message.notification, theirs)
    assert denm.decode(data) == message


def test_details_at_the_end_are_kept() -> None:
    oracle = DENM_PDU_Descriptions.DENM
    oracle.from_uper(a_denm())
    value = oracle.get_val()
    value["denm"]["alacarte"] = {"lanePosition": 3, "externalTemperature": -7}
    oracle.set_val(value)
    data = oracle.to_uper()
    message = denm.decode(data)
    assert message.notification.a_la_carte is not None
    assert denm.encode(message) == data
    assert denm.as_dict(message)["notification"]["situation"]["event"] == {
        "cause": 99,
        "subcause": 1,
    }


def test_each_kind_of_invalid_bytes_has_its_reason() -> None:
    good = a_denm()
    cases = {
        b"": "too_short",
        good[:30]: "too_short",
        b"\x01" + good[1:]: "unknown_version",
        good[:1] + b"\x02" + good[2:]: "not_a_denm",
        good + b"\x00": "trailing_bytes",
    }
    for data, reason in cases.items():
        with pytest.raises(DecodeError) as refused:
            denm.decode(data)
        assert refused.value.reason == reason


@given(st.binary(max_size=80))
def test_any_bytes_raise_only_decode_errors(noise: bytes) -> None:
    for data in (noise, a_denm()[:8] + noise):
        try:
            denm.decode(data)
        except DecodeError:
            continue
