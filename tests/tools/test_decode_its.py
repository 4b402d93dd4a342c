"""`onboard decode` of GeoNetworking and ETSI messages: recorded ones, with tshark beside it."""

import base64
import json
import math
import struct
import sys
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pycrate_asn1dir.ITS_DENM_3 import DENM_PDU_Descriptions
from typer.testing import CliRunner

from onboard.messages import cpm
from onboard.security import ieee1609dot2
from onboard.tools.cli import app
from onboard.tools.decode.describe import Form, describe
from onboard.wave_udp.capture import LINKTYPE_ETHERNET
from onboard.wave_udp.wsmp import ETHERTYPE_GEONETWORKING
from tests.messages.test_cpm import FUSED, MEASURED, with_evidence
from tests.wave_udp.test_capture import needs_tshark, tshark

COMMON = bytes.fromhex(
    "20500080002d01008000000000000000473b36fb1d113b8806d0652780000000000000000"
    "7d100000202000000013731005a56c4918e4346e51ffffffc23b7743e0000012000003fe1ed0403ffe3fff400"
)
"""A packet of Vanetza with a CAM, from the common header on (riebl/vanetza, issue 115)."""
BASIC, SECURED = bytes.fromhex("11001a01"), bytes.fromhex("12001a01")
CAMS = (
    base64.b64decode(
        "AgINl1aLXpNAWrOG4g4oO3viNCMMSDOWUFh5cKJYfgKWilc3/un/6iA//5RZgQJeAMyAFdjOAATwOlwGSsZwAVOB2WAy"
        "ljOACewO/QGbMZwAT+B6eA0FjOACfwOhQGLsgAAS2BzOAwdjOACTwPHwGMsZwAUOB1iAy5jOACewOlQGbsZwAT+B4qAz"
        "ZjOACqA="
    ),
    bytes.fromhex(
        "02020000d900b1e74059d824554cc4c2d79ffffffc2230d41e58622fc0000082b88a800ffd01fff8807fe013c040"
        "0009ffff7fffd8ce00"
    ),
)
"""Captured CAMs (eerimoq/asn1tools, issue 179; P1sec/pycrate, issue 156)."""


def a_denm() -> bytes:
    ellipse = {"semiMajorConfidence": 100, "semiMinorConfidence": 50, "semiMajorOrientation": 900}
    place = {
        "latitude": 521234567,
        "longitude": -51234567,
        "positionConfidenceEllipse": ellipse,
        "altitude": {"altitudeValue": 1234, "altitudeConfidence": "alt-001-00"},
    }
    management = {
        "actionID": {"originatingStationID": 4711, "sequenceNumber": 9},
        "detectionTime": 600_000_000_000,
        "referenceTime": 600_000_000_100,
        "eventPosition": place,
        "validityDuration": 300,
        "stationType": 5,
    }
    situation = {"informationQuality": 3, "eventType": {"causeCode": 99, "subCauseCode": 1}}
    denm = DENM_PDU_Descriptions.DENM
    denm.set_val(
        {
            "header": {"protocolVersion": 2, "messageID": 1, "stationID": 4711},
            "denm": {"management": management, "situation": situation},
        }
    )
    return bytes(denm.to_uper())


def position_vector(speed: int = -250) -> bytes:
    address = 0x9400_0200_0000_0001
    return struct.pack(
        ">QIiiHH", address, 77_000, 521234567, -51234567, 0x8000 | speed & 0x7FFF, 901
    )


def geobroadcast(payload: bytes, port: int) -> bytes:
    """A packet to an ellipse, with BTP-B."""
    common = struct.pack(">BBBBHBx", 0x20, 0x42, 2, 0x80, len(payload) + 4, 10)
    area = struct.pack(">iiHHHxx", 521230000, -51230000, 300, 40, 75)
    return (
        BASIC
        + common
        + struct.pack(">Hxx", 8)
        + position_vector()
        + area
        + struct.pack(">HH", port, 0)
        + payload
    )


def single_hop(payload: bytes, port: int) -> bytes:
    common = struct.pack(">BBBBHBx", 0x20, 0x50, 0, 0, len(payload) + 4, 1)
    return BASIC + common + position_vector() + bytes(4) + struct.pack(">HH", port, 0) + payload


