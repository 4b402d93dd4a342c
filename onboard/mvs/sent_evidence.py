"""What the host vehicle has sent of its tracks, in footers and SDSMs."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from weakref import WeakKeyDictionary

from onboard.mvs.footer_coding import free_number
from onboard.tracking.evidence import Evidence, MeasurementId
from onboard.tracking.track import Track

_KEPT_MS = 2_000
"""Measurements older than this are forgotten: they are too old to be sent again."""


@dataclass(slots=True, eq=False)
class SentOfTrack:
    """What was sent of one track. Times are ms of UTC."""

    wire_number: int | None = None
    """The host vehicle's number for it on the air, once it was sent."""
    measurements: set[MeasurementId] = field(default_factory=set)
    """Those in the footers."""
    footer_ms: int = 0
    """When it was last in a footer."""
    sdsm_ms: int = 0
    """Time of the last own measurement of it that was sent in an SDSM."""


class SentEvidence:
    """By track, as long as there is one."""

    def __init__(self) -> None:
        """Start with nothing sent."""
        self._of_tracks: WeakKeyDictionary[Track, SentOfTrack] = WeakKeyDictionary()

    def __getitem__(self, track: Track) -> SentOfTrack:
        """Return what was sent of a track."""
        return self._of_tracks.setdefault(track, SentOfTrack())

    def wire_number(self, track: Track, tracks: Iterable[Track]) -> int:
        """Return the number of a track on the air, the same in footers and SDSMs.

        Args:
            track: the track.
            tracks: all, whose numbers it does not get.
        """
        sent = self[track]
        if sent.wire_number is None:
            used = {self[each].wire_number for each in tracks}
            sent.wire_number = free_number(track.number, used)
        return sent.wire_number

    def receive_footer(
        self, entries: Iterable[tuple[int, Evidence]], tracks: Iterable[Track], now_ms: int
    ) -> None:
        """Note what a footer has of `tracks`, each piece under the track's number on the air."""
        by_number = {self[track].wire_number: self[track] for track in tracks}
        for number, piece in entries:
            sent = by_number[number]
            sent.footer_ms = now_ms
            sent.measurements |= piece.provenance
            sent.measurements = {
                each for each in sent.measurements if each.stamp_ms > now_ms - _KEPT_MS
            }

    def merge(self, kept: Track, merged: Track) -> None:
        """Take what was sent of one track for sent of another, of the same vehicle."""
        self[kept].measurements |= self[merged].measurements
