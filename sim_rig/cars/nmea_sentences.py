"""NMEA sentences of one fix: GGA, GST and RMC."""

import datetime as dt
from dataclasses import dataclass
from functools import reduce
from operator import xor

from onboard.kinematics.units import KNOT

GEOID_M = 46.0
"""Height of the geoid above the ellipsoid."""
HDOP = 0.9


@dataclass(frozen=True, slots=True)
class Fix:
    """What a receiver has found, WGS 84."""

    utc_s: float
    """Time of the fix, s since 1970, in whole hundredths."""
    latitude_deg: float
    longitude_deg: float
    height_m: float | None
    """Above the ellipsoid."""
    sigma_m: float
    """Standard deviation of each horizontal axis."""
    speed_m_s: float | None
    course_deg: float | None
    """Clockwise from true north."""


def sentences(fix: Fix) -> bytes:
    """Return the sentences; what is unknown is an empty field."""
    utc = dt.datetime.fromtimestamp(fix.utc_s, dt.UTC)
    time = f"{utc:%H%M%S}.{utc.microsecond // 10_000:02d}"
    place = f"{_degrees(fix.latitude_deg, 'NS', 2)},{_degrees(fix.longitude_deg, 'EW', 3)}"
    height = _number(None if fix.height_m is None else fix.height_m - GEOID_M)
    knots = _number(None if fix.speed_m_s is None else fix.speed_m_s / KNOT)
    course = _number(fix.course_deg)
    sigma = f"{fix.sigma_m:.2f},{fix.sigma_m:.2f},{2 * fix.sigma_m:.2f}"
    return b"".join(
        map(
            _sentence,
            (
                f"GNGGA,{time},{place},1,12,{HDOP},{height},M,{GEOID_M},M,,",
                f"GNGST,{time},,,,,{sigma}",
                f"GNRMC,{time},A,{place},{knots},{course},{utc:%d%m%y},,,A",
            ),
        )
    )


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:.3f}"


def _degrees(angle_deg: float, hemispheres: str, digits: int) -> str:
    """Format as `dddmm.mmmmmmm,h`; the last digit is 0.2 mm."""
    whole, minutes = divmod(round(abs(angle_deg) * 60.0, 7), 60.0)
    return f"{int(whole):0{digits}d}{minutes:010.7f},{hemispheres[angle_deg < 0.0]}"


def _sentence(text: str) -> bytes:
    return f"${text}*{reduce(xor, text.encode('ascii')):02X}\r\n".encode("ascii")
