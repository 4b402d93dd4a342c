"""Logs of GNSS receivers in the formats that people have."""

import datetime as dt
import json
import shutil
from pathlib import Path

import pytest

from onboard.errors import UserError
from onboard.gnss.gnss_log import read_gnss_log
from onboard.observations import Discarded, Position
from tests.typed import a, about

BINARY = (
    "greis-binary",
    "navcom",
    "superstar2",
    "ublox-neo-m8n",
    "ublox-neo-m8t",
    "ublox-sirf1",
    "ublox-zed-f9t-rtcm3",
)

needs_gpsdecode = pytest.mark.skipif(
    shutil.which("gpsdecode") is None, reason="gpsdecode (gpsd-clients) is not installed"
)


def tpv(time: str, **fields: float) -> str:
    return json.dumps({"class": "TPV", "mode": 3, "time": time, **fields}) + "\n"


def test_gpsds_reports_are_stamped_with_the_receivers_time(tmp_path: Path) -> None:
    log = tmp_path / "gpspipe.json"
    log.write_text(
        '{"class":"VERSION","release":"3.22"}\n'
        + tpv("2026-03-01T12:00:00.000Z", lat=52.0, lon=13.0, speed=3.5, eph=2.448)
        + "half a li\n"
        + tpv("2026-03-01T12:00:01.000Z", lat=52.1, lon=13.0, eph=2.448)
        + tpv("2026-03-01T12:00:01.000Z", lat=52.1, lon=13.0, eph=2.448)
    )
    first, refused, second = read_gnss_log(log)
    noon_s = dt.datetime(2026, 3, 1, 12, tzinfo=dt.UTC).timestamp()
    assert isinstance(first, Position)
    assert (first.stamp_s, first.speed_m_s, first.sigma_m) == (noon_s, 3.5, about(1.0))
    assert isinstance(refused, Discarded)
    assert (refused.reason, refused.stamp_s) == ("gpsd_report", noon_s)
    assert second.stamp_s == noon_s + 1


def test_a_report_without_a_time_is_discarded(tmp_path: Path) -> None:
    log = tmp_path / "gpspipe.json"
    log.write_text(
        '{"class":"TPV","mode":3,"lat":52.0,"lon":13.0}\n'
        + tpv("2026-03-01T12:00:00.000Z", lat=52.0, lon=13.0)
    )
    refused, position = read_gnss_log(log)
    assert a(Discarded, refused).reason == "gpsd_report"
    assert refused.stamp_s == position.stamp_s


REPORTS = tuple(tpv(f"2026-03-01T12:00:0{second}.000Z", lat=52.0, lon=13.0) for second in (1, 2))


@pytest.mark.parametrize(
    "text",
    [
        '59.2,"lon":13.0}\n' + "".join(REPORTS),
        "\n\n" + "".join(REPORTS),
        "".join(f"2026-03-01 12:00:03: {each}" for each in REPORTS),
        "$GPGGA,120001,5200.0,N,01300.0,E,1,08,1.0,50.0,M,0.0,M,,*70\n" + "".join(REPORTS),
        "".join(REPORTS).removesuffix("\n"),
    ],
    ids=["cut at the start", "blank lines", "gpspipe -t", "gpspipe -wr", "no last line end"],
)
def test_gpsds_reports_are_found_wherever_they_begin(tmp_path: Path, text: str) -> None:
    log = tmp_path / "gpspipe.json"
    log.write_text(text)
    positions = [event for event in read_gnss_log(log) if isinstance(event, Position)]
    assert [each.stamp_s % 60 for each in positions] == [1, 2]


def test_a_log_of_which_no_position_can_be_used_says_why(tmp_path: Path) -> None:
    log = tmp_path / "gpspipe.json"
    log.write_text('{"class":"TPV","mode":3,"lat":52.0,"lon":13.0}\n')
    with pytest.raises(UserError, match=r"json: no position .* needs the time of each fix"):
        list(read_gnss_log(log))


def test_a_binary_log_without_gpsdecode_names_what_is_missing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    log = tmp_path / "drive.ubx"
    log.write_bytes(b"\xb5\x62\x01\x07" * 100)
    monkeypatch.setenv("PATH", "")
    with pytest.raises(UserError, match=r"drive\.ubx: .* needs gpsdecode .*gpsd-clients"):
        list(read_gnss_log(log))


@needs_gpsdecode
def test_noise_has_no_positions(tmp_path: Path) -> None:
    log = tmp_path / "noise.bin"
    log.write_bytes(bytes(range(256)) * 200)
    assert list(read_gnss_log(log)) == []


@needs_gpsdecode
@pytest.mark.realdata
@pytest.mark.parametrize("name", BINARY)
def test_binary_logs_agree_with_gpsd(rig_data: Path, name: str) -> None:
    """The reference is what another release of gpsd reported."""
    log = rig_data / "gnss" / "receivers" / f"{name}.log"
    fixes = {}
    for line in log.with_suffix(".log.chk").read_text(encoding="latin-1").splitlines():
        report = json.loads(line) if line.startswith('{"class":"TPV"') else {}
        if report.get("mode", 0) >= 2 and "time" in report and "lat" in report:
            fixes[dt.datetime.fromisoformat(report["time"]).timestamp()] = report
    positions = [event for event in read_gnss_log(log) if isinstance(event, Position)]
    compared = [(each, fixes[each.stamp_s]) for each in positions if each.stamp_s in fixes]
    assert len(compared) >= 0.8 * len(positions) > 0
    for position, fix in compared:
        assert position.latitude_deg == pytest.approx(fix["lat"], abs=1e-7)
        assert position.longitude_deg == pytest.approx(fix["lon"], abs=1e-7)
