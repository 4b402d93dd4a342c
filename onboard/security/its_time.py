"""The clock of 1609.2: TAI since 00:00:00 UTC on 1 January 2004 (Time32 and Time64)."""

_EPOCH_UTC_S = 1_072_915_200
LEAP_SECONDS = 5
"""Leap seconds since the epoch, the last at the end of 2016; to be updated with the next."""


def to_time64(utc_s: float) -> int:
    """Return microseconds since the epoch; `utc_s` counts seconds since 1970."""
    return round((utc_s - _EPOCH_UTC_S + LEAP_SECONDS) * 1e6)


def from_time64(time64: int) -> float:
    """Return UTC in seconds since 1970."""
    return time64 / 1e6 + (_EPOCH_UTC_S - LEAP_SECONDS)


def to_time32(utc_s: float) -> int:
    """Return whole seconds since the epoch."""
    return to_time64(utc_s) // 1_000_000


def from_time32(time32: int) -> float:
    """Return UTC in seconds since 1970."""
    return float(time32 + _EPOCH_UTC_S - LEAP_SECONDS)
