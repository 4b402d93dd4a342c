"""The NMEA 0183 sentences about position, each parsed by itself.

RMC, GGA or GNS, and GST have everything about a fix, VTG and ZDA the velocity and the date if there
is no RMC; the others repeat parts of it.

A sentence is `$`, two letters of the talker (GP GPS, GL GLONASS, GA Galileo, GB BeiDou, GN several
...), three of the type, fields between commas, `*` and the XOR of all bytes between as two hex
digits (IEC 61162-1, 7.2). An empty field is an unknown value.
"""

import datetime as dt
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import reduce
from operator import xor

from onboard.gnss.accuracy import known_dop
from onboard.kinematics.units import KNOT

_SENTENCE = re.compile(rb"\$(?!P)([A-Z]{2})([A-Z]{3})(,[ -#%-)+-~]*)(?:\*([0-9A-Fa-f]{2}))?")
"""`$P` begins proprietary sentences."""

_NO_FIX_MODES = frozenset("NMS")
"""FAA mode: no fix, typed in by hand, simulated."""

_NO_FIX_QUALITIES = frozenset({0, 7, 8})
"""GGA quality: no fix, typed in by hand, simulated."""


class SentenceError(Exception):
    """An invalid sentence; `reason` is an identifier."""

    def __init__(self, reason: str, detail: str) -> None:
        super().__init__(detail)
        self.reason = reason


@dataclass(frozen=True, slots=True, kw_only=True)
class Sentence:
    """Values of one sentence; `None` is not stated. Without a fix, there is no position."""

    kind: str
    time_of_day_s: float | None = None
    date: dt.date | None = None
    is_fix: bool | None = None
    latitude_deg: float | None = None
    longitude_deg: float | None = None
    altitude_m: float | None = None
    """Height above the ellipsoid."""
    quality: int | None = None
    """Quality as in GGA."""
    hdop: float | None = None
    sigma_north_m: float | None = None
    sigma_east_m: float | None = None
    speed_m_s: float | None = None
    course_deg: float | None = None


def parse(line: bytes) -> Sentence | None:
    """Parse the sentence in `line`; `None` if there is none, or none about position.

    Raises:
        SentenceError: with reason `nmea_checksum`, or `nmea_field` if a field is invalid.
    """
    match = _SENTENCE.search(line)
    if match is None:
        return None
    read = _READERS.get(match[2].decode("ascii"))
    if read is None:
        return None
    text = match[0].decode("ascii")
    if match[4] is None:
        raise SentenceError("nmea_checksum", f"{text}: no checksum")
    checksum = reduce(xor, line[match.start() + 1 : match.start(4) - 1])
    if checksum != int(match[4], 16):
        raise SentenceError("nmea_checksum", f"{text}: its checksum is {checksum:02X}")
    fields = _Fields(match[3].decode("ascii").split(",")[1:])
    try:
        return read(fields)
    except (ValueError, OverflowError) as error:
        raise SentenceError("nmea_field", f"{text}: {error}") from error


class _Fields:
    """The fields of a sentence, counted from 0; missing ones at the end are empty."""

    def __init__(self, fields: list[str]) -> None:
        self._fields = fields

    def text(self, n: int) -> str:
        return self._fields[n].strip() if n < len(self._fields) else ""

    def number(self, n: int, least: float, most: float) -> float | None:
        text = self.text(n)
        if not text:
            return None
        value = float(text)
        if not least <= value <= most:
            raise ValueError(f"{text} is not within {least:g} to {most:g}")
        return value

    def time_of_day_s(self, n: int) -> float | None:
        """`hhmmss.ss`; a minute may have a leap second."""
        text = self.text(n)
        if not text:
            return None
        hours, minutes, seconds = int(text[:2]), int(text[2:4]), float(text[4:])
        if not (0 <= hours < 24 and 0 <= minutes < 60 and 0 <= seconds < 61):
            raise ValueError(f"{text} is not a time of day")
        return hours * 3600 + minutes * 60 + seconds

    def degrees(self, n: int, positive: str, negative: str, most_deg: int) -> float | None:
        """`dddmm.mmmm` and, in the next field, the hemisphere."""
        text, hemisphere = self.text(n), self.text(n + 1)
        if not text or not hemisphere:
            return None
        whole, minutes = divmod(float(text), 100)
        degrees = whole + minutes / 60
        if not (0 <= minutes < 60 and 0 <= degrees <= most_deg):
            raise ValueError(f"{text} is not an angle")
        if hemisphere not in (positive, negative):
            raise ValueError(f"{hemisphere!r} is not a hemisphere")
        return degrees if hemisphere == positive else -degrees

    def latitude_deg(self, n: int) -> float | None:
        return self.degrees(n, "N", "S", 90)

    def longitude_deg(self, n: int) -> float | None:
        return self.degrees(n, "E", "W", 180)

    def altitude_m(self, above_sea: int, geoid: int) -> float | None:
        """Above the ellipsoid: height above the sea and, in another field, the geoid's."""
        height = self.number(above_sea, -1000, 100_000)
        separation = self.number(geoid, -200, 200)
        return None if height is None or separation is None else height + separation


