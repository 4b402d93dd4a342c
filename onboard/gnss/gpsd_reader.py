"""Positions from gpsd's JSON reports (gpsd_json(5)).

TPV has time, position and velocity, GST the accuracy, SKY the dilution of precision.

The receiver's own accuracy (GST) takes precedence over gpsd's estimate from the dilution: gpsd 3.22
does not copy the former into its TPV, and its estimate is for a poor receiver. gpsd may report one
fix several times, as its parts arrive; only the first is used, since a measurement must not count
twice.
"""

import datetime as dt
import json
import math
import re
from collections import deque
from typing import Any

from onboard.gnss.accuracy import known_dop, sigma_from_hdop_m, sigma_of_axes_m
from onboard.gnss.settings import GnssSettings
from onboard.observations import Discarded, Position
from onboard.sensors.remote_clock import RemoteClock

WATCH = b'?WATCH={"enable":true,"json":true};\n'
"""Command by which a client subscribes to all reports."""

MAX_LINE_BYTES = 65_536
"""Longest report; a SKY report with a hundred satellites has some ten thousand."""

MODE_2D = 2

PER_AXIS_95 = 1.960
PER_CIRCLE_95 = 2.448
"""gpsd's error estimates have 95 % confidence (its error model): in standard deviations of the
normal distribution on one axis, and of the Rayleigh distribution of the distance."""

GST_VALID_S = 2.0
"""Time for which a reported accuracy is valid."""

_QUALITY_BY_STATUS = {2: 2, 3: 4, 4: 5, 5: 6}
"""GGA quality by TPV status (2 differential, 3 RTK fixed, 4 RTK float, 5 dead reckoning)."""

_LEAP_SECOND = re.compile(r"(?<=:\d\d):60(?=[.Z])")

REPORT_START = b'{"class":'
"""First bytes of every report, gpsd_json(5)."""


class ReportError(Exception):
    """A report that violates gpsd_json(5)."""


class GpsdReader:
    """Receives bytes and returns `Position`s."""

    def __init__(self, settings: GnssSettings | None = None) -> None:
        """Start without data, with `settings` or their defaults."""
        self._settings = settings or GnssSettings()
        self._clock = RemoteClock(self._settings.latency_s)
        self._unread = b""
        self._hdop: float | None = None
        self._gst: tuple[float, float] | None = None
        """UTC of the last report of the receiver's accuracy, and sigma."""
        self._last_time: str | None = None
        self._utc_s = 0.0
        """UTC of the last position of a recording."""
        self._events: deque[Position | Discarded] = deque()

    def receive_bytes(self, data: bytes, now: float | None = None) -> None:
        """Receive bytes of gpsd, split anywhere.

        Without `now` (a recording without arrival times), stamps are the receiver's UTC, in seconds
        since 1970.
        """
        *lines, self._unread = (self._unread + data).split(b"\n")
        if len(self._unread) > MAX_LINE_BYTES:
            self._unread = b""
            self._discard("gpsd_report", "a line without an end", now)
        for line in lines:
            if not line.startswith(REPORT_START):  # faster than parsing it as JSON
                self._discard("gpsd_report", f"not a report: {line[:80]!r}", now)
                continue
            try:
                self._receive_report(json.loads(line), now)
            except (ValueError, RecursionError, ReportError) as error:
                self._discard("gpsd_report", f"{error}: {line[:80]!r}", now)

    def next_event(self) -> Position | Discarded | None:
        """The oldest event not yet taken."""
        return self._events.popleft() if self._events else None

    def _receive_report(self, report: Any, now: float | None) -> None:
        match report:
            case {"class": "TPV"}:
                self._receive_tpv(report, now)
            case {"class": "SKY", "hdop": _}:  # others tell of satellites only
                self._hdop = known_dop(_number(report, "hdop", 0.0, 1e6))
            case {"class": "GST"}:
                self._receive_gst(report)
            case {"class": "ERROR"}:
                self._discard("gpsd_error", str(report.get("message")), now)
            case {"class": str()}:
                pass
            case _:
                raise ReportError("not a report")

    def _receive_tpv(self, tpv: dict[str, Any], now: float | None) -> None:
        latitude_deg = _number(tpv, "lat", -90.0, 90.0)
        longitude_deg = _number(tpv, "lon", -180.0, 180.0)
        mode = _number(tpv, "mode", 0.0, 3.0)
        if mode is None or mode < MODE_2D or latitude_deg is None or longitude_deg is None:
            return
        time = tpv.get("time")
        if time is not None and time == self._last_time:
            return
        utc_s = None if time is None else _utc_s(time)
        if now is not None:
            stamp_s = self._clock.receive_stamp(utc_s, now)
        elif utc_s is not None:
            stamp_s = self._utc_s = utc_s
        else:
            raise ReportError("a recording needs the time of each fix")
        course_deg = _number(tpv, "track", 0.0, 360.0)
        position = Position(
            stamp_s=stamp_s,
            latitude_deg=latitude_deg,
            longitude_deg=longitude_deg,
            altitude_m=_number(tpv, "altHAE", -1000.0, 100_000.0),
            sigma_m=max(self._sigma_m(tpv, utc_s), self._settings.least_sigma_m),
            speed_m_s=_number(tpv, "speed", 0.0, 1000.0),
            course_rad=None if course_deg is None else math.radians(course_deg),
        )
        self._last_time = time
        self._events.append(position)

    def _receive_gst(self, gst: dict[str, Any]) -> None:
        north_m, east_m = _number(gst, "lat", 0.0, 1e6), _number(gst, "lon", 0.0, 1e6)
        if north_m is not None and east_m is not None and gst.get("time") is not None:
            self._gst = _utc_s(gst["time"]), sigma_of_axes_m(north_m, east_m)

    def _sigma_m(self, tpv: dict[str, Any], utc_s: float | None) -> float:
        if self._gst is not None and utc_s is not None:
            gst_s, sigma_m = self._gst
            if abs(utc_s - gst_s) <= GST_VALID_S:
                return sigma_m
        north_m = _number(tpv, "epy", 0.0, 1e6)
        east_m = _number(tpv, "epx", 0.0, 1e6)
        if north_m is not None and east_m is not None:
            return sigma_of_axes_m(north_m, east_m) / PER_AXIS_95
        radius_m = _number(tpv, "eph", 0.0, 1e6)
        if radius_m is not None:
            return radius_m / PER_CIRCLE_95
        status = _number(tpv, "status", 0.0, 99.0)
        quality = _QUALITY_BY_STATUS.get(int(status or 0))
        return sigma_from_hdop_m(self._hdop, quality)

    def _discard(self, reason: str, detail: str, now: float | None) -> None:
        stamp_s = now if now is not None else self._utc_s
        self._events.append(Discarded(stamp_s, "gnss", reason, detail))


def _number(report: dict[str, Any], name: str, least: float, most: float) -> float | None:
    value = report.get(name)
    if value is None:
        return None
    if isinstance(value, bool) or not isinstance(value, int | float) or not least <= value <= most:
        raise ReportError(f"{name} is {value!r}")
    return float(value)


def _utc_s(time: object) -> float:
    if not isinstance(time, str):
        raise ReportError(f"time is {time!r}")
    without_leap, leaps = _LEAP_SECOND.subn(":59", time)  # `datetime` has none
    utc = dt.datetime.fromisoformat(without_leap)
    if utc.tzinfo is None:  # it would be taken for local time
        raise ReportError(f"time {time} names no zone")
    return utc.timestamp() + leaps
