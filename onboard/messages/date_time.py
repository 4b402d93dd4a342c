"""DDateTime of SAE J2735: a time, of which parts may be left out, or unavailable."""

from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Annotated

from onboard.errors import DecodeError
from onboard.messages.fields import Integer, Optional, Quantity

_SECOND_UNAVAILABLE = 65.535
_UNAVAILABLE = {"year": 0, "month": 0, "day": 0, "hour": 31, "minute": 60}
_PERIODS_MS = (("minute", 60_000), ("hour", 3_600_000), ("day", 86_400_000))
"""After which the time repeats without that field, the shortest first."""


@dataclass(frozen=True, slots=True)
class DateTime:
    """DDateTime: date and time in UTC, as far as they are stated."""

    year: Annotated[int | None, Optional(Integer(0, 4095))] = None
    month: Annotated[int | None, Optional(Integer(0, 12))] = None
    day: Annotated[int | None, Optional(Integer(0, 31))] = None
    hour: Annotated[int | None, Optional(Integer(0, 31))] = None
    minute: Annotated[int | None, Optional(Integer(0, 60))] = None
    second_s: Annotated[float | None, Optional(Quantity(0, 65535, 0.001, "s"))] = None
    """65.535: unavailable."""
    offset_s: Annotated[float | None, Optional(Quantity(-840, 840, 60.0, "s"))] = None
    """Of local time; the others are UTC."""

    @classmethod
    def of_utc(cls, utc_ms: int) -> "DateTime":
        """Return a time given in ms since 1970."""
        seconds, ms = divmod(utc_ms, 1000)
        utc = datetime.fromtimestamp(seconds, UTC)
        return cls(utc.year, utc.month, utc.day, utc.hour, utc.minute, utc.second + ms / 1000)

    def utc_ms(self, near_ms: int) -> int:
        """Return the time in ms since 1970; what it leaves out is such that it is near `near_ms`.

        Raises:
            DecodeError: `no_time` without the second, `out_of_range` for a day that is none.
        """
        if self.second_s is None or self.second_s >= _SECOND_UNAVAILABLE:
            raise DecodeError("no_time", "of the detections")
        near = DateTime.of_utc(near_ms)
        stated = {name: getattr(self, name) for name in _UNAVAILABLE}
        missing = {
            name: getattr(near, name)
            for name, code in _UNAVAILABLE.items()
            if stated[name] in (None, code)
        }
        try:
            minute = datetime(**(stated | missing), tzinfo=UTC)
        except ValueError as error:
            raise DecodeError("out_of_range", str(error)) from error
        utc_ms = round(minute.timestamp()) * 1000 + round(self.second_s * 1000)
        period_ms = next((ms for name, ms in _PERIODS_MS if name in missing), None)
        return (
            utc_ms
            if period_ms is None
            else utc_ms + period_ms * round((near_ms - utc_ms) / period_ms)
        )
