"""The cores of one vehicle, connected, still without I/O.

`Stack.step` is the one place where a vehicle receives, decides and sends. The daemon, the rig in
virtual time and both replays call it.
"""

from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from onboard.access.adaptation import AccessAdaptation, ReactionObserved
from onboard.access.driver_model import DEFAULT_POPULATION, DriverModel
from onboard.brake_request.brake_requester import BrakeRequester
from onboard.bsm_transmission.transmitter import BsmTransmitter, position_in
from onboard.core import Core
from onboard.errors import DecodeError
from onboard.intersections.intersections import Intersections
from onboard.kinematics.units import STANDARD_GRAVITY_M_S2
from onboard.lcca.events import WarningLevel, WarningOver, WarningRaised
from onboard.lcca.group import WarningGroup
from onboard.lcca.identification import Identification
from onboard.messages import bsm, lcca, sdsm
from onboard.messages.bsm_core import VehicleSize
from onboard.messages.exchanged import MessageSent
from onboard.misbehaviour.alarm_claims import AlarmClaims
from onboard.misbehaviour.misbehaviour_detection import MisbehaviourDetector
from onboard.mvs.multi_vehicle_sensing import MultiVehicleSensing
from onboard.mvs.settings import SharedIn
from onboard.obd.can_frame import CanFrame
from onboard.obd.vehicle_bus import VehicleBus
from onboard.observations import (
    BrakeCause,
    BrakePedal,
    DetectionList,
    Discarded,
    HardBrake,
    Lead,
    Position,
    Sensor,
    Speed,
    TurnSignal,
    VehicleDetection,
)
from onboard.risk.alarm import Assessment, Cause
from onboard.risk.monitor import RiskMonitor
from onboard.security.credentials import Credentials
from onboard.security.plate_digest import PlateDigest
from onboard.security.pseudonyms import CertificateExpired, Pseudonym, Pseudonyms
from onboard.security.region import TwoDLocation
from onboard.security.rejection import RejectionReason
from onboard.security.security_services import Opened, SecurityServices
from onboard.sensors.host_sensors import HostSensors
from onboard.step import BrakeButton, Input, Observation, ReceivedWsm, SentWsm, StepOutputs
from onboard.trace.trace_line import Event
from onboard.tracking.perceived_object import PerceivedObject, remote_offsets_m
from onboard.vehicle.config import CarConfig
from onboard.vehicle.lcca_application import LccaApplication
from onboard.vehicle.wave_link import WaveLink
from onboard.wave_udp import psid
from onboard.wave_udp.wsmp import WaveShortMessage

if TYPE_CHECKING:
    from onboard.obd.broadcast import BroadcastSignals

LCCA_LIFETIME_S = 0.5
"""Time a group message may wait for the radio; after it, the group's own timers repeat it."""

BSM_LIFETIME_S = 0.1
"""Time a BSM may wait for the radio: the shortest interval to the next one (SAE J2945/1)."""

ASSESSMENT_INTERVAL_S = 0.1
"""Period of the risk assessment: that of BSMs."""

SURROUNDINGS_INTERVAL_S = 1.0
"""Period at which host vehicle and perceived objects are put out as events."""


class _Stage(NamedTuple):
    """A core, and the function that passes its results on to the other cores."""

    core: Core
    pass_on: Callable[[float], None]


