"""The MVS sublayer of one car (section III): it sees, listens, tells, and knows the cars around it.

Without a position there is no MVS: nothing is measured, believed or sent.
"""

from collections import Counter, deque
from collections.abc import Sequence
from itertools import groupby

import numpy as np
from typing_extensions import override

from onboard.core import Core
from onboard.errors import DecodeError
from onboard.kinematics.heading import Heading
from onboard.kinematics.local_frame import LocalFrame
from onboard.mvs.footer_coding import encode_within, free_number, read
from onboard.mvs.footer_validation import OwnMeasurements, violations_of_received
from onboard.mvs.host_vehicle import HostVehicle, ReportedState
from onboard.mvs.perceived_object import ObjectSource, PerceivedObject
from onboard.mvs.received_footers import ReceivedFooter, SharedEntries, concatenate
from onboard.mvs.remote_vehicles import (
    RemoteVehicle,
    RemoteVehicles,
    as_kinematics,
    as_perceived_objects,
)
from onboard.mvs.selective_broadcasting import SELECTIONS, Candidate
from onboard.mvs.settings import MvsSettings
from onboard.observations import Discarded, Position, VehicleDetection
from onboard.tracking.evidence import (
    Evidence,
    Measurement,
    MeasurementId,
    ProvenanceSpans,
    as_arrays,
)
from onboard.tracking.evidence_store import OWN, EvidenceBatch, EvidenceView, StoredEvidence
from onboard.tracking.fusion import fuse, propagate
from onboard.tracking.independent_set import independent, up_to
from onboard.tracking.track import Track
from onboard.tracking.tracks import Tracks


