"""The tracker: assigns evidence to tracks, starts, confirms, merges and drops tracks.

A track stores nothing but its evidence. Evidence expires, and a track without evidence is dropped.

Every sender, own sensors included, has a number of its own for a vehicle and keeps it. Evidence
under a label (sender, number) that was associated before goes to the same track while it lies in
the track's gate. Evidence under a new label is associated by position only where that is certain;
otherwise it starts a tentative track, which is merged with another when both are certain enough.
"""

from collections import Counter, defaultdict
from collections.abc import Generator, Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import accumulate, count, groupby

import numpy as np

from onboard.kinematics.arrays import Array, StateArrays
from onboard.tracking.association import (
    OVERLAP_M,
    PRIOR_SPEED_SIGMA_M_S,
    UnassociatedEvidence,
    compare,
)
from onboard.tracking.common_errors import ObserverSigma, common_variance_m2
from onboard.tracking.evidence import as_arrays
from onboard.tracking.evidence_store import (
    OWN,
    EvidenceBatch,
    EvidenceStore,
    Label,
    StoredEvidence,
)
from onboard.tracking.fusion import fuse_chosen, fuse_stored
from onboard.tracking.gates import GATE_PROBABILITY, are_inside, gates, with_speed_prior
from onboard.tracking.slices import batches, result_of
from onboard.tracking.track import Track
from onboard.tracking.track_merging import (
    choose_reported,
    merge_tracks,
    position_variances,
)

MAX_TRACKS = 256
"""Vehicles without radio at once; bounds computing time."""
MAX_TRACKS_PER_SENDER = 64
"""Tracks that one sender may start; also the number reserved for own sensors."""
CONFIRMATIONS = 3
"""Different times of measurements after which a track is confirmed."""
SETTLED_MS = 600
"""Evidence older than this is chosen for good: older than any that is shared (`SHARED_SPAN_S` in
`mvs`), so that evidence that still arrives has little in common with it."""

_REMOTE_MATCH_PROBABILITY = 0.9
"""Gate in which a track counts as a vehicle with a radio. Narrower than for evidence: a vehicle
wrongly matched with its neighbour is hidden, one that is missed is matched at the next update."""
_BSM_OFFSET_SIGMA_M = 0.5
"""Offset between a BSM's position and the measured centre of the vehicle, beside noise."""
_LARGEST_EXPLAINING_VARIANCE = 2 * 5.0**2
"""In m^2, of both axes: a vehicle with a radio that is placed worse than to 5 m explains no track
that own sensors measure."""
_HEADWAY_S, _LONGEST_HEADWAY_M = 0.2, 2.0
"""Headway that no vehicle is without, and its longest way: with `OVERLAP_M`, a vehicle at 36 km/h
and more has no other one within 3.5 m along its course."""
_REMOTE_MATCH_HOLD_MS = 500
"""Time for which a track counts as a vehicle with a radio after the last match."""
_BSM_PREDICTION_MS = 500
"""Time for which a vehicle with a radio is predicted from its last BSM: braking hard, it is then
1 m off."""
_ENTRIES_AT_ONCE = 64
"""Entries that are compared with all tracks together: enough for arrays to pay, few enough to bound
the work that a hostile sender causes."""
_ENTRIES_TOGETHER = 16
"""With more entries, what is done with all of them takes several slices: of 50 it takes 4 ms."""
_STARTS_AT_ONCE = 8
"""Entries that are associated by position, or start tracks, in one slice."""

TRACKS_AT_ONCE = 16
"""With more tracks, an update is done in slices."""
_CHOICES_AT_ONCE = 16
"""Tracks whose evidence is chosen in one slice."""
_VARIANCES_AT_ONCE = 32
"""Tracks whose common variance is computed in one slice."""
_ENDS_AT_ONCE = 64
"""Tracks of which one slice drops or settles what is old."""

