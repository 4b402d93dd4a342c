"""MAPEM and SPATEM: bits and longitudes as of another codec; other bytes are refused."""

from dataclasses import replace

import pytest
from pycrate_asn1dir.ITS_IS import MAPEM_PDU_Descriptions, SPATEM_PDU_Descriptions

from onboard.errors import DecodeError
from onboard.its_g5.infrastructure import decode_map, decode_spat, encode_map, encode_spat
from onboard.messages.fields import Chosen
from onboard.messages.lane_nodes import LatLon, Node
from tests.messages.crossing_messages import crossing_map, crossing_spat

STATION_ID = b"unit"


def test_a_mapem_has_the_longitudes_of_its_map_by_the_other_codec() -> None:
    message = crossing_map()
    assert message.intersections is not None
    (crossing,) = message.intersections
    node = Node(Chosen("node_lat_lon", LatLon(-83.0000123, 42.0)))
    lanes = (replace(crossing.lanes[0], node_list=Chosen("nodes", (node, node))),)
    message = replace(message, intersections=(replace(crossing, lanes=lanes),))
    data = encode_map(message, STATION_ID)
    oracle = MAPEM_PDU_Descriptions.MAPEM
    oracle.from_uper(data)
    value = oracle.get_val()
    oracle.set_val(value)
    assert oracle.to_uper() == data
    assert value["header"]["messageID"] == 5
    (theirs,) = value["map"]["intersections"]
    assert theirs["refPoint"]["long"] == round((crossing.ref_point.longitude_deg or 0.0) * 1e7)
    _, nodes = theirs["laneSet"][0]["nodeList"]
    assert nodes[0]["delta"][1]["lon"] == -830_000_123
    assert encode_map(decode_map(data), STATION_ID) == data
    read = decode_map(data).intersections
    assert read is not None
    assert read[0].lanes[0].node_list.value[0].delta.value.longitude_deg == pytest.approx(
        -83.0000123, abs=1e-9
    )


def test_a_spatem_is_its_spat_by_the_other_codec() -> None:
    data = encode_spat(crossing_spat(), STATION_ID)
    oracle = SPATEM_PDU_Descriptions.SPATEM
    oracle.from_uper(data)
    assert oracle.to_uper() == data
    assert oracle.get_val()["header"]["messageID"] == 4
    assert decode_spat(data) == crossing_spat()
    assert decode_spat(b"\1" + data[1:]) == crossing_spat(), "as earlier units send it"


def test_each_kind_of_invalid_bytes_has_its_reason() -> None:
    lanes, signals = (
        encode_map(crossing_map(), STATION_ID),
        encode_spat(crossing_spat(), STATION_ID),
    )
    for decode, data, reason in (
        (decode_map, b"", "too_short"),
        (decode_map, lanes[:-1], "too_short"),
        (decode_map, signals, "not_a_mapem"),
        (decode_spat, lanes, "not_a_spatem"),
        (decode_spat, b"\3" + signals[1:], "unknown_version"),
    ):
        with pytest.raises(DecodeError) as refused:
            decode(data)
        assert refused.value.reason == reason
