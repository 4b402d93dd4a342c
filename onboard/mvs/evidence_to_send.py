"""Which evidence of its tracks a vehicle broadcasts, in footers, in CPMs and in SDSMs."""

from collections.abc import Callable, Collection, Generator, Sequence

import numpy as np

from onboard.mvs.selective_broadcasting import SELECTIONS, Candidate, Estimates
from onboard.mvs.sent_evidence import SentEvidence
from onboard.mvs.settings import MvsSettings
from onboard.tracking.evidence import Evidence, Measurement, observer_of, stamp_ms_of
from onboard.tracking.evidence_store import EvidenceView, StoredEvidence
from onboard.tracking.fusion import fuse_in_slices
from onboard.tracking.independent_set import independent, up_to
from onboard.tracking.slices import result_of
from onboard.tracking.track import Track

SHARED_SPAN_S = 0.5
"""The oldest measurement in anything that is broadcast is not older than this."""

_SPAN_MS = round(SHARED_SPAN_S * 1000)


class EvidenceToSend:
    """Selects among the evidence of tracks. Times are ms of UTC."""

    def __init__(
        self,
        settings: MvsSettings,
        rng: np.random.Generator,
        *,
        acceleration_density: float,
        max_measurements: int,
    ) -> None:
        """Start with nothing sent.

        Args:
            settings: the user's.
            rng: for the selections that choose at random.
            acceleration_density: q of the fusion, m^2/s^3.
            max_measurements: in one estimate.
        """
        self._settings = settings
        self._rng = rng
        self._acceleration_density = acceleration_density
        self._max_measurements = max_measurements
        self.sent = SentEvidence()
        self._selected_ms = 0
        """When evidence was last selected for a footer."""

    def restart(self) -> None:
        """Begin anew after a correction of UTC."""
        self._selected_ms = 0

    def of_footer(
        self, tracks: Sequence[Track], now_ms: int, own_ids: Collection[bytes]
    ) -> Generator[None, None, list[tuple[Track, Evidence]]]:
        """Select in slices what the footer has, of one track one piece.

        Args:
            tracks: of vehicles without radio.
            now_ms: the time.
            own_ids: under which own measurements are known.
        """
        since_ms, self._selected_ms = self._selected_ms, now_ms
        return (yield from self._select(tracks, now_ms, own_ids, lambda _: since_ms))

    def of_cpm(
        self, tracks: Sequence[Track], now_ms: int, own_ids: Collection[bytes]
    ) -> list[tuple[Track, Evidence]]:
        """Select what the CPM has: of each vehicle that is due what came since its last one.

        Arguments as of `of_footer`.
        """
        due = [track for track in tracks if self.sent[track].is_due(track.estimate, now_ms)]
        slices = self._select(due, now_ms, own_ids, lambda track: self.sent[track].footer_ms)
        return result_of(slices)

    def _select(
        self,
        tracks: Sequence[Track],
        now_ms: int,
        own_ids: Collection[bytes],
        since_ms: Callable[[Track], int],
    ) -> Generator[None, None, list[tuple[Track, Evidence]]]:
        both = [
            (track, self._candidate(track, now_ms, own_ids, since_ms(track))) for track in tracks
        ]
        known = [(track, candidate) for track, candidate in both if candidate is not None]
        yield
        selected = yield from SELECTIONS[self._settings.selection](
            [candidate for _, candidate in known],
            self._settings.max_entries,
            self._estimate,
            self._rng,
        )
        return [(known[at][0], piece) for at, piece in selected]

    def of_sdsm(
        self, tracks: Sequence[Track], now_ms: int, own_ids: Collection[bytes]
    ) -> list[tuple[Track, Measurement]]:
        """Take the newest own measurement of each vehicle, which then counts as sent.

        Those come first that were last sent the longest ago. Arguments as of `of_footer`.
        """
        measured = [
            (track, newest)
            for track in sorted(tracks, key=self._shared_ms)
            if (newest := self._newest_own(track, now_ms, own_ids)) is not None
        ][: self._settings.max_entries]
        for track, newest in measured:
            self.sent[track].sdsm_ms = newest.stamp_ms
        return measured

    def _candidate(
        self, track: Track, now_ms: int, own_ids: Collection[bytes], since_ms: int
    ) -> Candidate | None:
        """Return what Algorithm 1 gets of a vehicle: the MEs of the window that may be sent.

        The paper's window is the interval of the broadcasts, so it begins with the last one: what
        arrives in between is sent once, however punctual the broadcasts are. Evidence without a
        measurement that was not sent before is left out: old measurements make an estimate old.
        """
        sent = self.sent[track]
        received = [each for each in track.evidence.values() if each.received_ms >= since_ms]
        unsent = [
            each
            for each in received
            if each.oldest_ms >= now_ms - _SPAN_MS and not each.provenance <= sent.measurements
        ]
        if not unsent:
            return None
        is_sensed = any(_is_own_measurement(each, own_ids) for each in unsent)
        return Candidate(EvidenceView(unsent), len(received), is_sensed, sent.footer_ms)

    def _newest_own(
        self, track: Track, now_ms: int, own_ids: Collection[bytes]
    ) -> Measurement | None:
        """Return the newest own measurement that was not sent in an SDSM, if it is not too old."""
        since_ms = max(self._shared_ms(track), now_ms - _SPAN_MS)
        own = [
            each
            for each in track.evidence.values()
            if each.stamp_ms > since_ms and _is_own_measurement(each, own_ids)
        ]
        piece = max(own, key=stamp_ms_of).piece if own else None
        return piece if isinstance(piece, Measurement) else None

    def _shared_ms(self, track: Track) -> int:
        return self.sent[track].sdsm_ms

    def _estimate(self, evidence_of_vehicles: Sequence[Sequence[Evidence]]) -> Estimates:
        """The paper's Estimate: one ME from the independent ones of all MEs about a vehicle.

        Of more measurements than receivers accept in an estimate, the latest are used.
        """
        chosen = [self._chosen(evidence) for evidence in evidence_of_vehicles]
        several = [evidence for evidence in chosen if len(evidence) > 1]
        yield
        estimates = iter((yield from fuse_in_slices(several, self._acceleration_density)))
        return [next(estimates) if len(evidence) > 1 else evidence[0] for evidence in chosen]

    def _chosen(self, evidence: Sequence[Evidence]) -> list[Evidence]:
        """Return the pieces to be fused; of the others no objects are made."""
        assert isinstance(evidence, EvidenceView)  # noqa: S101 (as `_candidate` has made it)
        chosen = up_to(self._max_measurements, independent(evidence.stored))
        return [stored.piece for stored in chosen]


def _is_own_measurement(stored: StoredEvidence, own_ids: Collection[bytes]) -> bool:
    return stored.is_measurement and all(observer_of(each) in own_ids for each in stored.provenance)
