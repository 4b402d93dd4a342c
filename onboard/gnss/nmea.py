"""One position for each instant at which a receiver fixed it, from its NMEA sentences.

A receiver tells one fix in several sentences, and each kind of receiver in its own order: RMC has
speed and date, GGA height and quality, GST the accuracy. Those with the same time of day are one
*epoch*. It ends, as a rule, with the kind of sentence that ended the one before, and is told at
once then; where the rule does not hold, when the next one begins.
"""

import datetime as dt
import math
import re
from collections import deque
from dataclasses import dataclass, fields, replace

from onboard.gnss import nmea_sentence
from onboard.gnss.accuracy import sigma_from_hdop_m, sigma_of_axes_m
from onboard.gnss.nmea_sentence import Sentence, SentenceError
from onboard.gnss.settings import GnssSettings
from onboard.observations import Discarded, Position
from onboard.sensors.remote_clock import RemoteClock

MAX_LINE_BYTES = 1024
"""A sentence has 82; binary messages between sentences have no line ends."""

DAY_S = 86_400

_BETWEEN = re.compile(rb"\n|(?=\$)")
"""A sentence ends with its line, or torn where the next one begins."""

_FIELDS = tuple(field.name for field in fields(Sentence))


@dataclass(slots=True)
class _Epoch:
    """What has been said about one instant."""

    said: Sentence
    began_at: float | None
    """Arrival of its first sentence."""
    told: bool = False


class NmeaReader:
    """Takes bytes as they come and tells `Position`s, at most one for each epoch."""

    def __init__(self, settings: GnssSettings | None = None) -> None:
        self._settings = settings or GnssSettings()
        self._clock = RemoteClock(self._settings.latency_s)
        self._unread = b""
        self._epoch: _Epoch | None = None
        self._ends_with: str | None = None
        self._date: dt.date | None = None
        self._utc_s = -math.inf
        self._events: deque[Position | Discarded] = deque()

    def receive_bytes(self, data: bytes, now: float | None = None) -> None:
        """Take what the receiver sent, cut anywhere.

        Without `now` (a recording that has no arrival times) stamps are the receiver's UTC, in
        seconds since 1970.
        """
        *lines, self._unread = _BETWEEN.split(self._unread + data)
        if len(self._unread) > MAX_LINE_BYTES:
            self._unread = b""
        for line in lines:
            try:
                sentence = nmea_sentence.parse(line)
            except SentenceError as error:
                self._discard(error.reason, str(error), now)
                continue
            if sentence is not None:
                self._receive_sentence(sentence, now)

    def next_event(self) -> Position | Discarded | None:
        """The oldest event not yet taken."""
        return self._events.popleft() if self._events else None

    def _receive_sentence(self, sentence: Sentence, now: float | None) -> None:
        if sentence.kind == "ZDA":
            self._date = sentence.date or self._date
        if sentence.kind == "ZDA" or sentence.time_of_day_s is None:
            return
        epoch = self._epoch
        if epoch is None or epoch.said.time_of_day_s != sentence.time_of_day_s:
            if epoch is not None:
                self._tell(epoch, now)
                self._ends_with = epoch.said.kind
            epoch = self._epoch = _Epoch(sentence, began_at=now)
        else:
            epoch.said = _merged(epoch.said, sentence)
        if sentence.kind == self._ends_with:
            self._tell(epoch, now)

    def _tell(self, epoch: _Epoch, now: float | None) -> None:
        said = epoch.said
        if epoch.told or not said.is_fix or said.latitude_deg is None or said.longitude_deg is None:
            return
        epoch.told = True
        utc_s = self._utc_of(said)
        if epoch.began_at is not None:
            stamp_s = self._clock.receive_stamp(utc_s, epoch.began_at)
        elif utc_s is not None:
            stamp_s = utc_s
        else:
            self._discard("nmea_no_date", "a recording needs RMC or ZDA", now)
            return
        self._events.append(
            Position(
                stamp_s=stamp_s,
                latitude_deg=said.latitude_deg,
                longitude_deg=said.longitude_deg,
                altitude_m=said.altitude_m,
                sigma_m=max(self._sigma_m(said), self._settings.least_sigma_m),
                speed_m_s=said.speed_m_s,
                course_rad=None if said.course_deg is None else math.radians(said.course_deg),
            )
        )

    def _utc_of(self, said: Sentence) -> float | None:
        """Seconds since 1970; without a date of its own, in the day that follows the last one."""
        self._date = said.date or self._date
        if self._date is None or said.time_of_day_s is None:
            return None
        midnight = dt.datetime.combine(self._date, dt.time(), dt.UTC)
        utc_s = midnight.timestamp() + said.time_of_day_s
        if said.date is None and utc_s < self._utc_s - DAY_S / 2:
            utc_s += DAY_S * math.ceil((self._utc_s - DAY_S / 2 - utc_s) / DAY_S)
        self._utc_s = utc_s
        return utc_s

    def _sigma_m(self, said: Sentence) -> float:
        if said.sigma_north_m is not None and said.sigma_east_m is not None:
            return sigma_of_axes_m(said.sigma_north_m, said.sigma_east_m)
        return sigma_from_hdop_m(said.hdop, said.quality, self._settings.range_error_m)

    def _discard(self, reason: str, detail: str, now: float | None) -> None:
        stamp_s = now if now is not None else max(self._utc_s, 0.0)
        self._events.append(Discarded(stamp_s, "gnss", reason, detail))


def _merged(said: Sentence, more: Sentence) -> Sentence:
    """The later sentence counts, but one that doubts the fix is enough."""
    news = {name: value for name in _FIELDS if (value := getattr(more, name)) is not None}
    if said.is_fix is False:
        news["is_fix"] = False
    return replace(said, **news)