def write_capture(path: Path, packet: bytes) -> Path:
    frame = b"\xff" * 6 + b"\x02\0\0\0\0\1" + ETHERTYPE_GEONETWORKING.to_bytes(2) + packet
    head = struct.pack("<IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, 65535, LINKTYPE_ETHERNET)
    path.write_bytes(head + struct.pack("<IIII", 1, 0, len(frame), len(frame)) + frame)
    return path


def numbers(tree: Any, found: dict[str, set[int]] | None = None) -> dict[str, set[int]]:
    """All integers of a tree by the name of their field."""
    found = {} if found is None else found
    for name, value in tree.items() if isinstance(tree, dict) else ():
        for each in value if isinstance(value, list) else [value]:
            if isinstance(each, int) and not isinstance(each, bool):
                found.setdefault(name, set()).add(each)
            numbers(each, found)
    return found


@needs_tshark
@pytest.mark.parametrize(
    "packet",
    [
        BASIC + COMMON,
        *(single_hop(cam, 2001) for cam in CAMS),
        geobroadcast(a_denm(), 2002),
    ],
    ids=["vanetza", "cam with path history", "cam without altitude", "denm"],
)
def test_every_number_of_a_message_is_what_tshark_reads(packet: bytes, tmp_path: Path) -> None:
    (theirs,) = tshark(write_capture(tmp_path / "its.pcap", packet))
    assert "_ws.malformed" not in theirs
    read: dict[str, set[str]] = {}
    for name, values in theirs.items():
        protocol, _, field = name.partition(".")
        if protocol in {"its", "cam", "denm"}:
            read.setdefault(field, set()).update(map(str, values))
    ours = numbers(describe(packet)["its"])
    assert len(ours) >= 15
    for name, integers in ours.items():
        assert {str(value) for value in integers} <= read[name], name


@needs_tshark
def test_headers_are_what_tshark_reads(tmp_path: Path) -> None:
    packet = geobroadcast(a_denm(), 2002)
    (theirs,) = tshark(write_capture(tmp_path / "its.pcap", packet))
    ours = describe(packet)["geonetworking"]
    source, area = ours["source"], ours["area"]
    assert ours["packet"] == "geobroadcast"
    assert ours["lifetime_s"] == 60.0
    assert [str(ours["remaining_hop_limit"])] == theirs["geonw.bh.rhl"]
    assert [str(ours["maximum_hop_limit"])] == theirs["geonw.ch.mhl"]
    assert [str(source["timestamp_ms"])] == theirs["geonw.src_pos.tst"]
    assert [str(source["station_type"])] == theirs["geonw.src_pos.addr.type"]
    for name, value in (
        ("geonw.src_pos.lat", source["latitude_deg"] / 1e-7),
        ("geonw.src_pos.long", source["longitude_deg"] / 1e-7),
        ("geonw.src_pos.speed", source["speed_m_s"] / 0.01),
        ("geonw.src_pos.hdg", math.degrees(source["heading_rad"]) / 0.1),
        ("geonw.gxc.latitude", area["latitude_deg"] / 1e-7),
        ("geonw.gxc.distancea", area["distance_a_m"]),
        ("geonw.gxc.distanceb", area["distance_b_m"]),
        ("geonw.gxc.angle", area["angle_deg"]),
    ):
        assert [float(each) for each in theirs[name]] == [pytest.approx(value)], name
    assert area["shape"] == "ellipse"
    assert ours["btp_b"] == {"destination_port": 2002, "destination_port_info": 0}


def test_in_1609_2_data_the_packet_goes_on_with_the_common_header() -> None:
    layers = describe(SECURED + ieee1609dot2.encode_unsecured(COMMON))
    assert list(layers) == ["geonetworking", "1609.2", "geonetworking_common", "its"]
    assert layers["its"] == describe(BASIC + COMMON)["its"]


def test_a_capture_of_geonetworking_is_read(tmp_path: Path) -> None:
    path = write_capture(tmp_path / "its.pcap", BASIC + COMMON)
    result = CliRunner().invoke(app, ["decode", str(path)])
    assert result.exit_code == 0
    assert '"stationID":1}' in result.stdout


def test_a_cpm_is_read_with_its_units_and_what_mvs_adds() -> None:
    data = cpm.encode(with_evidence(MEASURED, FUSED))
    message = json.loads(json.dumps(describe(data, Form.ITS)))["its"]["cpm"]
    car, _ = message["perceived"]["objects"]
    assert car["position"]["east"] == {"value_m": -12.34, "confidence_m": 0.5}
    assert message["perceived"]["evidence"]["observers"] == ["61616161", "62626262"]


@given(st.integers(0, len(COMMON) + 3), st.integers(0, 7), st.integers(0, len(COMMON) + 3))
def test_damaged_packets_have_an_error_and_no_traceback(size: int, bit: int, at: int) -> None:
    packet = bytearray(BASIC + COMMON)
    assert "error" in describe(bytes(packet[:size]), Form.GEONETWORKING)
    packet[at] ^= 1 << bit
    describe(bytes(packet), Form.GEONETWORKING)


@pytest.mark.parametrize(
    ("data", "form", "detail"),
    [
        (b"\x02\x0d" + bytes(8), Form.ITS, "13 (rtcmem)"),
        (b"\x02\x63" + bytes(8), Form.ITS, "99 (unknown)"),
        (bytes.fromhex("001f0412345678"), Form.AUTO, "message 31 (travelerInformation)"),
        (BASIC + b"\x20\x60" + bytes(60), Form.AUTO, "6.0"),
        (BASIC + b"\x30\x50\0\0\0\1\1\0" + bytes(60), Form.AUTO, "ipv6"),
    ],
)
def test_what_is_not_read_is_named(data: bytes, form: Form, detail: str) -> None:
    assert describe(data, form)["error"]["detail"] == detail


def test_a_beacon_has_no_content() -> None:
    beacon = BASIC + b"\x00\x10\0\0\0\0\1\0" + position_vector()
    layers = describe(beacon)
    assert list(layers) == ["geonetworking"]
    assert layers["geonetworking"]["source"]["speed_m_s"] == pytest.approx(-2.5)


def test_without_the_extra_its_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pycrate_asn1dir.ITS_CAM_2", None)
    layers = describe(BASIC + COMMON)
    assert layers["error"]["reason"] == "extra_missing"
    assert "onboard[its]" in layers["error"]["detail"]
    assert layers["geonetworking"]["btp_b"]["destination_port"] == 2001
