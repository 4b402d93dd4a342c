"""Recorded BSMs of real units (`RIG_DATA`): values as documented, and the same bits again."""

import json
import math
import zlib
from functools import reduce
from pathlib import Path
from typing import Any

import pytest

from onboard.messages import bsm
from onboard.messages.bsm_core import BrakeSystemStatus
from onboard.tools.decode.describe import describe
from tests.typed import a


def _vectors(rig_data: Path) -> list[dict[str, Any]]:
    rows = (rig_data / "wsm/bsm-vectors.jsonl").read_text().splitlines()
    return [json.loads(row) for row in rows]


@pytest.mark.realdata
def test_eighty_bsms_of_real_units_are_decoded_as_documented_and_encoded_again(
    rig_data: Path,
) -> None:
    rows = _vectors(rig_data)
    assert len(rows) == 80
    for row in rows:
        frame = bytes.fromhex(row["mf"])
        message = bsm.decode(frame)
        core = message.core
        assert bsm.encode(message) == frame, row["src"]
        read = {
            "msgCnt": core.msg_cnt,
            "id": core.temporary_id.hex(),
            "secMark": _steps(core.sec_mark_s, 0.001, 65535),
            "lat": _steps(core.latitude_deg, 1e-7, 900_000_001),
            "long": _steps(core.longitude_deg, 1e-7, 1_800_000_001),
            "elev": _steps(core.elevation_m, 0.1, -4096),
            "speed": _steps(core.speed_m_s, 0.02, 8191),
            "heading": _steps(core.heading_rad, math.radians(0.0125), 28800),
            "width": _steps(core.size.width_m, 0.01, 0),
            "length": _steps(core.size.length_m, 0.01, 0),
        }
        expected = {name: value for name, value in row["expect"].items() if name in read}
        assert {name: read[name] for name in expected} == expected, row["src"]


def _steps(value: float | None, scale: float, unavailable: int) -> int:
    return unavailable if value is None else round(value / scale)


@pytest.mark.realdata
def test_sixteen_of_them_have_the_si_values_of_another_decoder(rig_data: Path) -> None:
    rows = [row for row in _vectors(rig_data) if "ode_json" in row["expect"]]
    assert len(rows) == 16
    for row in rows:
        core = bsm.decode(bytes.fromhex(row["mf"])).core
        printed = row["expect"]["ode_json"]
        assert core.latitude_deg == printed["position"]["latitude"]
        assert core.longitude_deg == printed["position"]["longitude"]
        assert core.elevation_m == printed["position"]["elevation"]
        assert core.speed_m_s == printed["speed"]
        assert math.degrees(a(float, core.heading_rad)) == pytest.approx(printed["heading"])
        assert core.acceleration.longitudinal_m_s2 == printed["accelSet"]["accelLong"]
        assert core.acceleration.lateral_m_s2 == printed["accelSet"]["accelLat"]
        yaw_deg_s = math.degrees(a(float, core.acceleration.yaw_rate_rad_s))
        assert yaw_deg_s == pytest.approx(printed["accelSet"]["accelYaw"])
        assert core.accuracy.semi_major_m == printed["accuracy"]["semiMajor"]
        assert core.accuracy.semi_minor_m == printed["accuracy"]["semiMinor"]
        assert core.brakes == BrakeSystemStatus()


@pytest.mark.realdata
def test_frames_followed_by_a_check_sequence_and_old_octets_of_a_buffer_are_read(
    rig_data: Path,
) -> None:
    text = (rig_data / "wsm/trailing-bytes.jsonl").read_text()
    rows = [json.loads(row) for row in text.splitlines()]
    followed: dict[str, list[tuple[bytes, bytes]]] = {"BSM": [], "SRM": []}
    for row in rows:
        data = bytes.fromhex(row["mf"])
        frame = data[: -row["bytes_after_frame"]]
        followed[row["message"]].append((frame, data[len(frame) :]))
        assert "error" not in describe(data)
    for frame, rest in followed["BSM"]:
        assert bsm.encode(bsm.decode(frame + rest)) == frame
    assert [len(followed[message]) for message in ("BSM", "SRM")] == [60, 20]
    for frames in followed.values():
        # A CRC is linear: two frames that differ in these octets and in the 12 bits of the sequence
        # number before them have check sequences that differ in a space of 12 dimensions, not 32.
        residues = [int.from_bytes(rest[:4], "little") ^ zlib.crc32(f) for f, rest in frames]
        assert _dimensions([each ^ residues[0] for each in residues]) <= 12


def _dimensions(vectors: list[int]) -> int:
    """Return the rank of vectors of bits."""
    basis: list[int] = []
    for vector in vectors:
        rest = reduce(lambda left, each: min(left, left ^ each), basis, vector)
        if rest:
            basis.append(rest)
    return len(basis)
