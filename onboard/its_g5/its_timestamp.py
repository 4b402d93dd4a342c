"""TimestampIts: milliseconds of TAI since 2004 (TS 102 894-2, A.82), and what is left of it."""

from onboard.security.its_time import from_time64, to_time64


def timestamp_ms(utc_s: float) -> int:
    """Return the timestamp; `utc_s` counts seconds since 1970. Zero before 2004."""
    return max(0, round(to_time64(utc_s) / 1e3))


def utc_of(timestamp_s: float) -> float:
    """Return UTC in seconds since 1970 of a timestamp in seconds."""
    return from_time64(round(timestamp_s * 1e6))


def nearest_utc_s(remainder_ms: int, period_ms: int, utc_s: float) -> float:
    """Return the time whose timestamp leaves `remainder_ms`, the one nearest to `utc_s`.

    Args:
        remainder_ms: timestamp modulo `period_ms`.
        period_ms: at which it repeats.
        utc_s: the present time, seconds since 1970.
    """
    now_ms = timestamp_ms(utc_s)
    half = period_ms // 2
    age_ms = (now_ms - remainder_ms + half) % period_ms - half
    return from_time64((now_ms - age_ms) * 1000)
