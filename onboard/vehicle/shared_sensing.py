"""Shared sensing of one vehicle: its BSMs, SDSMs or CPMs, and MVS, whose evidence they carry.

Both ways meet here: what the sensors measure goes out, and what others send comes in.
"""

from collections.abc import Callable, Iterator

import numpy as np

from onboard.bsm_transmission.cpm_schedule import CpmSchedule
from onboard.bsm_transmission.transmitter import BsmTransmitter, position_in
from onboard.core import Core
from onboard.messages.bsm import BasicSafetyMessage
from onboard.messages.bsm_core import VehicleSize
from onboard.messages.cpm import CollectivePerceptionMessage
from onboard.messages.sdsm import SensorDataSharingMessage
from onboard.mvs.multi_vehicle_sensing import MultiVehicleSensing
from onboard.mvs.received_footers import SharedEntries
from onboard.mvs.settings import MvsSettings, SharedIn
from onboard.observations import (
    DetectionList,
    HardBrake,
    Position,
    Speed,
    VehicleDetection,
    YawRate,
)
from onboard.security.pseudonyms import Pseudonym
from onboard.sensors.host_state import HostState
from onboard.step import HostObservation
from onboard.tracking.tracks import DEFAULTS, TrackingParameters


class SharedSensing:
    """Measures, sends and receives, in values; the timers of its cores are handled by others."""

    def __init__(
        self,
        settings: MvsSettings,
        size: VehicleSize,
        pseudonym: Pseudonym,
        rng: np.random.Generator,
        host: HostState,
        *,
        now: float,
        utc_offset_s: float,
        tracking: TrackingParameters = DEFAULTS,
        tracks_sensed: bool = False,
        etsi: bool = False,
    ) -> None:
        """Start without tracks.

        Args:
            settings: of MVS.
            size: of the vehicle.
            pseudonym: the present identifiers.
            rng: for the jitter of BSMs, and for selections that choose at random.
            host: the vehicle by its sensors, filled by the caller.
            now: time on the clock of the cores in s.
            utc_offset_s: UTC in seconds since 1970 less that time.
            tracking: parameters of the tracker.
            tracks_sensed: whether what own sensors measure is tracked apart, too.
            etsi: whether BSMs stand for CAMs, which are triggered, and CPMs carry the evidence.
        """
        self._shared_in = settings.shared_in
        self._cpms = CpmSchedule(rng, now) if etsi else None
        self._is_cpm_first = False
        self._utc_offset_s = utc_offset_s
        self.transmitter = BsmTransmitter(size, pseudonym, rng, now, host, triggered=etsi)
        self.mvs = MultiVehicleSensing(
            settings,
            pseudonym.temporary_id,
            rng,
            utc_offset_s,
            tracking=tracking,
            tracks_sensed=tracks_sensed,
        )

    def set_utc_offset(self, utc_offset_s: float) -> None:
        """Set UTC less the time of the cores."""
        self._utc_offset_s = utc_offset_s
        self.mvs.set_utc_offset(utc_offset_s)

    def change_pseudonym(self, pseudonym: Pseudonym, now: float) -> None:
        """Send under other identifiers."""
        self.transmitter.change_identity(pseudonym, now)
        if self._cpms is not None:
            self._cpms.begin_anew(now)
        self.mvs.set_own_id(pseudonym.temporary_id)

    def heading_rad(self, now: float) -> float | None:
        """Return the heading, clockwise from north; `None` if it is not known."""
        heading = self.mvs.heading(now)
        return None if heading is None else heading.heading_rad

    def receive_observation(self, observation: HostObservation, now: float) -> None:
        """Take what a sensor of the vehicle has measured."""
        match observation:
            case Speed():
                self.transmitter.receive_speed(observation)
            case HardBrake():
                self.transmitter.receive_hard_brake(observation, now)
            case Position():
                self.transmitter.receive_position(observation)
                self.mvs.receive_position(observation)
            case YawRate():
                self.mvs.receive_yaw_rate(observation)
            case VehicleDetection():
                self.mvs.receive_detection(observation)
            case DetectionList():
                for detection in observation.cars:
                    self.mvs.receive_detection(detection)

    def receive_bsm(
        self,
        message: BasicSafetyMessage,
        sender: bytes,
        now: float,
        *,
        entries: SharedEntries | None = None,
    ) -> bool:
        """Take a BSM from the air.

        Args:
            message: as decoded.
            sender: who has sent it, whose BSMs the vehicle density counts once.
            now: time of reception.
            entries: of its footer, if that is decoded already.

        Returns:
            whether what it reports of its sender may be used, by what is known here.
        """
        core = message.core
        position = position_in(core, now, self._utc_offset_s)
        is_used = self.mvs.receive_bsm(
            core.temporary_id,
            position,
            message.footer if entries is None else entries,
            now,
            core.acceleration.longitudinal_m_s2,
        )
        self.transmitter.receive_remote_vehicle(sender, position, now)
        return is_used

    def messages_to_send(
        self, now: float, radio_opens_at: Callable[[float], float]
    ) -> Iterator[BasicSafetyMessage | SensorDataSharingMessage | CollectivePerceptionMessage]:
        """Yield the messages that are due, each composed when it is drawn.

        While congestion control lets none through, none is composed, except a BSM with a critical
        event, which goes out as a DENM. CAMs and CPMs then take turns.

        Args:
            now: the present time.
            radio_opens_at: see `Vehicle`.
        """
        kinds = self._bsm_due, self._cpm_due
        for due in reversed(kinds) if self._is_cpm_first else kinds:
            opens_at = radio_opens_at(now)
            if opens_at > now:
                self.transmitter.hold_until(opens_at)
                if self._cpms is not None:
                    self._cpms.hold_until(opens_at)
            yield from due(now)

    def _bsm_due(self, now: float) -> Iterator[BasicSafetyMessage | SensorDataSharingMessage]:
        if not self.transmitter.take_due(now):
            return
        self._is_cpm_first = True
        yield self.bsm(now)
        if (shared := self.sdsm(now)) is not None:
            yield shared

    def _cpm_due(self, now: float) -> Iterator[CollectivePerceptionMessage]:
        if (perceived := self.cpm(now)) is not None:
            self._is_cpm_first = False
            yield perceived

    def prepare_slice(self, now: float) -> bool:
        """Do the next slice of what the messages that are due need; returns whether all is done."""
        if self._has_footers and self.transmitter.is_due(now):
            return self.mvs.footer_slice(now)
        return self.mvs.update_slice(now)

    @property
    def _has_footers(self) -> bool:
        return self._cpms is None and self._shared_in is not SharedIn.SDSM

    def bsm(self, now: float) -> BasicSafetyMessage:
        """Return the BSM at `now`, due or not."""
        footer = (self.mvs.footer_to_send(now) or None) if self._has_footers else None
        utc_s = now + self._utc_offset_s
        return self.transmitter.bsm(footer, now, utc_s, self.heading_rad(now))

    def sdsm(self, now: float) -> SensorDataSharingMessage | None:
        """Return the SDSM that goes with the BSM at `now`; `None` if there is nothing to share."""
        is_carrier = self._cpms is None and self._shared_in is not SharedIn.FOOTER
        return self.mvs.sdsm_to_send(now) if is_carrier else None

    def cpm(self, now: float) -> CollectivePerceptionMessage | None:
        """Return the CPM at `now`; `None` if none is due, or there is nothing to share."""
        is_due = self._cpms is not None and self._cpms.take_due(now)
        return self.mvs.cpm_to_send(now) if is_due else None

    def is_due(self, now: float) -> bool:
        """Whether one of `cores` has something to be done."""
        if self.transmitter.get_timer() <= now:
            return True
        return self._cpms is not None and self._cpms.get_timer() <= now

    @property
    def cores(self) -> Iterator[Core]:
        """Those that say when something is to be sent."""
        yield self.transmitter
        if self._cpms is not None:
            yield self._cpms
