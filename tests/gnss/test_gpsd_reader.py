"""Positions from gpsd's reports."""

import json
import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from onboard.gnss.gpsd_reader import GpsdReader
from onboard.gnss.settings import GnssSettings
from onboard.observations import Discarded, Position
from tests.typed import a, about, every

TPV: dict[str, Any] = {
    "class": "TPV",
    "device": "udp://127.0.0.1:5000",
    "mode": 3,
    "time": "2021-07-26T04:50:00.340Z",
    "lat": 56.104286,
    "lon": 10.145251,
    "altHAE": 63.5,
    "track": 90.0,
    "speed": 15.725,
    "epx": 3.92,
    "epy": 3.92,
    "eph": 19.0,
}
SATELLITES = {"class": "SKY", "satellites": []}
"""A report that states no dilution of precision."""


def read(
    *reports: Any, settings: GnssSettings | None = None, start: float = 100.1
) -> list[Discarded | Position]:
    reader = GpsdReader(settings)
    for n, report in enumerate(reports):
        line = report if isinstance(report, bytes) else json.dumps(report).encode() + b"\r\n"
        reader.receive_bytes(line, start + n)
    return list(iter(reader.next_event, None))


def positions_in(*reports: Any) -> list[Position]:
    return every(Position, read(*reports))


def without(*names: str, **more: int | list[int]) -> dict[str, Any]:
    return {name: value for name, value in TPV.items() if name not in names} | more


def test_a_report_is_a_position() -> None:
    assert read(TPV) == [
        Position(
            stamp_s=about(100.0),
            latitude_deg=56.104286,
            longitude_deg=10.145251,
            altitude_m=63.5,
            sigma_m=about(2.0),
            speed_m_s=15.725,
            course_rad=about(math.pi / 2),
        )
    ]


GST = {"class": "GST", "time": TPV["time"], "rms": 1.0, "lat": 0.9, "lon": 0.7, "alt": 2.0}


def test_the_receivers_accuracy_takes_precedence_over_gpsds_estimate() -> None:
    (position,) = positions_in(GST, TPV)

    assert position.sigma_m == pytest.approx(math.sqrt((0.9**2 + 0.7**2) / 2))


@pytest.mark.parametrize(
    "gst",
    [
        GST | {"time": "2021-07-26T04:49:50.000Z"},
        {name: value for name, value in GST.items() if name != "lat"},
        {name: value for name, value in GST.items() if name != "time"},
    ],
    ids=["old", "no axis", "no time"],
)
def test_an_old_or_incomplete_accuracy_is_ignored(gst: dict[str, float | str]) -> None:
    (position,) = positions_in(gst, TPV)

    assert position.sigma_m == pytest.approx(2.0)


def test_an_invalid_accuracy_is_discarded() -> None:
    discarded, position = read(GST | {"lat": -1.0}, TPV)

    assert a(Discarded, discarded).reason == "gpsd_report"
    assert a(Position, position).sigma_m == pytest.approx(2.0)


def test_unreported_values_are_none() -> None:
    (position,) = positions_in(without("altHAE", "track", "speed"))
    assert (position.altitude_m, position.course_rad, position.speed_m_s) == (None, None, None)


def test_a_fix_reported_in_parts_is_one_position() -> None:
    assert len(read(without("altHAE"), TPV, TPV)) == 1
    assert len(read(TPV, TPV | {"time": "2021-07-26T04:50:01.340Z"})) == 2


@pytest.mark.parametrize(
    "no_fix",
    [without("mode"), TPV | {"mode": 0}, TPV | {"mode": 1}, without("lat"), without("lon")],
)
def test_no_fix_is_no_position_and_no_fault(no_fix: dict[str, float | str]) -> None:
    assert read(no_fix) == []


def test_a_fix_without_time_is_stamped_by_arrival() -> None:
    first, second = read(without("time"), without("time"))
    assert (first.stamp_s, second.stamp_s) == pytest.approx((100.0, 101.0))


