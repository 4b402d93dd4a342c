"""CAM: bits and values as of another codec and of real units; other bytes are refused."""

from dataclasses import replace

import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st
from pycrate_asn1dir.ITS_CAM_2 import CAM_PDU_Descriptions

from onboard.errors import DecodeError
from onboard.messages import cam
from onboard.messages.cam import Cam, CamParameters
from onboard.messages.its_common import DeltaPosition, PathPoint
from onboard.messages.record import Record
from tests.messages.its_oracle import assert_same, decoded
from tests.messages.strategies import records
from tests.tools.test_decode_its import CAMS

PARAMETERS: Record[CamParameters] = Record(CamParameters, extensible=True)
few = settings(
    max_examples=20,
    deadline=None,
    phases=[Phase.explicit, Phase.reuse, Phase.generate],  # shrinking takes minutes
    suppress_health_check=[HealthCheck.too_slow],
)


@few
@given(records(cam.CAM, most=2))
def test_every_cam_is_that_of_another_codec_and_is_read_again(message: Cam) -> None:
    data = cam.encode(message)
    oracle = CAM_PDU_Descriptions.CAM
    oracle.from_uper(data)
    value = oracle.get_val()
    oracle.set_val(value)
    assert oracle.to_uper() == data
    assert value["header"] == {
        "protocolVersion": 2,
        "messageID": 2,
        "stationID": int.from_bytes(message.station_id),
    }
    assert value["cam"]["generationDeltaTime"] == round(message.generation_delta_time_s * 1000)
    encoded = PARAMETERS.encode(message.parameters)
    assert_same(PARAMETERS, message.parameters, decoded(PARAMETERS, encoded))
    assert cam.decode(data) == message
    assert cam.station_id_in(data) == message.station_id


def test_recorded_cams_have_their_values_and_are_encoded_to_the_same_bits() -> None:
    for data in CAMS:
        assert cam.encode(cam.decode(data)) == data
    message = cam.decode(CAMS[0])
    basic, high = message.parameters.basic, message.parameters.high_frequency.value
    low = message.parameters.low_frequency
    assert low is not None
    assert message.station_id == bytes.fromhex("0d97568b")
    assert (basic.position.latitude_deg, basic.position.longitude_deg) == (53.6301072, 10.0141535)
    assert (high.speed.speed_m_s, high.length.length_m, high.width_m) == (12.0, 4.2, 1.8)
    assert high.acceleration_control is cam.AccelerationControl.BRAKE_PEDAL
    assert low.value.path[1] == PathPoint(DeltaPosition(0.0001868, 0.0000806, 0.0), 1.7)


def test_a_travel_time_of_a_later_edition_is_read_as_the_longest() -> None:
    message = cam.decode(CAMS[0])
    low = message.parameters.low_frequency
    assert low is not None
    one = replace(low, value=cam.LowFrequency(path=low.value.path[:1]))
    data = cam.encode(replace(message, parameters=replace(message.parameters, low_frequency=one)))
    # The last field: extension bit 0 and 16 bits of 19 (0.2 s) become 1 and three octets.
    bits = f"{int.from_bytes(data):0{len(data) * 8}b}"
    head = bits[: bits.rindex(f"0{19:016b}")]
    later = head + f"1{3:08b}{70_000:024b}"
    longer = int(later.ljust(-(-len(later) // 8) * 8, "0"), 2).to_bytes(-(-len(later) // 8))
    read = cam.decode(longer).parameters.low_frequency
    assert read is not None
    assert read.value.path[0].elapsed_s == 655.35


def test_each_kind_of_invalid_bytes_has_its_reason() -> None:
    good = CAMS[0]
    cases = {
        b"": "too_short",
        good[:30]: "too_short",
        b"\x01" + good[1:]: "unknown_version",
        good[:1] + b"\x01" + good[2:]: "not_a_cam",
        good + b"\x00": "trailing_bytes",
        good[:8] + b"\xff" * 40: "out_of_range",
    }
    assert {data: _reason(data) for data in cases} == cases


@given(st.binary(max_size=80))
def test_any_bytes_raise_only_decode_errors(noise: bytes) -> None:
    for data in (noise, CAMS[0][:8] + noise):
        try:
            cam.decode(data)
        except DecodeError:
            continue


def _reason(data: bytes) -> str:
    with pytest.raises(DecodeError) as refused:
        cam.decode(data)
    return refused.value.reason
