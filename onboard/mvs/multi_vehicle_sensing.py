"""The MVS sublayer of one vehicle (section III): measures, receives, fuses and broadcasts.

Without a position there is no MVS: nothing is measured, used or sent.
"""

import math
from collections import Counter, deque
from collections.abc import Callable, Generator, Iterator, Sequence
from functools import partial

import numpy as np
from typing_extensions import override

from onboard.core import Core
from onboard.errors import DecodeError
from onboard.kinematics.heading import Heading
from onboard.kinematics.local_frame import LocalFrame
from onboard.messages.cpm import CollectivePerceptionMessage
from onboard.messages.sdsm import EquipmentType, SensorDataSharingMessage
from onboard.misbehaviour.evidence_check import MAX_MEASUREMENTS_PER_ESTIMATE
from onboard.mvs import cpm_coding, sdsm_coding
from onboard.mvs.evidence_to_send import EvidenceToSend
from onboard.mvs.footer_validation import OwnMeasurements, violations_of_received
from onboard.mvs.host_vehicle import HostVehicle, ReportedState
from onboard.mvs.messages_to_send import MessagesToSend
from onboard.mvs.own_detections import OwnDetections
from onboard.mvs.received_footers import ReceivedFooter, SharedEntries, concatenate
from onboard.mvs.remote_vehicles import (
    RemoteVehicle,
    RemoteVehicles,
    as_perceived_objects,
    as_state_arrays,
)
from onboard.mvs.settings import MvsSettings
from onboard.mvs.tracked_objects import as_tracked_objects, without_radio
from onboard.mvs.waiting_footers import FOOTERS_TOGETHER, MAX_WAITING_FOOTERS, WaitingFooters
from onboard.observations import Discarded, Position, VehicleDetection, YawRate
from onboard.tracking.evidence_store import EvidenceBatch
from onboard.tracking.perceived_object import ObjectSource, PerceivedObject
from onboard.tracking.slices import result_of
from onboard.tracking.track import Track
from onboard.tracking.tracks import DEFAULTS, TRACKS_AT_ONCE, TrackingParameters, Tracks

UPDATE_S = 0.05
"""Tracks are updated no more often than this; bounds computing time."""

MAX_OBSERVER_SIGMA_M = 2.0
"""Largest error of an observer's position that its measurements are taken to share: otherwise one
that states a larger one could make every vehicle that it measures too uncertain to be reported."""
_COMPLETE = object()
_UTC_STEP_S = 0.1
"""A larger change of UTC is a correction and no drift: vehicles move 3 m in that time."""