@pytest.mark.parametrize(
    ("reports", "sigma_m"),
    [
        ([TPV | {"epx": 1.96, "epy": 5.88}], math.sqrt(5)),
        ([without("epx")], 19.0 / 2.448),
        ([{"class": "SKY", "hdop": 1.5}, without("epx", "eph")], 6.0 / math.sqrt(2)),
        ([{"class": "SKY", "hdop": 1.5}, without("epx", "eph", status=2)], 3.0 / math.sqrt(2)),
        ([{"class": "SKY", "hdop": 5.0}, SATELLITES, without("epx", "eph")], 20.0 / math.sqrt(2)),
        ([{"class": "SKY", "hdop": 99.99}, without("epx", "eph")], 8.0 / math.sqrt(2)),
        ([without("epx", "epy", "eph")], 8.0 / math.sqrt(2)),
        ([TPV | {"epx": 0.0, "epy": 0.0}], 0.5),
    ],
)
def test_the_sigma_is_from_the_best_reported_value(
    reports: list[dict[str, float | str]], sigma_m: float
) -> None:
    assert positions_in(*reports)[0].sigma_m == pytest.approx(sigma_m)


def test_other_reports_are_ignored() -> None:
    others = [{"class": name} for name in ("VERSION", "DEVICES", "WATCH", "PPS", "GST", "ATT")]
    assert read(*others) == []


def test_an_error_report_of_gpsd_is_counted() -> None:
    (discarded,) = every(Discarded, read({"class": "ERROR", "message": "Can't open device"}))
    assert (discarded.reason, discarded.detail) == ("gpsd_error", "Can't open device")


@pytest.mark.parametrize(
    "report",
    [
        b"not json\n",
        b"\xff\xfe\n",
        b'{"class":"TPV","mode":3,"lat":56.1\n',
        b"[]\n",
        b"17\n",
        b"{}\n",
        b'{"class":"TPV","mode":3,"lat":NaN,"lon":10.0}\n',
        TPV | {"lat": 91},
        TPV | {"lon": "10.1"},
        TPV | {"lat": True},
        TPV | {"time": "yesterday"},
        without("epx", "eph", status=[2]),
        TPV | {"time": 17},
        TPV | {"time": "2026-03-01T12:00:00"},
        TPV | {"time": "2016-12-31T23:60Z"},
        TPV | {"time": "2016-12-31T23:59:61Z"},
        TPV | {"speed": -1},
        TPV | {"eph": -1, "epx": None},
        {"class": "SKY", "hdop": "good"},
    ],
)
def test_invalid_reports_are_discarded(report: Any) -> None:
    (discarded,) = every(Discarded, read(report))
    assert (discarded.component, discarded.reason) == ("gnss", "gpsd_report")


def test_a_line_without_an_end_is_dropped() -> None:
    discarded, position = read(b"x" * 100_000, b"\n", TPV)[-2:]
    assert isinstance(discarded, Discarded)
    assert isinstance(position, Position)


@given(cut=st.integers(0, 300))
def test_bytes_may_be_split_anywhere(cut: int) -> None:
    line = json.dumps(TPV).encode() + b"\n"
    reader = GpsdReader(GnssSettings(latency_s=0.0))
    reader.receive_bytes(line[:cut], 100.0)
    reader.receive_bytes(line[cut:], 100.0)
    assert isinstance(reader.next_event(), Position)


@given(st.binary(max_size=200))
def test_no_bytes_raise(data: bytes) -> None:
    for event in read(data, b"\n", b'{"class":"TPV",' + data + b"\n", TPV):
        assert isinstance(event, Position | Discarded)


def test_a_leap_second_is_as_long_as_any_other() -> None:
    reader = GpsdReader()
    for time in ("23:59:59.500Z", "23:59:60.500Z"):
        report = TPV | {"time": f"2016-12-31T{time}"}
        reader.receive_bytes(json.dumps(report).encode() + b"\n")
    before, leap = every(Position, list(iter(reader.next_event, None)))
    assert leap.stamp_s - before.stamp_s == 1.0