def _rmc(fields: _Fields) -> Sentence:
    """Recommended minimum: time, status, position, knots, course, date, declination, mode."""
    day = fields.text(8)
    knots = fields.number(6, 0, 2000)
    is_fix = fields.text(1) == "A" and fields.text(11) not in _NO_FIX_MODES
    return Sentence(
        kind="RMC",
        time_of_day_s=fields.time_of_day_s(0),
        date=None if not day else _date(int(day[:2]), int(day[2:4]), int(day[4:])),
        is_fix=is_fix,
        latitude_deg=fields.latitude_deg(2) if is_fix else None,
        longitude_deg=fields.longitude_deg(4) if is_fix else None,
        speed_m_s=None if knots is None else knots * KNOT,
        course_deg=fields.number(7, 0, 360),
    )


def _vtg(fields: _Fields) -> Sentence:
    """Velocity: course, T, magnetic course, M, knots, N, km/h, K, mode."""
    is_stated = fields.text(1) == "T" and fields.text(8) not in _NO_FIX_MODES
    knots = fields.number(4, 0, 2000) if is_stated else None
    return Sentence(
        kind="VTG",
        speed_m_s=None if knots is None else knots * KNOT,
        course_deg=fields.number(0, 0, 360) if is_stated else None,
    )


def _gga(fields: _Fields) -> Sentence:
    """Fix data: time, position, quality, satellites, HDOP, height, M, geoid, M."""
    quality = int(fields.text(5) or "0")
    is_fix = quality not in _NO_FIX_QUALITIES
    return Sentence(
        kind="GGA",
        time_of_day_s=fields.time_of_day_s(0),
        is_fix=is_fix,
        latitude_deg=fields.latitude_deg(1) if is_fix else None,
        longitude_deg=fields.longitude_deg(3) if is_fix else None,
        altitude_m=fields.altitude_m(8, 10),
        quality=quality,
        hdop=known_dop(fields.number(7, 0, 1e6)),
    )


def _gns(fields: _Fields) -> Sentence:
    """Fix data of several systems: time, position, a mode each, satellites, HDOP, height, geoid."""
    is_fix = bool(set(fields.text(5)) - _NO_FIX_MODES)
    return Sentence(
        kind="GNS",
        time_of_day_s=fields.time_of_day_s(0),
        is_fix=is_fix,
        latitude_deg=fields.latitude_deg(1) if is_fix else None,
        longitude_deg=fields.longitude_deg(3) if is_fix else None,
        altitude_m=fields.altitude_m(8, 9),
        hdop=known_dop(fields.number(7, 0, 1e6)),
    )


def _gst(fields: _Fields) -> Sentence:
    """Error statistics: time, residuals, the ellipse, then sigma of latitude and longitude."""
    return Sentence(
        kind="GST",
        time_of_day_s=fields.time_of_day_s(0),
        sigma_north_m=fields.number(5, 0, 1e6),
        sigma_east_m=fields.number(6, 0, 1e6),
    )


def _zda(fields: _Fields) -> Sentence:
    """Time and date: time, day, month, year."""
    day, month, year = (fields.text(n) for n in (1, 2, 3))
    return Sentence(
        kind="ZDA",
        time_of_day_s=fields.time_of_day_s(0),
        date=dt.date(int(year), int(month), int(day)) if day and month and year else None,
    )


_READERS: Mapping[str, Callable[[_Fields], Sentence]] = {
    "RMC": _rmc,
    "VTG": _vtg,
    "GGA": _gga,
    "GNS": _gns,
    "GST": _gst,
    "ZDA": _zda,
}


def _date(day: int, month: int, year: int) -> dt.date:
    """Date from a year of two digits: GPS began in 1980."""
    return dt.date(year + (1900 if year >= 80 else 2000), month, day)
