"""What the host vehicle has sent of its tracks, in footers, CPMs and SDSMs."""

import math
from collections.abc import Iterable
from dataclasses import dataclass, field
from weakref import WeakKeyDictionary

from onboard.kinematics.arrays import Array
from onboard.mvs.footer_coding import free_number
from onboard.tracking.evidence import Estimate, Evidence, MeasurementId, measured_ms
from onboard.tracking.track import Track

MAXIMUM_INTERVAL_MS = 1_000
"""T_GenCpmMax: of two CPMs about an object."""
POSITION_CHANGE_M = 4.0
SPEED_CHANGE_M_S = 0.5
HEADING_CHANGE_RAD = math.radians(4.0)
"""Since the last CPM about it, any of which is a reason for the next."""
STANDSTILL_M_S = 1.0
_ROUNDING_MS = 1
_KEPT_MS = 2_000
"""Measurements older than this are forgotten: they are too old to be sent again."""


@dataclass(slots=True, eq=False)
class SentOfTrack:
    """What was sent of one track. Times are ms of UTC."""

    wire_number: int | None = None
    """The host vehicle's number for it on the air, once it was sent."""
    measurements: set[MeasurementId] = field(default_factory=set)
    """Those in footers or CPMs."""
    footer_ms: int = 0
    """When it was last in one."""
    state: Array | None = None
    """That it had in the last CPM (4)."""
    sdsm_ms: int = 0
    """Time of the last own measurement of it that was sent in an SDSM."""

    def is_due(self, estimate: Estimate, now_ms: int) -> bool:
        """Whether a CPM is to have it: as new, changed, or not sent for a second.

        Source: TS 103 324 V2.1.1, 6.1.2.3. The direction of what stands is not compared.
        """
        if self.state is None or now_ms - self.footer_ms >= MAXIMUM_INTERVAL_MS - _ROUNDING_MS:
            return True
        moved_m = math.hypot(*(estimate.state[:2] - self.state[:2]))
        speed_m_s = math.hypot(*estimate.state[2:])
        before_m_s = math.hypot(*self.state[2:])
        turned_rad = 0.0
        if min(speed_m_s, before_m_s) >= STANDSTILL_M_S:
            turned_rad = math.remainder(
                math.atan2(*estimate.state[2:]) - math.atan2(*self.state[2:]), math.tau
            )
        return (
            moved_m > POSITION_CHANGE_M
            or abs(speed_m_s - before_m_s) > SPEED_CHANGE_M_S
            or abs(turned_rad) > HEADING_CHANGE_RAD
        )


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

    def receive_sent(
        self, entries: Iterable[tuple[int, Evidence]], tracks: Iterable[Track], now_ms: int
    ) -> None:
        """Note what a footer or CPM has of `tracks`, each piece under its number on the air."""
        by_number = {self[track].wire_number: track for track in tracks}
        for number, piece in entries:
            track = by_number[number]
            sent = self[track]
            sent.footer_ms, sent.state = now_ms, track.estimate.state
            sent.measurements |= piece.provenance
            sent.measurements = {
                each for each in sent.measurements if measured_ms(each) > now_ms - _KEPT_MS
            }

    def merge(self, kept: Track, merged: Track) -> None:
        """Take what was sent of one track for sent of another, of the same vehicle."""
        self[kept].measurements |= self[merged].measurements