_ReportId = tuple[bytes, int]
"""Sender and time of receipt of a report, the entries of one footer or image."""
_TracksOfReport = defaultdict[_ReportId, set[int]]


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackingParameters:
    """Parameters of the tracker that studies vary."""

    acceleration_density: float = 2.0
    """q of the process noise, m^2/s^3: speeds drift by sqrt(q) m/s in one second."""
    memory_s: float = 2.0
    """Evidence with an older measurement is not used."""
    unseen_s: float = 1.5
    """A vehicle without a measurement for this long is dropped: measurements that arrive through
    a third vehicle are up to 0.4 s old."""


DEFAULTS = TrackingParameters()


class Tracks:
    """All tracks of vehicles without radio; times are ms of UTC."""

    def __init__(
        self,
        parameters: TrackingParameters = DEFAULTS,
        observer_sigma_m: ObserverSigma = lambda _: 0.0,
    ) -> None:
        self._parameters = parameters
        self._observer_sigma_m = observer_sigma_m
        self._tracks: list[Track] = []
        self.merged: list[tuple[Track, Track]] = []
        """By the last update: what was kept, and what it was merged with."""
        self._by_label: dict[Label, Track] = {}
        self._last_number = 0
        self._store = EvidenceStore()
        self._cached_states: StateArrays | None = None
        """Result of `_states`; `None` where it is to be computed."""

    def __iter__(self) -> Iterator[Track]:
        return iter(self._tracks)

    def __len__(self) -> int:
        return len(self._tracks)

    def receive_evidence(self, batch: EvidenceBatch) -> list[int]:
        """Assign each entry to the track of its vehicle, or start one.

        Returns:
            the rows for which no further track could be started.
        """
        return result_of(self.receive_in_slices(batch))

    def receive_in_slices(self, batch: EvidenceBatch) -> Generator[None, None, list[int]]:
        """Do what `receive_evidence` does in slices, one if there are few entries."""
        first_row = self._store.append(batch.entries)
        if len(batch) > _ENTRIES_TOGETHER:
            yield
        tracks_of_report: _TracksOfReport = defaultdict(set)
        unlabelled = yield from self._assign_labelled(batch, first_row, tracks_of_report)
        reports = [
            (list(rows), tracks_of_report[report])
            for report, rows in groupby(
                unlabelled, key=lambda row: (batch.senders[row], batch.received_ms[row])
            )
        ]
        refused: list[int] = []
        if len(batch) > _ENTRIES_TOGETHER:
            yield
        while reports:
            entries = accumulate(len(rows) for rows, _ in reports)
            together = max(1, sum(so_far <= _ENTRIES_AT_ONCE for so_far in entries))
            refused += yield from self._assign_unlabelled(batch, first_row, reports[:together])
            reports = reports[together:]
            if reports:
                yield
        return refused

    def update(self, now_ms: int) -> None:
        """Drop old evidence, choose and fuse that of each track, confirm and merge tracks."""
        result_of(self.update_in_slices(now_ms))

    def update_in_slices(self, now_ms: int) -> Generator[None, None, None]:
        """Do what `update` does in slices, between which the tracks may be read."""
        parameters, q = self._parameters, self._parameters.acceleration_density
        memory_ms, unseen_ms = round(parameters.memory_s * 1000), round(parameters.unseen_s * 1000)
        self._tracks = [track for track in self._tracks if now_ms - track.last_ms <= unseen_ms]
        for some in batches(self._tracks, _ENDS_AT_ONCE):
            for track in some:
                track.drop_old(now_ms - memory_ms)
            yield
        # An estimate expires with its oldest measurement: a track can lose all before `unseen_s`.
        self._tracks = [track for track in self._tracks if track.stored]
        changed: list[Track] = []
        for some in batches(self._tracks, _CHOICES_AT_ONCE):
            changed += [track for track in some if track.choose_evidence()]
            yield
        yield from fuse_chosen(changed, self._store, now_ms, q)
        observer_sigma_m = cache(self._observer_sigma_m)
        for some in batches(changed, _VARIANCES_AT_ONCE):
            for track in some:
                provenance = track.estimate.provenance
                track.common_variance_m2 = common_variance_m2(provenance, observer_sigma_m)
            yield
        for some in batches(self._tracks, _ENDS_AT_ONCE):
            for track in some:
                track.settle(now_ms - SETTLED_MS)
                track.is_confirmed = track.is_confirmed or track.count_times() >= CONFIRMATIONS
            yield
        self._cached_states = None
        yield from self._merge(now_ms)
        yield from self._fuse_duplicates(observer_sigma_m)
        yield
        self._by_label = {label: track for track in self._tracks for label in track.labels}
        self._compact_store()

    def match_remote_vehicles(self, ids: Sequence[bytes], states: StateArrays, now_ms: int) -> None:
        """Find the tracks that are vehicles with a radio, or the host vehicle.

        A track that only others report is matched only where the two overlap, or would within the
        headway along the vehicle's course: its observer distinguished it from the vehicles with a
        radio that it receives. A track that own sensors measure is also matched within a gate, and
        the host vehicle in either case. What others claim never hides what own sensors measure:
        such a track is matched only while place and speed agree.

        Args:
            ids: temporary IDs of N vehicles, the host vehicle first.
            states: N reported states.
            now_ms: UTC.
        """
        offset = np.zeros((4, 4, 1))
        offset[:2, :2, 0] = _BSM_OFFSET_SIGMA_M**2 * np.eye(2)
        vehicles = StateArrays(
            states.stamps_ms, states.states, states.covariances + offset, states.has_speed
        )
        tracked = self._states()
        apart = _overlap_distances_m(states, tracked.positions_m(now_ms), now_ms)
        silent = now_ms - states.stamps_ms > _BSM_PREDICTION_MS
        silent[:1] = False
        apart[silent] = np.inf
        q = self._parameters.acceleration_density
        is_sensed = np.array([track.is_sensed for track in self._tracks], dtype=bool)
        may_match = (apart <= OVERLAP_M) | is_sensed
        may_match[:1] = True
        compared = compare(vehicles, tracked, GATE_PROBABILITY, q, near=may_match)
        variances = np.trace(vehicles.covariances[:2, :2])
        agrees = compared.inside & (variances <= _LARGEST_EXPLAINING_VARIANCE)[:, None]
        agrees |= ~is_sensed
        agrees[:1] = True
        apart[~agrees] = np.inf
        narrow = compared.narrowed(gates(vehicles, _REMOTE_MATCH_PROBABILITY))
        matched = narrow.among(None, agrees).assign()
        vehicle_of = {track: row for row, track in matched.items()}
        row_of = {temporary_id: row for row, temporary_id in enumerate(ids)}
        nearest_m = apart.min(axis=0, initial=np.inf).tolist()
        for at, track in enumerate(self._tracks):
            row = vehicle_of.get(at)
            if row is None and nearest_m[at] <= OVERLAP_M:
                row = int(apart[:, at].argmin())
            if row is not None:
                track.remote_vehicle_id = ids[row]
                track.remote_vehicle_until_ms = now_ms + _REMOTE_MATCH_HOLD_MS
            elif track.remote_vehicle_id is not None:
                row = row_of.get(track.remote_vehicle_id)
                is_over = now_ms > track.remote_vehicle_until_ms
                if is_over or row is None or not agrees[row, at]:
                    track.remote_vehicle_id = None

    def clear(self) -> None:
        """Drop all tracks; their numbers are not used again."""
        self._tracks.clear()
        self._by_label.clear()
        self._cached_states = None

    def change_frame(self, turn: Array, shift: Array) -> None:
        """Map everything into another frame (`LocalFrame.mapping_from`)."""
        self._store.change_frame(turn, shift)
        for track in self._tracks:
            track.estimate = track.estimate.mapped(turn, shift)
            if track.fused_with_duplicates is not None:
                track.fused_with_duplicates = track.fused_with_duplicates.mapped(turn, shift)
        self._cached_states = None

    def _assign_labelled(
        self, batch: EvidenceBatch, first_row: int, tracks_of_report: _TracksOfReport
    ) -> Generator[None, None, list[int]]:
        """Assign entries under known labels to their tracks, if they are inside the gates.

        Args:
            batch: entries.
            first_row: row of the first of them in the store.
            tracks_of_report: gets of each report the indices of the tracks that its rows belong to.

        Returns:
            the rows under new labels, in order.
        """
        labels = list(zip(batch.senders, batch.numbers, strict=True))
        labelled = [row for row, label in enumerate(labels) if label in self._by_label]
        unlabelled = [row for row, label in enumerate(labels) if label not in self._by_label]
        if not labelled:
            return unlabelled
        q = self._parameters.acceleration_density
        index_of = {track.number: at for at, track in enumerate(self._tracks)}
        indices = [index_of[self._by_label[labels[row]].number] for row in labelled]
        states = self._states()[indices]
        if len(labelled) > _ENTRIES_TOGETHER:
            yield
        inside = are_inside(batch.entries[labelled], states, GATE_PROBABILITY, q)
        if len(labelled) > _ENTRIES_TOGETHER:
            yield
        for done, row, index, fits in zip(
            count(), labelled, indices, inside.tolist(), strict=False
        ):
            if done and not done % _ENTRIES_AT_ONCE:
                yield
            if fits:
                self._add(self._tracks[index], batch, row, first_row + row)
                tracks_of_report[batch.senders[row], batch.received_ms[row]].add(index)
            else:
                self._remove_label(labels[row])
                unlabelled.append(row)
        return sorted(unlabelled)

    def _assign_unlabelled(
        self, batch: EvidenceBatch, first_row: int, reports: Sequence[tuple[list[int], set[int]]]
    ) -> Generator[None, None, list[int]]:
        """Associate entries under new labels with tracks, or start tracks for them.

        Args:
            batch: entries.
            first_row: row of the first of them in the store.
            reports: of each report, the rows under new labels, and the indices of the tracks that
                its other rows belong to: no two rows of a report are of one vehicle.

        Returns:
            the rows for which no further track could be started.
        """
        rows = [row for report, _ in reports for row in report]
        evidence = UnassociatedEvidence(
            batch.subset(rows),
            self._tracks,
            self._states(),
            self._parameters.acceleration_density,
        )
        if len(batch) > _ENTRIES_TOGETHER:
            yield
        started = Counter(track.first_sender for track in self._tracks)
        refused = []
        at, pause_at = 0, _STARTS_AT_ONCE
        for report, excluded in reports:
            if at >= pause_at:
                yield
                pause_at = at + _STARTS_AT_ONCE
            found = evidence.associate(range(at, at + len(report)), excluded)
            for row in report:
                sender, label = batch.senders[row], (batch.senders[row], batch.numbers[row])
                if (track := found.get(at)) is not None:
                    self._add(track, batch, row, first_row + row)
                elif self._may_start(sender, started[sender]):
                    track = self._start(label, self._stored(batch, row, first_row + row))
                    evidence.start_track(at, track)
                    started[sender] += 1
                else:
                    refused.append(row)
                if track is not None:
                    self._by_label[label] = track
                at += 1
        self._cached_states = evidence.vehicles
        return refused

    def _add(self, track: Track, batch: EvidenceBatch, row: int, store_row: int) -> None:
        track.add_label((batch.senders[row], batch.numbers[row]), batch.received_ms[row])
        if track.accepts(batch.provenances[row], is_firsthand=batch.firsthand[row]):
            track.add(self._stored(batch, row, store_row))

    def _stored(self, batch: EvidenceBatch, row: int, store_row: int) -> StoredEvidence:
        """Return an entry as evidence whose numbers are in `store_row`."""
        return StoredEvidence(
            batch.provenances[row],
            int(batch.spans.newest_ms[row]),
            int(batch.spans.oldest_ms[row]),
            not batch.entries.has_speed[row] or batch.senders[row] == OWN,
            batch.firsthand[row],
            batch.senders[row],
            batch.received_ms[row],
            self._store,
            store_row,
        )

    def _remove_label(self, label: Label) -> None:
        track = self._by_label.pop(label, None)
        if track is not None and label in track.labels:
            track.remove_labels([label])

    def _may_start(self, sender: bytes, started: int) -> bool:
        """Whether a sender that has `started` so many tracks may start another."""
        if sender == OWN:
            return len(self._tracks) < MAX_TRACKS
        return (
            len(self._tracks) < MAX_TRACKS - MAX_TRACKS_PER_SENDER
            and started < MAX_TRACKS_PER_SENDER
        )

    def _start(self, label: Label, first: StoredEvidence) -> Track:
        self._last_number += 1
        track = Track(self._last_number, first)
        track.add_label(label, first.received_ms)
        self._tracks.append(track)
        return track

    def _merge(self, now_ms: int) -> Generator[None, None, None]:
        tracks, states, q = self._tracks, self._states(), self._parameters.acceleration_density
        yield
        merged, duplicates = merge_tracks(tracks, states, now_ms, q)
        self.merged = [(tracks[into], tracks[at]) for at, into in merged.items()]
        kept = [at for at in range(len(states)) if at not in merged]
        if merged:
            self._tracks = [tracks[at] for at in kept]
            self._cached_states = states[kept]
        yield
        choose_reported(tracks, kept, duplicates, position_variances(states, now_ms, q))

    def _fuse_duplicates(self, observer_sigma_m: ObserverSigma) -> Generator[None, None, None]:
        """Fuse each reported track with its duplicates, as if they were merged."""
        with_others = []
        for track in self._tracks:
            track.fused_with_duplicates = None
            if track.duplicates:
                with_others.append(track)
        evidence = [
            [stored for one in (track, *track.duplicates) for stored in one.chosen]
            for track in with_others
        ]
        q = self._parameters.acceleration_density
        fused = yield from fuse_stored(evidence, self._store, q)
        for track, estimate in zip(with_others, fused, strict=True):
            common_m2 = common_variance_m2(estimate.provenance, observer_sigma_m)
            track.fused_with_duplicates = estimate.with_position_variance(common_m2)

    def _states(self) -> StateArrays:
        """The estimates of all tracks with a speed prior, as evidence is compared with them."""
        if self._cached_states is None:
            estimates = as_arrays([track.estimate for track in self._tracks])
            common_m2 = [track.common_variance_m2 for track in self._tracks]
            estimates.covariances[0, 0] += common_m2
            estimates.covariances[1, 1] += common_m2
            self._cached_states = with_speed_prior(estimates, PRIOR_SPEED_SIGMA_M_S)
        return self._cached_states

    def _compact_store(self) -> None:
        """Drop the rows of evidence that no track stores."""
        if self._store.is_sparse(sum(len(track.evidence) + len(track.settled) for track in self)):
            kept = {stored for track in self for stored in (*track.stored, *track.chosen)}
            self._store.compact([each.row for each in kept])
            for row, each in enumerate(kept):
                each.row = row


def _overlap_distances_m(states: StateArrays, positions_m: Array, now_ms: int) -> Array:
    """Distances (N, M) of positions (2, M) from N vehicles, less along a vehicle's course.

    `OVERLAP_M` is as far as the vehicle and its headway reach.
    """
    apart = positions_m[:, None, :] - states.positions_m(now_ms)[:, :, None]
    velocities = np.where(states.has_speed, states.states[2:], 0.0)
    speeds = np.hypot(*velocities)
    course = velocities / np.maximum(speeds, 1e-9)
    along = (apart * course[:, :, None]).sum(axis=0)
    across = np.sqrt(np.maximum((apart**2).sum(axis=0) - along**2, 0.0))
    headway_m = np.minimum(_HEADWAY_S * speeds, _LONGEST_HEADWAY_M)
    distances: Array = np.hypot(across, along * (OVERLAP_M / (OVERLAP_M + headway_m))[:, None])
    return distances