class MultiVehicleSensing(Core):
    """One car's MVS. `now` and stamps are on the car's own clock, `utc_offset_s` behind UTC."""

    def __init__(
        self,
        settings: MvsSettings,
        own_id: bytes,
        rng: np.random.Generator,
        utc_offset_s: float = 0.0,
    ) -> None:
        """Start with nothing known.

        Args:
            settings: all that can be set.
            own_id: temporary ID of the own BSM, 4 bytes.
            rng: for the selections that choose at random.
            utc_offset_s: UTC less `now`.
        """
        self._settings = settings
        self._rng = rng
        self._utc_offset_s = utc_offset_s
        self._own_ids = deque([own_id], maxlen=2)
        self._own_stamps_ms: deque[int] = deque(maxlen=512)
        self._own = HostVehicle(settings.sensing)
        self._seen: deque[VehicleDetection] = deque(maxlen=1024)
        """Not yet assigned: the cars of one picture are assigned together."""
        self._heard: list[ReceivedFooter] = []
        """Not yet assigned: what has come in since somebody last asked is looked at together."""
        self._neighbours = RemoteVehicles()
        self._tracks = Tracks(settings)
        self._told_ms = 0
        """When the last footer was made, UTC."""
        self._refreshed_ms: int | None = None
        """When the tracks were last brought up to date."""
        self._events: deque[Discarded] = deque(maxlen=1024)

    @property
    def own_id(self) -> bytes:
        """The temporary ID under which the own measurements go out."""
        return self._own_ids[-1]

    def set_own_id(self, own_id: bytes) -> None:
        """Change the pseudonym; measurements made under the last one stay known as own ones."""
        if own_id != self.own_id:
            self._own_ids.append(own_id)

    def set_utc_offset(self, utc_offset_s: float) -> None:
        """Say anew what UTC less `now` is. What has been known by another UTC is forgotten."""
        if abs(utc_offset_s - self._utc_offset_s) > _UTC_STEP_S:
            self._tracks.clear()
            self._own_stamps_ms.clear()
            self._told_ms, self._refreshed_ms = 0, None
        self._utc_offset_s = utc_offset_s

    def has_position(self, now: float) -> bool:
        """Whether MVS is at work; without a position it is not."""
        return self._own.has_position(now)

    def receive_position(self, fix: Position) -> None:
        """The own car's position."""
        moved = self._own.receive_position(fix)
        if moved is not None:
            self._tracks.map_to(*moved)
            self._neighbours.map_to(*moved)
            turn, shift = moved
            for heard in self._heard:
                heard.sender_m = turn @ heard.sender_m + shift

    def receive_detection(self, seen: VehicleDetection) -> None:
        """A car that the own camera sees, whether it has a radio or not."""
        if self.has_position(seen.stamp_s):
            self._seen.append(seen)

    def receive_bsm(
        self,
        sender_id: bytes,
        state: Position | None,
        footer: bytes | SharedEntries | None,
        now: float,
        acceleration_m_s2: float | None = None,
    ) -> None:
        """What a car with a radio says of itself, and what it tells of others.

        Args:
            sender_id: temporary ID, 4 bytes.
            state: where it says it is; `stamp_s` on the own car's clock.
            footer: the MVS footer behind its BSM, as it came or already read.
            now: when it was received.
            acceleration_m_s2: what it says of its own, forwards.
        """
        if sender_id in self._own_ids:
            self._discard(now, "own_message", sender_id.hex())
        elif self.has_position(now):
            if state is not None:
                reported = self._own.place(state)
                refused = self._neighbours.receive(
                    sender_id,
                    reported,
                    acceleration_m_s2,
                    own_m=self._own_state().state[:2],
                    settings=self._settings.footer_validation,
                    now=now,
                )
                if refused is not None:
                    self._discard(now, *refused)
            if footer is not None:
                self._receive_footer(sender_id, footer, now)

    def footer_to_send(self, now: float) -> bytes:
        """Tell others; called with every BSM, at 10 Hz. Without a position there is nothing."""
        if not self.has_position(now):
            return b""
        now_ms = self._utc_ms(now)
        tracks = self.cars_without_radio(now)
        both = [(track, self._candidate(track, now_ms)) for track in tracks]
        known = [(track, candidate) for track, candidate in both if candidate is not None]
        select = SELECTIONS[self._settings.selection]
        selected = select(
            [candidate for _, candidate in known],
            self._settings.most_entries,
            self._estimate,
            self._rng,
        )
        chosen = []
        for at, piece in selected:
            track, _ = known[at]
            if track.wire_number is None:
                used = {each.wire_number for each in self._tracks}
                track.wire_number = free_number(track.number, used)
            chosen.append((track.wire_number, piece))
        self._told_ms = now_ms
        frame = self._own.frame
        assert frame is not None  # noqa: S101 (a position comes with a frame)
        anchor = LocalFrame(*self._own.anchor)
        data, fitting = encode_within(chosen, now_ms, frame, anchor, self._settings.most_bytes)
        called = {track.wire_number: track for track in tracks}
        for number, piece in fitting:
            called[number].told |= piece.provenance
            called[number].told_ms = now_ms
        return data

    def kinematic_info(self, now: float) -> list[PerceivedObject]:
        """Every known car but the own one, as it is expected to be at `now`."""
        if not self.has_position(now):
            return []
        now_ms = self._utc_ms(now)
        tracks = self.cars_without_radio(now)
        q = self._settings.acceleration_density
        cars = as_perceived_objects(now, ObjectSource.BSM, self._neighbours, q)
        estimates = [track.estimate for track in tracks]
        states, covariances = propagate(estimates, now_ms, q)
        for track, state, covariance in zip(
            tracks, states.T.tolist(), covariances.transpose(2, 0, 1).tolist(), strict=True
        ):
            cars.append(
                PerceivedObject(
                    stamp_s=now,
                    name=str(track.number),
                    source=ObjectSource.SENSOR if track.is_seen else ObjectSource.SHARED,
                    state=tuple(state),
                    covariance=tuple(map(tuple, covariance)),
                    age_s=(now_ms - track.estimate.stamp_ms) / 1000,
                    provenance=track.estimate.provenance,
                    tracked_for_s=(now_ms - track.first_ms) / 1000,
                )
            )
        return cars

    def cars_without_radio(self, now: float) -> list[Track]:
        """The known cars that have no radio, with the evidence of each."""
        self._bring_up_to_date(now)
        return [track for track in self._tracks if track.is_known and track.radio_id is None]

    def host_vehicle(self, now: float) -> PerceivedObject | None:
        """The own car in the same frame; `None` without a position."""
        if not self.has_position(now):
            return None
        own, q = RemoteVehicle(self._own_state(), now), self._settings.acceleration_density
        return as_perceived_objects(now, ObjectSource.HOST, {self.own_id: own}, q)[0]

    def heading(self, now: float) -> Heading | None:
        """Which way the own car faces, standing too; `None` until it has driven."""
        return self._own.heading(now)

    @override
    def next_event(self) -> Discarded | None:
        """The oldest event not yet taken."""
        return self._events.popleft() if self._events else None

    def _receive_footer(self, sender_id: bytes, data: bytes | SharedEntries, now: float) -> None:
        belief = self._settings.footer_validation
        neighbour = self._neighbours.get(sender_id)
        if neighbour is None:
            return self._discard(now, "unplaced_sender", sender_id.hex())
        if not neighbour.may_send_footer(belief, now):
            return self._discard(now, "too_often", sender_id.hex())
        try:
            told = data if isinstance(data, SharedEntries) else read(data)
        except DecodeError as error:
            return self._discard(now, error.reason, str(error))
        if len(told) > belief.entries_per_footer:
            return self._discard(now, "too_many_entries", f"{len(told)} from {sender_id.hex()}")
        if len(told):
            self._heard.append(ReceivedFooter(told, sender_id, neighbour.reported.state[:2], now))
        if len(self._heard) >= _MOST_HEARD:
            self._take_up(now)
        return None

    def _take_up(self, now: float) -> None:
        """Use what has come in: pictures first, then footers."""
        self._assign_seen(now)
        heard, self._heard = self._heard, []
        if not heard:
            return
        frame = self._own.frame
        assert frame is not None  # noqa: S101 (a position comes with a frame)
        sources = [each for each in heard for _ in range(len(each.told))]
        batch = concatenate(heard, frame, self._utc_ms)
        own = OwnMeasurements(frozenset(self._own_ids), frozenset(self._own_stamps_ms))
        refused, excess = violations_of_received(batch, heard, own, self._settings)
        believed = [row for row in range(len(batch)) if row not in refused]
        believed_batch, excess = batch.rows(believed), excess[believed]
        believed_batch.entries.covariances[:] *= excess
        refused |= {believed[at]: "too_sure" for at in np.flatnonzero(excess > 1.0).tolist()}
        refused |= {believed[at]: "too_many_cars" for at in self._tracks.receive(believed_batch)}
        for (_, sender_id, at, reason), entries in Counter(
            (id(sources[row]), sources[row].sender_id, sources[row].at, reason)
            for row, reason in refused.items()
        ).items():
            self._discard(at, reason, f"{entries} entries from {sender_id.hex()}")

    def _bring_up_to_date(self, now: float) -> None:
        self._take_up(now)
        now_ms = self._utc_ms(now)
        refresh_ms = round(self._settings.refresh_s * 1000)
        if self._refreshed_ms is not None and 0 <= now_ms - self._refreshed_ms < refresh_ms:
            return  # below 0, UTC has gone back, and nobody is to wait until it is there again
        overlap_m = self._settings.association.overlap_m
        self._neighbours.forget(self._settings.radio_silence_s, overlap_m, now)
        self._tracks.refresh(now_ms)
        reported = {self.own_id: self._own_state()}
        reported |= {key: neighbour.reported for key, neighbour in self._neighbours.items()}
        cars = as_kinematics(list(reported.values()), self._utc_ms)
        self._tracks.recognise(list(reported), cars, now_ms)
        self._refreshed_ms = now_ms

    def _assign_seen(self, now: float) -> None:
        """Make direct measurements of what the camera saw, a picture at a time."""
        pictures = groupby(sorted(self._seen, key=_stamp_s), key=_stamp_s)
        for stamp_s, picture in [(stamp_s, list(cars)) for stamp_s, cars in pictures]:
            identity = MeasurementId(self.own_id, self._utc_ms(stamp_s))
            measured: dict[int, Measurement] = {}
            for seen in picture:
                placed = self._own.measure(seen)
                if isinstance(placed, str):
                    self._discard(now, placed, f"car {seen.track_id} seen")
                else:
                    measured[seen.track_id] = Measurement(identity, *placed)
            if measured:
                n = len(measured)
                self._own_stamps_ms.append(identity.stamp_ms)
                provenances = [frozenset((identity,))] * n
                self._tracks.receive(
                    EvidenceBatch(
                        [OWN] * n,
                        list(measured),
                        provenances,
                        [self._utc_ms(now)] * n,
                        ProvenanceSpans.of(provenances),
                        [True] * n,
                        as_arrays(list(measured.values())),
                    )
                )
        self._seen.clear()

    def _candidate(self, track: Track, now_ms: int) -> Candidate | None:
        """What Algorithm 1 is given of a car: the MEs of the window, and which may be sent on.

        The paper's window is the interval of the broadcasts, so it begins with the last one: what
        comes in between is told once, however punctual they are. What was told before and comes
        back from others is not told again: old news would make an estimate old.
        """
        span_ms = round(self._settings.shared_span_s * 1000)
        received = [held for held in track.evidence.values() if held.received_ms >= self._told_ms]
        untold = [
            held
            for held in received
            if held.oldest_ms >= now_ms - span_ms and not held.provenance <= track.told
        ]
        if not untold:
            return None
        is_seen = any(map(self._is_own_measurement, untold))
        return Candidate(EvidenceView(untold), len(received), is_seen, track.told_ms)

    def _estimate(self, evidence_of_cars: Sequence[Sequence[Evidence]]) -> list[Evidence]:
        """The paper's Estimate: from the independent ones of all MEs about a car, for each car.

        The latest of them, where all are more measurements than anybody believes an estimate.
        """
        most = self._settings.footer_validation.measurements_per_estimate
        chosen = [up_to(most, independent(evidence)) for evidence in evidence_of_cars]
        several = [evidence for evidence in chosen if len(evidence) > 1]
        estimates = iter(fuse(several, self._settings.acceleration_density))
        return [next(estimates) if len(evidence) > 1 else evidence[0] for evidence in chosen]

    def _is_own_measurement(self, held: StoredEvidence) -> bool:
        return held.is_measurement and all(by in self._own_ids for by, _ in held.provenance)

    def _own_state(self) -> ReportedState:
        own = self._own.state()
        assert own is not None  # noqa: S101 (callers have asked for the position)
        return own

    def _utc_ms(self, stamp_s: float) -> int:
        return round((stamp_s + self._utc_offset_s) * 1000)

    def _discard(self, now: float, reason: str, detail: str) -> None:
        self._events.append(Discarded(now, "mvs", reason, detail))


_MOST_HEARD = 256
"""Footers that may wait, where nobody asks."""
_UTC_STEP_S = 0.1
"""A change of UTC by more is a correction and no drift: a car moves 3 m in that time."""


def _stamp_s(seen: VehicleDetection) -> float:
    return seen.stamp_s