class Stack:
    """One vehicle."""

    def __init__(
        self,
        config: CarConfig,
        sensors: Iterable[Sensor],
        rng: np.random.Generator,
        *,
        now: float,
        utc_s: float,
        credentials: Credentials | None = None,
        driver: DriverModel | None = None,
        digest: PlateDigest | None = None,
        signals: "BroadcastSignals | None" = None,
    ) -> None:
        """Start at `now`, which is `utc_s`.

        Args:
            config: settings of the vehicle.
            sensors: those fitted, which can time out.
            rng: source of all random draws.
            now: time on the clock of the cores in s.
            utc_s: the same instant in seconds since 1970.
            credentials: certificates and keys; without them nothing is signed and unsigned
                messages are accepted.
            driver: model learnt in earlier drives; the population's mean if not given.
            digest: derives vehicle IDs from plates; made from `config` if not given.
            signals: those that the vehicle broadcasts on its bus.
        """
        self._config = config
        self._security = SecurityServices(utc_s - now, credentials)
        self._digest = digest or PlateDigest(config.security.plate_digest)
        self._pseudonyms = Pseudonyms(config.car.plate, self._digest, credentials, rng)
        self._pseudonym = self._pseudonyms.at(utc_s)
        self._misbehaviour_detector = MisbehaviourDetector(
            check_braking=config.security.check_braking
        )
        self._bus = VehicleBus(config.obd, signals)
        self._link = WaveLink(self._security, (*psid.J2735, config.lcca_psid))
        sensors = tuple(sensors)
        self._sensors = HostSensors(config.sensor_timeouts.limits_s(sensors), now)
        self._claims: AlarmClaims | None = None
        if credentials is not None and config.security.check_braking:
            self._claims = AlarmClaims(
                self._misbehaviour_detector.signer_of,
                self._security.is_road_side_unit,
                has_sight=Sensor.CAMERA in sensors or Sensor.DETECTOR in sensors,
            )
        self._lcca = LccaApplication(
            config.lcca.parameters(),
            config.car.plate,
            self._pseudonym,
            rng,
            digest=self._digest,
            security=self._security,
            misbehaviour=self._misbehaviour_detector,
            claims=self._claims,
        )
        self._place: TwoDLocation | None = None
        size = VehicleSize(width_m=config.car.width_m, length_m=config.car.length_m)
        self._transmitter = BsmTransmitter(size, self._pseudonym, rng, now)
        self._mvs = MultiVehicleSensing(
            config.mvs, self._pseudonym.temporary_id, rng, self._security.utc_offset_s
        )
        self._access = (
            AccessAdaptation(driver or DriverModel(DEFAULT_POPULATION))
            if config.access.enabled
            else None
        )
        self._intersections = Intersections()
        self._risk = RiskMonitor(
            config.risk, config.car.length_m, config.car.width_m, self._permits
        )
        self._take_reaction_time()
        self._brake_requester = (
            BrakeRequester(config.brake_request) if config.brake_request is not None else None
        )
        self._assess_at = self._report_surroundings_at = now
        self._surroundings: tuple[PerceivedObject | None, list[PerceivedObject]] = (None, [])
        self._events: deque[Event] = deque()
        self._use_credential(now)
        self._stages = tuple(self._make_stages())

    def _make_stages(self) -> Iterable[_Stage]:
        """Yield all cores, from the wires to the decisions.

        Timers are handled in this order. Events are collected in the reverse order: a decision
        precedes the reports of the cores that it is based on.
        """
        if self._config.beacons:  # without, its timer would stay due: no BSM is ever taken
            yield _Stage(self._transmitter, _pass_nothing_on)
        if self._access is not None:
            yield _Stage(self._access, self._take_access)
        yield _Stage(self._bus, self._take_bus)
        if self._brake_requester is not None:
            yield _Stage(self._brake_requester, _pass_nothing_on)
        if self._claims is not None:
            yield _Stage(self._claims.credibility, _pass_nothing_on)
        yield _Stage(self._risk, _pass_nothing_on)
        yield _Stage(self._intersections, _pass_nothing_on)
        yield _Stage(self._mvs, _pass_nothing_on)
        yield _Stage(self._link, _pass_nothing_on)
        yield _Stage(self._sensors, _pass_nothing_on)
        yield _Stage(self._lcca.pending_warnings, self._take_lcca)
        yield _Stage(self._lcca.identification, _pass_nothing_on)
        yield _Stage(self._lcca.group, self._take_lcca)

    @property
    def digest(self) -> PlateDigest:
        """Plate digest, whose slow results are derived ahead in a thread."""
        return self._digest

    @property
    def group(self) -> WarningGroup:
        """Warning group, for display."""
        return self._lcca.group

    @property
    def identification(self) -> Identification:
        """Identification of the lead, for display."""
        return self._lcca.identification

    @property
    def surroundings(self) -> tuple[PerceivedObject | None, list[PerceivedObject]]:
        """Host vehicle (`None` without a position) and perceived objects at the last assessment."""
        return self._surroundings

    def known_signer(self, wsm: WaveShortMessage) -> bytes | None:
        """See `WaveLink`."""
        return self._link.known_signer(wsm)

    # ---- the step -------------------------------------------------------------------------

    def step(self, inputs: Iterable[Input], now: float, utc_s: float | None = None) -> StepOutputs:
        """Receive `inputs`, handle the timer if it is due, and put out what follows.

        Args:
            inputs: in the order of arrival. Each is handled before the next is drawn, so that a
                lazy iterable can end the step's inputs by the clock.
            now: time on the clock of the cores in s; never less than in an earlier step.
            utc_s: the same instant in seconds since 1970, which messages and IDs need; `None`
                keeps the offset.
        """
        if utc_s is not None:
            self._security.utc_offset_s = utc_s - now
            self._mvs.set_utc_offset(utc_s - now)
        for each in inputs:
            self._receive(each, now)
        if self.get_timer() <= now:
            self._handle_timer(now)
        wsms = self._wsms_to_send(now)
        can_frames = self._bus.frames_to_send(now)
        return StepOutputs(wsms, can_frames, self._take_events(), self.get_timer())

    def get_timer(self) -> float:
        """Return when the next step is due without any input; `math.inf` if never."""
        return min(self._assess_at, *(stage.core.get_timer() for stage in self._stages))

    def _handle_timer(self, now: float) -> None:
        pseudonym = self._pseudonyms.at(self._security.utc_s(now))
        if pseudonym is not self._pseudonym:
            self._change_pseudonym(pseudonym, now)
        self._lcca.prepare_next_epoch(now)
        if now >= self._assess_at:
            self._assess(now)
        for core, pass_on in self._stages:
            core.handle_timer(now)
            pass_on(now)

    def _take_events(self) -> list[Event]:
        for core, _ in reversed(self._stages):
            while (event := core.next_event()) is not None:
                self._events.append(event)
        events = list(self._events)
        self._events.clear()
        return events

    # ---- in -------------------------------------------------------------------------------

    def _receive(self, received: Input, now: float) -> None:
        match received:
            case ReceivedWsm():
                self._receive_wsm(received.data, now)
            case CanFrame():
                self._bus.receive_frame(received, now)
                self._take_bus(now)
            case BrakeButton():
                threshold_m_s2 = self._config.obd.hard_brake_threshold_g * STANDARD_GRAVITY_M_S2
                test = HardBrake(now, threshold_m_s2, "button", BrakeCause.TEST)
                self._receive_observation(test, now)
            case _:
                self._receive_observation(received, now)

    def _receive_observation(self, observation: Observation, now: float) -> None:
        if not self._sensors.receive_observation(observation, now):
            return
        match observation:
            case Speed():
                self._receive_speed(observation, now)
            case BrakePedal():
                self._transmitter.receive_pedal(observation)
                self._risk.receive_pedal(observation)
            case TurnSignal():
                self._transmitter.receive_turn_signal(observation)
                self._risk.receive_turn_signal(observation)
            case HardBrake():
                self._lcca.group.receive_hard_brake(observation, now)
                self._transmitter.receive_hard_brake(observation, now)
            case Lead():
                self._receive_lead(observation, now)
            case Position():
                self._place = TwoDLocation(observation.latitude_deg, observation.longitude_deg)
                self._transmitter.receive_position(observation)
                self._mvs.receive_position(observation)
                self._risk.receive_position(observation)
                self._intersections.receive_position(observation)
            case VehicleDetection():
                self._mvs.receive_detection(observation)
            case DetectionList():
                for detection in observation.cars:
                    self._mvs.receive_detection(detection)
        if self._access is not None:
            self._access.receive_observation(observation, now)
            self._take_access(now)
        self._events.append(observation)

    def _receive_speed(self, speed: Speed, now: float) -> None:
        if self._claims is not None:
            self._claims.receive_speed(speed.speed_m_s, now)
        self._lcca.identification.receive_speed(speed.speed_m_s, speed.stamp_s)
        self._lcca.group.receive_speed(speed.speed_m_s, now)
        self._transmitter.receive_speed(speed)
        self._risk.receive_speed(speed)
        if self._brake_requester is not None:
            self._brake_requester.receive_speed(speed)

    def _receive_lead(self, lead: Lead, now: float) -> None:
        if self._claims is not None:
            self._claims.receive_lead(lead, now)
        self._lcca.receive_lead(lead, now)
        self._risk.receive_lead(lead, now)
        self._request_braking(now)

    def _receive_wsm(self, data: bytes, now: float) -> None:
        received = self._link.receive_wsm(data, now)
        if received is None:
            return
        service, opened = received
        match service:
            case psid.BSM:
                self._receive_bsm(opened, now)
            case _ if self._is_outside_region(opened, self._place, now):
                pass
            case psid.SENSOR_SHARING:
                self._receive_sdsm(opened, now)
            case psid.MAP | psid.SPAT:
                self._intersections.receive_message(service, opened, now, self._security.utc_s(now))
            case _:
                heading = self._mvs.heading(now)
                heading_rad = None if heading is None else heading.heading_rad
                self._lcca.receive_message(opened, heading_rad, now)
                self._take_lcca(now)

    def _is_outside_region(self, opened: Opened, place: TwoDLocation | None, now: float) -> bool:
        """Whether a message comes from where its certificate is not valid."""
        if opened.is_valid_at(place):
            return False
        reason, signer = RejectionReason.OUTSIDE_REGION, opened.signer_id or b""
        self._events.append(Discarded(now, "security", reason, f"from {signer.hex()}"))
        return True

    def _receive_bsm(self, opened: Opened, now: float) -> None:
        try:
            message = bsm.decode(opened.payload)
        except DecodeError as error:
            self._events.append(Discarded(now, "bsm", error.reason, error.detail))
            return
        core = message.core
        place = self._place
        if core.latitude_deg is not None and core.longitude_deg is not None:
            place = TwoDLocation(core.latitude_deg, core.longitude_deg)
        if self._is_outside_region(opened, place, now):
            return
        sender = opened.signer_id or core.temporary_id
        reason = self._misbehaviour_detector.receive_bsm(
            sender, message, self._security.made_at_s(opened, now), now
        )
        self._lcca.pending_warnings.handle_timer(now)
        self._take_lcca(now)
        if reason is not None:
            self._events.append(Discarded(now, "bsm", reason, f"from {core.temporary_id.hex()}"))
            return
        position = position_in(core, now, self._security.utc_offset_s)
        remote_id = self._misbehaviour_detector.remote_id(sender, core.temporary_id)
        if remote_id != core.temporary_id:
            # Footers name the sources of measurements by temporary ID: two cannot have one.
            message = replace(message, core=replace(core, temporary_id=remote_id), footer=None)
        is_used = self._mvs.receive_bsm(
            remote_id, position, message.footer, now, core.acceleration.longitudinal_m_s2
        )
        self._transmitter.receive_remote_vehicle(sender, position, now)
        if is_used:
            self._risk.receive_bsm(message, now)
        if core.speed_m_s is not None:
            self._lcca.identification.receive_speed_on_air(
                sender, core.temporary_id, core.speed_m_s, now
            )

    def _receive_sdsm(self, opened: Opened, now: float) -> None:
        try:
            message = sdsm.decode(opened.payload)
        except DecodeError as error:
            self._events.append(Discarded(now, "sdsm", error.reason, error.detail))
            return
        source_id = message.source_id
        signer = opened.signer_id or source_id
        if self._misbehaviour_detector.remote_id(signer, source_id) != source_id:
            detail = f"from {source_id.hex()}"
            self._events.append(Discarded(now, "sdsm", "implausible_identity", detail))
            return
        self._mvs.receive_sdsm(message, now)

    # ---- out ------------------------------------------------------------------------------

    def _wsms_to_send(self, now: float) -> list[SentWsm]:
        self._submit_lcca_messages(now)
        if self._config.beacons and self._transmitter.take_due(now):
            self._submit_bsm(now)
        return [
            SentWsm(now, user_priority, data)
            for user_priority, data in self._link.wsms_to_send(now)
        ]

    def _submit_lcca_messages(self, now: float) -> None:
        for message in self._lcca.messages_to_send(now):
            size_bytes = self._link.submit(
                lcca.encode(message),
                self._config.lcca_psid,
                message.user_priority,
                LCCA_LIFETIME_S,
                now,
            )
            self._events.append(
                MessageSent(
                    now, message.kind, message.user_priority, size_bytes, lcca.as_dict(message)
                )
            )

    def _submit_bsm(self, now: float) -> None:
        shared_in, footer = self._config.mvs.shared_in, None
        if shared_in is not SharedIn.SDSM:
            footer = self._mvs.footer_to_send(now) or None
        heading = self._mvs.heading(now)
        heading_rad = None if heading is None else heading.heading_rad
        utc_s = self._security.utc_s(now)
        message = self._transmitter.bsm(footer, now, utc_s, heading_rad)
        self._link.submit(bsm.encode(message), psid.BSM, message.user_priority, BSM_LIFETIME_S, now)
        if shared_in is not SharedIn.FOOTER:
            self._submit_sdsm(now)

    def _submit_sdsm(self, now: float) -> None:
        message = self._mvs.sdsm_to_send(now)
        if message is not None:
            data, priority = sdsm.encode(message), message.user_priority
            self._link.submit(data, psid.SENSOR_SHARING, priority, BSM_LIFETIME_S, now)

    # ---- between the cores ----------------------------------------------------------------

    def _assess(self, now: float) -> None:
        """Assess the risk from the current states of all vehicles."""
        self._assess_at = now + ASSESSMENT_INTERVAL_S
        self._mvs.update(now)
        host_vehicle, perceived_objects = self._mvs.host_vehicle(now), self._mvs.kinematic_info(now)
        self._surroundings = (host_vehicle, perceived_objects)
        self._intersections.receive_host_vehicle(host_vehicle, self._mvs.frame, now)
        red_light_m = self._intersections.red_light_m
        heading = self._mvs.heading(now)
        if self._claims is not None:
            perceived_objects = self._claims.alarming(perceived_objects, now)
        self._risk.assess(host_vehicle, perceived_objects, now, red_light_m, heading)
        self._request_braking(now)
        self._lcca.identification.receive_offsets(
            {}
            if host_vehicle is None or heading is None
            else remote_offsets_m(host_vehicle, self._surroundings[1], heading.heading_rad)
        )
        if now >= self._report_surroundings_at:
            self._report_surroundings_at = now + SURROUNDINGS_INTERVAL_S
            if host_vehicle is not None:
                self._events.extend([host_vehicle, *self._surroundings[1]])

    def _permits(self, cause: Cause, assessment: Assessment, now: float) -> bool:
        return self._claims is None or self._claims.permits(cause, assessment, now)

    def _request_braking(self, now: float) -> None:
        if self._brake_requester is not None:
            self._brake_requester.assess(self._risk.assessments, now)

    def _take_access(self, now: float) -> None:
        access = self._access
        if access is None:
            return
        self._transmitter.receive_max_interval(access.longest_interval_s, now)
        while (event := access.next_event()) is not None:
            self._events.append(event)
            if isinstance(event, ReactionObserved):
                self._take_reaction_time()

    def _take_reaction_time(self) -> None:
        if self._access is not None and self._access.reaction_s is not None:
            self._risk.receive_reaction_time(self._access.reaction_s)

    def _change_pseudonym(self, pseudonym: Pseudonym, now: float) -> None:
        """Change all identifiers at once, so that nothing links the old ones to the new ones."""
        self._pseudonym = pseudonym
        self._lcca.change_pseudonym(pseudonym, now)
        self._transmitter.change_identity(pseudonym, now)
        self._mvs.set_own_id(pseudonym.temporary_id)
        self._use_credential(now)
        self._lcca.follow_lead(now)

    def _use_credential(self, now: float) -> None:
        credential = self._pseudonym.credential
        if credential is None:
            return
        self._security.sign_with(credential)
        if self._pseudonym.is_out_of_date(self._security.utc_s(now)):
            until_utc_s = credential.certificate.subject.valid_until_utc_s
            self._events.append(CertificateExpired(now, until_utc_s))

    def _take_bus(self, now: float) -> None:
        while (observation := self._bus.next_event()) is not None:
            self._receive_observation(observation, now)

    def _take_lcca(self, now: float) -> None:
        for event in self._lcca.take_events(now):
            self._events.append(event)
            if isinstance(event, WarningRaised | WarningLevel | WarningOver):
                self._risk.receive_warning(event, now)
                if self._brake_requester is not None:
                    self._brake_requester.receive_warning(event)
                    self._request_braking(now)


def _pass_nothing_on(_now: float) -> None:
    """Pass nothing on: the core's events are only put out."""
