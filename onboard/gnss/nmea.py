"""One position for each fix of a receiver, from its NMEA sentences.

A receiver reports one fix in several sentences, in an order of its own: RMC has speed and date, VTG
the speed, GGA height and quality, GST the accuracy. Those with the same time of day are one
*epoch*; VTG has none, and belongs to the epoch before it. An epoch is complete with the kind of
sentence that ended the one before, and is reported at once, unless another one followed that kind
lately (RMC may come once for several GGA); else it is reported when the next one begins, as in
recordings, where nothing waits for it.
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
"""Longest line: a sentence has 82; binary messages between sentences have no line ends."""

DAY_S = 86_400

_REMEMBERED_EPOCHS = 20
"""Epochs for which a kind of sentence that another one followed ends no epoch; a receiver of 10 Hz
may send RMC in one of ten."""

_BETWEEN = re.compile(rb"\n|(?=\$)")
"""A sentence ends with its line, or truncated where the next one begins."""

_FIELDS = tuple(field.name for field in fields(Sentence))


@dataclass(slots=True)
class _Epoch:
    """The sentences of one time of day."""

    merged: Sentence
    began_at: float | None
    """Arrival of its first sentence."""
    is_reported: bool = False


class NmeaReader:
    """Receives bytes and returns `Position`s, at most one for each epoch."""

    def __init__(self, settings: GnssSettings | None = None) -> None:
        """Start without data, with `settings` or their defaults."""
        self._settings = settings or GnssSettings()
        self._clock = RemoteClock(self._settings.latency_s)
        self._unread = b""
        self._epoch: _Epoch | None = None
        self._ends_with: str | None = None
        self._epochs = 0
        self._followed: dict[str, int] = {}
        """By kind of sentence, the number of the last epoch in which another one followed it."""
        self._date: dt.date | None = None
        self._utc_s = -math.inf
        self._events: deque[Position | Discarded] = deque()

    def receive_bytes(self, data: bytes, now: float | None = None) -> None:
        """Receive bytes of the receiver, split anywhere.

        Without `now` (a recording without arrival times), stamps are the receiver's UTC, in seconds
        since 1970.
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

    def receive_end(self) -> None:
        """Report the last epoch: a recording has ended."""
        self.receive_bytes(b"\n")
        if self._epoch is not None:
            self._report(self._epoch, None)

    def next_event(self) -> Position | Discarded | None:
        """The oldest event not yet taken."""
        return self._events.popleft() if self._events else None

    def _receive_sentence(self, sentence: Sentence, now: float | None) -> None:
        epoch = self._epoch
        if sentence.kind == "ZDA":
            date = sentence.date or self._date
            is_new_day = self._date not in {None, date}
            if is_new_day and epoch and epoch.merged.time_of_day_s != sentence.time_of_day_s:
                self._report(epoch, now)  # it is of the day before
            self._date = date
        if sentence.kind == "VTG":
            if epoch is not None:
                self._join(epoch, sentence, now)
        elif sentence.kind != "ZDA" and sentence.time_of_day_s is not None:
            if epoch is not None and epoch.merged.time_of_day_s == sentence.time_of_day_s:
                self._join(epoch, sentence, now)
            else:
                self._begin(sentence, now)

    def _begin(self, sentence: Sentence, now: float | None) -> None:
        if self._epoch is not None:
            self._report(self._epoch, now)
            self._ends_with = self._epoch.merged.kind
        self._epochs += 1
        self._epoch = _Epoch(sentence, began_at=now)
        self._report_if_complete(self._epoch, now)

    def _join(self, epoch: _Epoch, sentence: Sentence, now: float | None) -> None:
        self._followed[epoch.merged.kind] = self._epochs
        epoch.merged = _merged(epoch.merged, sentence)
        self._report_if_complete(epoch, now)

    def _report_if_complete(self, epoch: _Epoch, now: float | None) -> None:
        kind = epoch.merged.kind
        followed_in = self._followed.get(kind, -_REMEMBERED_EPOCHS)
        is_last = kind == self._ends_with and self._epochs - followed_in >= _REMEMBERED_EPOCHS
        if now is not None and is_last:
            self._report(epoch, now)

    def _report(self, epoch: _Epoch, now: float | None) -> None:
        merged = epoch.merged
        if (
            epoch.is_reported
            or not merged.is_fix
            or merged.latitude_deg is None
            or merged.longitude_deg is None
        ):
            return
        epoch.is_reported = True
        utc_s = self._utc_of(merged)
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
                latitude_deg=merged.latitude_deg,
                longitude_deg=merged.longitude_deg,
                altitude_m=merged.altitude_m,
                sigma_m=max(self._sigma_m(merged), self._settings.least_sigma_m),
                speed_m_s=merged.speed_m_s,
                course_rad=None if merged.course_deg is None else math.radians(merged.course_deg),
            )
        )

    def _utc_of(self, merged: Sentence) -> float | None:
        """Seconds since 1970; without a date of its own, in the day after the last time."""
        self._date = merged.date or self._date
        if self._date is None or merged.time_of_day_s is None:
            return None
        midnight = dt.datetime.combine(self._date, dt.time(), dt.UTC)
        utc_s = midnight.timestamp() + merged.time_of_day_s
        if merged.date is None and utc_s < self._utc_s - DAY_S / 2:
            utc_s += DAY_S * math.ceil((self._utc_s - DAY_S / 2 - utc_s) / DAY_S)
        self._utc_s = utc_s
        return utc_s

    def _sigma_m(self, merged: Sentence) -> float:
        if merged.sigma_north_m is not None and merged.sigma_east_m is not None:
            return sigma_of_axes_m(merged.sigma_north_m, merged.sigma_east_m)
        return sigma_from_hdop_m(merged.hdop, merged.quality)

    def _discard(self, reason: str, detail: str, now: float | None) -> None:
        stamp_s = now if now is not None else max(self._utc_s, 0.0)
        self._events.append(Discarded(stamp_s, "gnss", reason, detail))


def _merged(earlier: Sentence, later: Sentence) -> Sentence:
    """Merge two sentences: the later one's values, but one without a fix voids both."""
    values = {name: value for name in _FIELDS if (value := getattr(later, name)) is not None}
    if earlier.is_fix is False:
        values["is_fix"] = False
    return replace(earlier, **values)