class MultiVehicleSensing(Core):
    """MVS of one vehicle. `now` and stamps are on the vehicle's clock."""

    def __init__(
        self,
        settings: MvsSettings,
        own_id: bytes,
        rng: np.random.Generator,
        utc_offset_s: float = 0.0,
        *,
        tracking: TrackingParameters = DEFAULTS,
        max_measurements: int = MAX_MEASUREMENTS_PER_ESTIMATE,
        tracks_sensed: bool = False,
    ) -> None:
        """Start without tracks.

        Args:
            settings: the user's.
            own_id: temporary ID of the own BSM, 4 bytes.
            rng: for the selections that choose at random.
            utc_offset_s: UTC minus `now`.
            tracking: parameters of the tracker.
            max_measurements: in one estimate, sent or received.
            tracks_sensed: whether there are `sensed_objects`.
        """
        self._utc_offset_s = utc_offset_s
        self._parameters = tracking
        self._max_measurements = max_measurements
        self._own_ids = deque([own_id], maxlen=2)
        self._host = HostVehicle(settings.sensing)
        self._detections = OwnDetections(self._host)
        self._waiting = WaitingFooters()
        self._remote_vehicles = RemoteVehicles()
        self._road_side_units = RemoteVehicles()
        """Senders of SDSMs or CPMs that send no BSMs or CAMs."""
        self._tracks = Tracks(tracking, self._observer_sigma_m)
        self._sensed_tracks = Tracks(tracking) if tracks_sensed else None
        """Of own measurements alone."""
        self._all_tracks = [self._tracks]
        if self._sensed_tracks is not None:
            self._all_tracks.append(self._sensed_tracks)
        evidence = EvidenceToSend(
            settings,
            rng,
            acceleration_density=tracking.acceleration_density,
            max_measurements=max_measurements,
        )
        self._messages = MessagesToSend(self._host, evidence, settings.max_bytes)
        self._updated_ms: int | None = None
        """When the tracks were last updated, UTC."""
        self._slices: Iterator[None] | None = None
        """What is left of an update that has begun."""
        self._slice_s = 0.0
        """Time of its last slice."""
        self._composing: Generator[None, None, bytes] | None = None
        """What is left of a footer that has begun."""
        self._composed: bytes | None = None
        """A footer that is not sent yet."""
        self._events: deque[Discarded] = deque(maxlen=1024)

    @property
    def own_id(self) -> bytes:
        """The temporary ID under which own measurements are sent."""
        return self._own_ids[-1]

    def set_own_id(self, own_id: bytes) -> None:
        """Change the pseudonym; measurements under the last one are still recognised as own."""
        if own_id != self.own_id:
            self._own_ids.append(own_id)
            self._messages.begin_anew()
            self._composing = self._composed = None

    def set_utc_offset(self, utc_offset_s: float) -> None:
        """Set UTC minus `now`. At a correction of UTC all tracks are dropped."""
        if abs(utc_offset_s - self._utc_offset_s) > _UTC_STEP_S:
            for tracks in self._all_tracks:
                tracks.clear()
            self._remote_vehicles.forget_clocks()
            self._detections.forget_stamps()
            self._messages.restart()
            self._updated_ms = self._slices = self._composing = self._composed = None
        self._utc_offset_s = utc_offset_s

    # ---- in -------------------------------------------------------------------------------

    def receive_position(self, fix: Position) -> None:
        """Take the host vehicle's position."""
        if self._host.leaves_frame(fix):
            self._finish_update()
            if self._composing is not None:
                self._composed = result_of(self._composing)
                self._composing = None
        moved = self._host.receive_position(fix)
        if moved is not None:
            for tracks in self._all_tracks:
                tracks.change_frame(*moved)
            self._remote_vehicles.change_frame(*moved)
            self._road_side_units.change_frame(*moved)
            self._waiting.change_frame(*moved)

    def receive_yaw_rate(self, sample: YawRate) -> None:
        """Take how fast the host vehicle turns."""
        self._host.receive_yaw_rate(sample)

    def receive_detection(self, detection: VehicleDetection) -> None:
        """Take a vehicle that own sensors detect, with a radio or without."""
        if self.has_position(detection.stamp_s):
            self._detections.receive_detection(detection)

    def receive_bsm(
        self,
        sender_id: bytes,
        state: Position | None,
        footer: bytes | SharedEntries | None,
        now: float,
        acceleration_m_s2: float | None = None,
    ) -> bool:
        """Take a BSM and its footer.

        Args:
            sender_id: temporary ID, 4 bytes.
            state: position by the BSM; `stamp_s` on the host vehicle's clock.
            footer: the MVS footer of the BSM, encoded or already decoded.
            now: time of receipt.
            acceleration_m_s2: longitudinal acceleration by the BSM.

        Returns:
            whether what the BSM reports of its sender may be used, by what is known here.
        """
        refused = None
        if sender_id in self._own_ids:
            refused = "own_message", sender_id.hex()
            self._discard(now, *refused)
        elif self.has_position(now):
            if state is not None:
                refused = self._remote_vehicles.receive_state(
                    sender_id,
                    self._host.reported_state(state),
                    acceleration_m_s2,
                    own_m=self._own_state().state[:2],
                    now=now,
                )
                if refused is not None:
                    self._discard(now, *refused)
            if footer is not None:
                self._receive_footer(sender_id, footer, now)
        return refused is None

    def receive_sdsm(self, message: SensorDataSharingMessage, now: float) -> None:
        """Take an SDSM of a remote vehicle, or of a road-side unit, which need not send BSMs."""
        is_unit = message.equipment is EquipmentType.RSU
        read_entries = partial(sdsm_coding.entries_in, message, self._utc_ms(now))
        self._receive_shared(message.source_id, read_entries, now, is_unit=is_unit)

    def receive_cpm(self, message: CollectivePerceptionMessage, now: float) -> None:
        """Take a CPM, as `receive_sdsm`."""
        read_entries = partial(cpm_coding.entries_in, message)
        is_unit = message.is_road_side_unit
        self._receive_shared(message.station_id, read_entries, now, is_unit=is_unit)

    def _receive_shared(
        self,
        sender_id: bytes,
        read_entries: Callable[[], SharedEntries],
        now: float,
        *,
        is_unit: bool,
    ) -> None:
        if sender_id in self._own_ids:
            return self._discard(now, "own_message", sender_id.hex())
        if not self.has_position(now):
            return None
        try:
            entries = read_entries()
        except DecodeError as error:
            return self._discard(now, error.reason, error.detail)
        senders = self._remote_vehicles
        if is_unit and sender_id not in senders:
            senders = self._road_side_units
            refused = senders.receive_state(
                sender_id,
                self._host.standing_at(entries.anchor, now),
                None,
                own_m=self._own_state().state[:2],
                now=now,
            )
            if refused is not None:
                return self._discard(now, *refused)
        return self._receive_entries(senders.get(sender_id), entries, sender_id, now)

    def update(self, now: float) -> None:
        """Process what has arrived, and update the tracks if the last update is `UPDATE_S` ago."""
        self._finish_update()
        while not self.update_slice(now):
            pass

    def update_slice(self, now: float) -> bool:
        """Do the next part of `update`, beginning at `now` if none has begun.

        So a warning that arrives in a dense place is handled between two parts. What is received
        in between is processed by the next update.

        Returns:
            whether the update is complete.
        """
        self._slice_s = now
        if self._slices is None:
            self._slices = self._update_in_slices(now)
        if next(self._slices, _COMPLETE) is _COMPLETE:
            self._slices = None
        return self._slices is None

    def _finish_update(self) -> None:
        for _ in self._slices or ():
            pass
        self._slices = None

    def _update_in_slices(self, now: float) -> Iterator[None]:
        if not self.has_position(now):
            return
        yield from self._process_in_slices(now)
        now_ms = self._utc_ms(now)
        if self._updated_ms is not None and 0 <= now_ms - self._updated_ms < round(UPDATE_S * 1000):
            return  # below 0, UTC was set back: updates go on at once
        are_many = self._are_many_tracks
        if are_many:
            yield
        self._remote_vehicles.drop_silent(now)
        self._road_side_units.drop_silent(now)
        slices = self._tracks.update_in_slices(now_ms)
        if are_many:
            yield from slices
            yield
        else:
            result_of(slices)
        for kept, merged in self._tracks.merged:
            self._messages.merge(kept, merged)
        reported = {self.own_id: self._own_state()}
        reported |= {key: remote.reported for key, remote in self._remote_vehicles.items()}
        states = as_state_arrays(list(reported.values()), self._utc_ms)
        if are_many:
            yield
        self._tracks.match_remote_vehicles(list(reported), states, now_ms)
        if self._sensed_tracks is not None:
            if are_many:
                yield
            self._sensed_tracks.update(now_ms)
            self._sensed_tracks.match_remote_vehicles([self.own_id], states[:1], now_ms)
        self._updated_ms = self._utc_ms(self._slice_s)
        if are_many:
            yield  # what follows an update, such as the assessment of its objects, takes a step too

    # ---- out ------------------------------------------------------------------------------

    def footer_slice(self, now: float) -> bool:
        """Do the next part of the update or, after it, of the footer that is to be sent.

        Returns:
            whether `footer_to_send` has little left to do.
        """
        if self._composed is not None:
            return True
        if self._composing is None:
            if not self.update_slice(now):
                return False
            if not self.has_position(now) or not self._are_many_tracks:
                return True
            self._composing = self._compose(now)
            return False
        try:
            next(self._composing)
        except StopIteration as end:
            self._composing, self._composed = None, end.value
        return self._composed is not None

    def footer_to_send(self, now: float) -> bytes:
        """Update, and return the footer of the BSM at `now`; empty without a position.

        One that `footer_slice` has begun is finished and returned.
        """
        while not self.footer_slice(now):
            pass
        if self._composed is not None:
            footer, self._composed = self._composed, None
            return footer
        return result_of(self._compose(now)) if self.has_position(now) else b""

    def _compose(self, now: float) -> Generator[None, None, bytes]:
        return self._messages.footer_in_slices(self._tracks, self._own_ids, self._utc_ms(now))

    def sdsm_to_send(self, now: float) -> SensorDataSharingMessage | None:
        """Update, and return the SDSM at `now`; `None` without anything newly measured."""
        self.update(now)
        if not self.has_position(now):
            return None
        return self._messages.sdsm(self._tracks, self._own_ids, now, self._utc_ms(now))

    def cpm_to_send(self, now: float) -> CollectivePerceptionMessage | None:
        """Update, and return the CPM at `now`; `None` without a vehicle that is due."""
        self.update(now)
        if not self.has_position(now):
            return None
        return self._messages.cpm(self._tracks, self._own_ids, now, self._utc_ms(now))

    def kinematic_info(self, now: float) -> list[PerceivedObject]:
        """Return all objects but the host vehicle by the last update, predicted to `now`."""
        return result_of(self.kinematic_info_in_slices(now))

    def kinematic_info_in_slices(self, now: float) -> Generator[None, None, list[PerceivedObject]]:
        """Do what `kinematic_info` does in two slices, by the state at the first one."""
        if not self.has_position(now):
            return []
        q = self._parameters.acceleration_density
        reported = self.reported_tracks()
        estimates = [track.placed for track in reported]
        sensed = {track.remote_vehicle_id for track in self._tracks if track.is_sensed}
        remote = as_perceived_objects(now, ObjectSource.BSM, self._remote_vehicles, q, sensed)
        yield
        return remote + as_tracked_objects(now, self._utc_ms(now), reported, estimates, q)

    def sensed_objects(self, now: float) -> list[PerceivedObject]:
        """Return what own sensors alone measure, whether it has a radio or not.

        No message has a part in it: one about a vehicle that is measured must not change its state.
        Numbers of vehicles are not those of `kinematic_info`.
        """
        if self._sensed_tracks is None or not self.has_position(now):
            return []
        tracks = without_radio(self._sensed_tracks)
        estimates, q = [track.placed for track in tracks], self._parameters.acceleration_density
        return as_tracked_objects(now, self._utc_ms(now), tracks, estimates, q)

    def reported_tracks(self) -> list[Track]:
        """Return the tracks of vehicles without radio that are reported, by the last update."""
        return without_radio(self._tracks)

    def host_vehicle(self, now: float) -> PerceivedObject | None:
        """Return the host vehicle in the same frame; `None` without a position."""
        if not self.has_position(now):
            return None
        own, q = RemoteVehicle(self._own_state(), now), self._parameters.acceleration_density
        return as_perceived_objects(now, ObjectSource.HOST, {self.own_id: own}, q)[0]

    def has_position(self, now: float) -> bool:
        """Whether the host vehicle has a position."""
        return self._host.has_position(now)

    @property
    def frame(self) -> LocalFrame | None:
        """Frame of all states that are put out; `None` before the first fix."""
        return self._host.frame

    def heading(self, now: float) -> Heading | None:
        """Return the host vehicle's heading, also at standstill; `None` until it has driven."""
        return self._host.heading(now)

    @override
    def next_event(self) -> Discarded | None:
        """Return the oldest event not yet taken."""
        return self._events.popleft() if self._events else None

    # ---- received evidence ----------------------------------------------------------------

    def _receive_footer(self, sender_id: bytes, data: bytes | SharedEntries, now: float) -> None:
        self._receive_entries(self._remote_vehicles.get(sender_id), data, sender_id, now)

    def _receive_entries(
        self,
        remote: RemoteVehicle | None,
        data: bytes | SharedEntries,
        sender_id: bytes,
        now: float,
    ) -> None:
        if remote is None:
            return self._discard(now, "unplaced_sender", sender_id.hex())
        if not remote.accepts_footer(now):
            return self._discard(now, "too_often", sender_id.hex())
        remote.count_footer(now)
        self._waiting.put(data, sender_id, remote.reported.state[:2], now)
        if len(self._waiting) >= MAX_WAITING_FOOTERS:
            self._finish_update()
            result_of(self._process_in_slices(now))
        return None

    def _process_in_slices(self, now: float) -> Generator[None, None, None]:
        """Assign what has arrived to tracks: detections first, then footers."""
        waiting = len(self._waiting)
        are_many = waiting > (0 if self._are_many_tracks else FOOTERS_TOGETHER)
        images, refused = self._detections.take(self.own_id, now, self._utc_ms)
        self._events.extend(refused)
        if are_many:
            yield
        for tracks in self._all_tracks:
            for image in images:
                yield from tracks.receive_in_slices(image)
        if are_many:
            yield
        reading = self._read_in_slices(waiting)
        batches, footers = (yield from reading) if are_many else result_of(reading)
        if batches:
            batch = EvidenceBatch.concatenate(batches)
            if are_many:
                yield
            left_over = yield from self._tracks.receive_in_slices(batch)
            self._discard_entries(Counter((footers[at], "too_many_cars") for at in left_over))

    def _read_in_slices(
        self, waiting: int
    ) -> Generator[None, None, tuple[list[EvidenceBatch], list[ReceivedFooter]]]:
        """Return the entries that are used of the first footers, and the footer of each."""
        batches: list[EvidenceBatch] = []
        footers: list[ReceivedFooter] = []
        for first in range(0, waiting, FOOTERS_TOGETHER):
            together = min(FOOTERS_TOGETHER, waiting - first)
            received, refused = yield from self._waiting.take_in_slices(together)
            self._events.extend(refused)
            yield
            if received:
                batch, valid = yield from self._validated_in_slices(received)
                batches.append(batch)
                footers += valid
            yield
        return batches, footers

    def _validated_in_slices(
        self, received: Sequence[ReceivedFooter]
    ) -> Generator[None, None, tuple[EvidenceBatch, list[ReceivedFooter]]]:
        """Return the entries of footers that are used, and the footer of each."""
        frame = self._host.frame
        assert frame is not None  # noqa: S101 (a position comes with a frame)
        footers = [each for each in received for _ in range(len(each.footer))]
        own = OwnMeasurements(frozenset(self._own_ids), frozenset(self._detections.stamps_ms))
        batch = concatenate(received, frame, self._utc_ms)
        yield
        refused, inflation = violations_of_received(
            batch,
            received,
            own,
            memory_ms=round(self._parameters.memory_s * 1000),
            max_measurements=self._max_measurements,
        )
        valid = [row for row in range(len(batch)) if row not in refused]
        inflation = inflation[valid]
        refused |= {valid[at]: "too_sure" for at in np.flatnonzero(inflation > 1.0).tolist()}
        self._discard_entries(Counter((footers[row], reason) for row, reason in refused.items()))
        used = batch.subset(valid).with_covariances_scaled(inflation)
        return used, [footers[row] for row in valid]

    def _discard_entries(self, refused: Counter[tuple[ReceivedFooter, str]]) -> None:
        for (footer, reason), entries in refused.items():
            detail = f"{entries} entries from {footer.sender_id.hex()}"
            self._discard(footer.received_s, reason, detail)

    # ---- common ---------------------------------------------------------------------------

    def _observer_sigma_m(self, observer: bytes) -> float:
        """Standard deviation of an observer's position; of one that is not received, the host's.

        0 for the host vehicle: what it measures is off as its own position is.
        """
        if observer in self._own_ids:
            return 0.0
        remote = self._remote_vehicles.get(observer) or self._road_side_units.get(observer)
        reported = self._own_state() if remote is None else remote.reported
        return min(math.sqrt(float(reported.covariance[0, 0])), MAX_OBSERVER_SIGMA_M)

    def _own_state(self) -> ReportedState:
        own = self._host.state()
        assert own is not None  # noqa: S101 (callers have asked for the position)
        return own

    @property
    def _are_many_tracks(self) -> bool:
        """Whether an update, and what is made of it, takes several slices."""
        return len(self._tracks) > TRACKS_AT_ONCE

    def _utc_ms(self, stamp_s: float) -> int:
        return round((stamp_s + self._utc_offset_s) * 1000)

    def _discard(self, now: float, reason: str, detail: str) -> None:
        self._events.append(Discarded(now, "mvs", reason, detail))
