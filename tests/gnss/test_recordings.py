"""Real receivers: two drives against ground truth, and half a hundred makes against gpsd."""

import csv
import datetime as dt
import json
from collections import Counter
from pathlib import Path
from typing import Any

import pytest

from onboard.gnss.nmea import NmeaReader
from onboard.observations import Discarded, Position
from tests.typed import every

pytestmark = pytest.mark.realdata

GPS_ERA_S = 1024 * 7 * 86_400
"""Old receivers' dates are off by whole eras; gpsd moves them into the current one."""


def read(path: Path) -> list[Discarded | Position]:
    reader = NmeaReader()
    reader.receive_bytes(path.read_bytes())
    reader.receive_end()
    return list(iter(reader.next_event, None))


def rows(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="ascii") as file:
        return list(csv.DictReader(file))


def test_drive_a_agrees_with_its_ground_truth(rig_data: Path) -> None:
    positions = every(Position, read(rig_data / "gnss" / "drive-a.nmea"))
    places = rows(rig_data / "can" / "drive-a-gnss-position.csv")
    speeds = rows(rig_data / "can" / "drive-a-gnss-speed-mps.csv")
    assert len(positions) == len(places) == len(speeds) == 571
    for position, place, speed in zip(positions, places, speeds, strict=True):
        assert position.stamp_s == pytest.approx(float(place["t"]), abs=0.011)
        assert position.latitude_deg == pytest.approx(float(place["lat"]), abs=1e-7)
        assert position.longitude_deg == pytest.approx(float(place["lon"]), abs=1e-7)
        assert position.speed_m_s == pytest.approx(float(speed["gnss_mps"]), abs=5e-3)


def test_drive_c_has_a_position_wherever_it_has_a_fix(rig_data: Path) -> None:
    path = rig_data / "gnss" / "drive-c.nmea"
    events = read(path)
    fixes = [line for line in path.read_text(encoding="ascii").splitlines() if "RMC" in line]
    valid = [line for line in fixes if line.split(",")[2] == "A"]
    assert {type(event) for event in events} == {Position}
    assert len(events) == len(valid)
    assert 0 < len(valid) < len(fixes)


def gpsd_fixes(path: Path) -> dict[float, dict[str, Any]]:
    """gpsd's positions for a log: (position, height) by time within the era."""
    fixes = {}
    for line in path.read_text(encoding="latin-1").splitlines():
        if line.startswith('{"class":"TPV"'):
            tpv = json.loads(line)
            if tpv.get("mode", 0) >= 2 and "time" in tpv and "lat" in tpv:
                utc_s = dt.datetime.fromisoformat(tpv["time"]).timestamp()
                fixes[round(utc_s % GPS_ERA_S, 3)] = tpv
    return fixes


def test_receivers_of_many_makes_agree_with_gpsd(rig_data: Path) -> None:
    """All logs with NMEA; the others are binary."""
    counts = Counter[str]()
    makes = 0
    for log in sorted((rig_data / "gnss" / "receivers").glob("*.log")):
        gpsd = gpsd_fixes(log.with_suffix(".log.chk"))
        compared = 0
        for event in read(log):
            if isinstance(event, Discarded):
                counts[event.reason] += 1
                continue
            fix = gpsd.get(round(event.stamp_s % GPS_ERA_S, 3))
            if fix is None:
                counts["not in gpsd's"] += 1
                continue
            compared += 1
            assert event.latitude_deg == pytest.approx(fix["lat"], abs=1e-7), log.name
            assert event.longitude_deg == pytest.approx(fix["lon"], abs=1e-7), log.name
            if event.altitude_m is not None and "altHAE" in fix:
                counts["heights"] += 1
                counts["heights differ"] += abs(event.altitude_m - fix["altHAE"]) > 0.01
        counts["compared"] += compared
        makes += compared > 0
    assert makes >= 45
    assert counts["compared"] >= 870
    # First fixes, without a date in gpsd, five last fixes, which gpsd waits to complete, and logs
    # without any date.
    assert counts["not in gpsd's"] <= 31
    assert counts["heights differ"] <= 0.02 * counts["heights"]
    # firefly-II's GGA carries wrong checksums, hp58534a's sentences none, tcp-torture is edited,
    # and one log ends within a sentence.
    assert counts["nmea_checksum"] <= 41
    assert counts["nmea_field"] <= 2
