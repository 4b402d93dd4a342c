"""The cores of one car put together, still without I/O.

Driven by the daemon, by the rig in virtual time and by the replay, always through the same verbs.
Whatever comes in is handed to the cores that it concerns; what they say is passed on at once.
"""

from collections import deque
from collections.abc import Iterable

import numpy as np

from onboard import psid
from onboard.access.adaptation import AccessAdaptation
from onboard.access.driver_model import DEFAULT_POPULATION, DriverModel
from onboard.bsm_transmission.transmitter import BsmTransmitter, position_in
from onboard.config import CarConfig
from onboard.errors import DecodeError
from onboard.lcca.events import WarningRaised
from onboard.lcca.group import PrecedingVehicle, WarningGroup
from onboard.messages import bsm, lcca
from onboard.messages.bsm_core import VehicleSize
from onboard.mvs.multi_vehicle_sensing import MultiVehicleSensing
from onboard.mvs.perceived_object import PerceivedObject
from onboard.obd.can_frame import CanFrame
from onboard.obd.vehicle_bus import VehicleBus
from onboard.observations import (
    BrakePedal,
    DetectionList,
    Discarded,
    HardBrake,
    Lead,
    LeadIdentity,
    Plate,
    Position,
    Sensor,
    SensorLost,
    SensorRecovered,
    Speed,
    VehicleDetection,
)
from onboard.risk.monitor import RiskMonitor
from onboard.security.credentials import Credentials
from onboard.security.misbehaviour_detection import MisbehaviourDetector
from onboard.security.pending_warnings import PendingWarnings
from onboard.security.plate_digest import PlateDigest
from onboard.security.pseudonyms import CertificateExpired, Pseudonym, Pseudonyms
from onboard.security.security_services import Opened, SecurityServices
from onboard.sensors.sensor_timeout import SensorTimeouts
from onboard.trace.trace_line import Event
from onboard.units import STANDARD_GRAVITY_M_S2
from onboard.wave_link import MessageReceived, MessageSent, WaveLink

Observation = (
    Speed | BrakePedal | HardBrake | Plate | Lead | VehicleDetection | DetectionList | Position
    | SensorLost | SensorRecovered | Discarded
)  # fmt: skip
"""What the sensors' rooms say."""

LCCA_LIFETIME_S = 0.5
"""A group message that has waited longer for the radio is repeated by its own timers anyway."""

BSM_LIFETIME_S = 0.1
"""By then the next one is due."""

ASSESS_S = 0.1
"""How often the danger is judged anew."""

TELL_CARS_S = 1.0
"""How often the trace gets the host vehicle and every perceived object."""


class Stack:
    """One car."""

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
    ) -> None:
        """Start at `now`, which is `utc_s` in seconds since 1970.

        Args:
            config: the car's.
            sensors: those that there are, and can be lost.
            rng: for everything random.
            now: the time on the cores' clock.
            utc_s: the same in seconds since 1970.
            credentials: what to sign with and whom to trust; without them nothing is signed and
                anybody is believed.
            driver: who drives, as far as earlier drives have told.
            digest: derives IDs from plates, where it is not to be one of the car's own.
        """
        self._config = config
        self._security = SecurityServices(utc_s - now, credentials)
        self._digest = digest or PlateDigest(config.security.plate_digest)
        self._pseudonyms = Pseudonyms(config.car.plate, self._digest, credentials, rng)
        self._who = self._pseudonyms.at(utc_s)
        self._plausibility = MisbehaviourDetector(check_braking=config.security.check_braking)
        self._held_warnings = PendingWarnings(self._plausibility)
        self._bus = VehicleBus(config.obd)
        self._link = WaveLink(self._security, (psid.BSM, config.lcca_psid))
        self._group = WarningGroup(config.lcca.parameters(), self._who.car_id, rng)
        size = VehicleSize(width_m=config.car.width_m, length_m=config.car.length_m)
        self._beacon = BsmTransmitter(size, self._who, rng, now)
        self._mvs = MultiVehicleSensing(
            config.mvs, self._who.temporary_id, rng, self._security.utc_offset_s
        )
        self._access = (
            AccessAdaptation(driver or DriverModel(DEFAULT_POPULATION))
            if config.access.enabled
            else None
        )
        self._risk = RiskMonitor(config.risk, config.car.length_m, config.car.width_m)
        self._assess_at = self._tell_cars_at = now
        self._surroundings: tuple[PerceivedObject | None, list[PerceivedObject]] = (None, [])
        self._events: deque[Event] = deque()
        self._sign(now)
        limits_s = config.sensor_timeouts.limits_s(sensors)
        self._watch = SensorTimeouts(limits_s, now)
        self._has_detector = Sensor.DETECTOR in limits_s

    @property
    def digest(self) -> PlateDigest:
        """Deriving an ID is slow: the camera's thread asks first, so that the loop need not."""
        return self._digest

    @property
    def group(self) -> WarningGroup:
        """The warning group, to look at."""
        return self._group

    @property
    def surroundings(self) -> tuple[PerceivedObject | None, list[PerceivedObject]]:
        """The own car, `None` without a position, and the others, when last judged."""
        return self._surroundings

    def set_utc(self, utc_s: float, now: float) -> None:
        """Tell what UTC is at `now`; the cores keep to `now`, messages and IDs need UTC."""
        self._security.utc_offset_s = utc_s - now
        self._mvs.set_utc_offset(utc_s - now)

    # ---- in -------------------------------------------------------------------------------

    def receive_can(self, frame: CanFrame, now: float) -> None:
        """A frame from the car's bus."""
        self._bus.receive_frame(frame, now)
        self._take_bus(now)

    def receive_observation(self, observation: Observation, now: float) -> None:
        """What the bus, vision or GNSS saw, or the loss of a sensor that its room has noticed."""
        if self._is_of_no_use(observation):
            return
        match observation:
            case Speed():
                self._watch.receive_sample(Sensor.SPEED, observation.stamp_s, now)
                self._group.receive_speed(observation.speed_m_s, now)
                self._beacon.receive_speed(observation)
                self._risk.receive_speed(observation)
            case BrakePedal():
                self._beacon.receive_pedal(observation)
                self._risk.receive_pedal(observation)
            case HardBrake():
                self._group.receive_hard_brake(observation, now)
                self._beacon.receive_hard_brake(observation, now)
            case Lead():
                self._watch.receive_sample(Sensor.CAMERA, observation.stamp_s, now)
                self._group.receive_preceding_vehicle(self._neighbour(observation, now), now)
                self._risk.receive_lead(observation, now)
            case Position():
                self._watch.receive_sample(Sensor.POSITION, observation.stamp_s, now)
                self._beacon.receive_position(observation)
                self._mvs.receive_position(observation)
                self._risk.receive_position(observation)
            case VehicleDetection() | DetectionList():
                self._receive_cars(observation, now)
            case SensorLost():
                self._watch.receive_loss(observation.sensor, observation.reason, now)
                return
            case SensorRecovered():
                self._watch.receive_sample(observation.sensor, observation.stamp_s, now)
                return
        if self._access is not None:
            self._adapt_access(self._access, observation, now)
        self._events.append(observation)

    def receive_wsm(self, data: bytes, now: float) -> None:
        """A WAVE short message from the radio."""
        received = self._link.receive_wsm(data, now)
        if received is None:
            return
        psid, opened = received
        if psid == self._config.lcca_psid:
            self._receive_lcca(opened, now)
        else:
            self._receive_bsm(opened, now)

    def _receive_lcca(self, opened: Opened, now: float) -> None:
        try:
            message = lcca.decode(opened.payload)
        except DecodeError as error:
            self._events.append(Discarded(now, "lcca", error.reason, error.detail))
            return
        self._events.append(
            MessageReceived(now, message.kind, opened.signer_id, lcca.as_dict(message))
        )
        is_undisputed = opened.signer_id is None or self._plausibility.receive_car_id(
            opened.signer_id, message.sender_id
        )
        match message:
            case lcca.Warn():
                self._held_warnings.receive_warning(message, self._made_at_s(opened, now), now)
                self._take_warnings(now)
                return
            case lcca.Leave() if not is_undisputed:
                self._events.append(Discarded(now, "lcca", "claimed_by_two", "a leave"))
                return
            case lcca.Join() if not is_undisputed:
                message = message.without_acknowledgement()
        self._group.receive_message(message, now)
        self._take_group(now)

    def _made_at_s(self, opened: Opened, now: float) -> float:
        if opened.generation_utc_s is None:
            return now
        return opened.generation_utc_s - self._security.utc_offset_s

    def _receive_bsm(self, opened: Opened, now: float) -> None:
        try:
            message = bsm.decode(opened.payload)
        except DecodeError as error:
            self._events.append(Discarded(now, "bsm", error.reason, error.detail))
            return
        core = message.core
        sender = opened.signer_id or core.temporary_id
        doubt = self._plausibility.receive_bsm(sender, message, self._made_at_s(opened, now))
        self._held_warnings.handle_timer(now)
        self._take_warnings(now)
        if doubt is not None:
            self._events.append(Discarded(now, "bsm", doubt, f"from {core.temporary_id.hex()}"))
            return
        position = position_in(core, now, self._security.utc_offset_s)
        self._mvs.receive_bsm(
            core.temporary_id, position, message.footer, now, core.acceleration.longitudinal_m_s2
        )
        self._beacon.receive_remote_vehicle(sender, position, now)
        self._risk.receive_bsm(message, now)

    def press_brake_button(self, now: float) -> None:
        """The button of the paper's demonstration (section 4): brake hard without braking."""
        threshold_m_s2 = self._config.obd.hard_brake_threshold_g * STANDARD_GRAVITY_M_S2
        self.receive_observation(HardBrake(now, threshold_m_s2, source="button"), now)

    # ---- out ------------------------------------------------------------------------------

    def can_to_send(self, now: float) -> list[CanFrame]:
        """Frames for the car's bus."""
        return self._bus.frames_to_send(now)

    def wsms_to_send(self, now: float) -> list[tuple[int, bytes]]:
        """Frames for the radio as (user priority, WSM), the most urgent first."""
        self._submit_group_messages(now)
        if self._config.beacons and self._beacon.take_due(now):
            self._submit_bsm(now)
        return self._link.wsms_to_send(now)

    def _submit_group_messages(self, now: float) -> None:
        for message in self._group.messages_to_send(now):
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
        footer = self._mvs.footer_to_send(now) or None
        facing = self._mvs.heading(now)
        heading_rad = None if facing is None else facing.heading_rad
        utc_s = now + self._security.utc_offset_s
        own = self._beacon.bsm(footer, now, utc_s, heading_rad)
        self._link.submit(bsm.encode(own), psid.BSM, own.user_priority, BSM_LIFETIME_S, now)

    def perceived_objects(self, now: float) -> list[PerceivedObject]:
        """Every car that is known, by radio, by sight or from others; none without a position."""
        return self._mvs.kinematic_info(now)

    def next_event(self) -> Event | None:
        """The oldest event not yet taken; `None` when there is none."""
        if not self._events:
            self._take_rest()
        return self._events.popleft() if self._events else None

    # ---- time -----------------------------------------------------------------------------

    def get_timer(self) -> float:
        """When `handle_timer` next wants to be called."""
        cores = (self._bus, self._group, self._held_warnings, self._watch, self._link)
        timers = [self._assess_at, *(core.get_timer() for core in cores)]
        if self._access is not None:
            timers.append(self._access.get_timer())
        if self._config.beacons:  # one that is due and never sent would be due for ever
            timers.append(self._beacon.get_timer())
        return min(timers)

    def handle_timer(self, now: float) -> None:
        """Do what has become due."""
        who = self._pseudonyms.at(now + self._security.utc_offset_s)
        if who is not self._who:
            self._change_identity(who, now)
        if now >= self._assess_at:
            self._assess(now)
        self._beacon.handle_timer(now)
        if self._access is not None:
            self._access.handle_timer(now)
            self._take_access(self._access, now)
        self._bus.handle_timer(now)
        self._take_bus(now)
        self._watch.handle_timer(now)
        self._held_warnings.handle_timer(now)
        self._take_warnings(now)
        self._group.handle_timer(now)
        self._take_group(now)

    # ---- between the rooms ----------------------------------------------------------------

    def _assess(self, now: float) -> None:
        """Judge the danger anew, from where everybody is."""
        self._assess_at = now + ASSESS_S
        host_vehicle, perceived_objects = self._mvs.host_vehicle(now), self._mvs.kinematic_info(now)
        self._surroundings = (host_vehicle, perceived_objects)
        self._risk.assess(host_vehicle, perceived_objects, now)
        if now >= self._tell_cars_at:
            self._tell_cars_at = now + TELL_CARS_S
            if host_vehicle is not None:
                self._events.extend([host_vehicle, *perceived_objects])

    def _receive_cars(self, observation: VehicleDetection | DetectionList, now: float) -> None:
        match observation:
            case VehicleDetection():
                self._mvs.receive_detection(observation)
            case DetectionList():
                self._watch.receive_sample(Sensor.DETECTOR, observation.stamp_s, now)
                for car in observation.cars:
                    self._mvs.receive_detection(car)

    def _is_of_no_use(self, observation: Observation) -> bool:
        match observation:
            case Plate(text=None):
                return True  # something like a plate that nobody could read is no plate
            case VehicleDetection():
                return self._has_detector  # which calls the same car by another name
        return False

    def _adapt_access(self, access: AccessAdaptation, observation: Observation, now: float) -> None:
        match observation:
            case Speed():
                access.receive_speed(observation)
            case Lead():
                access.receive_lead(observation, now)
            case BrakePedal():
                access.receive_brake_pedal(observation)
            case HardBrake():
                access.receive_hard_brake(observation)
        self._take_access(access, now)

    def _take_access(self, access: AccessAdaptation, now: float) -> None:
        self._beacon.receive_max_interval(access.longest_interval_s, now)
        while (event := access.next_event()) is not None:
            self._events.append(event)

    def _change_identity(self, who: Pseudonym, now: float) -> None:
        """Everything that others know us by changes at once, so that nothing links old and new."""
        self._who = who
        self._group.set_own_id(who.car_id, now)
        self._beacon.change_identity(who)
        self._mvs.set_own_id(who.temporary_id)
        self._sign(now)

    def _sign(self, now: float) -> None:
        credential = self._who.credential
        if credential is None:
            return
        self._security.sign_with(credential)
        if self._who.is_out_of_date(now + self._security.utc_offset_s):
            until_utc_s = credential.certificate.subject.valid_until_utc_s
            self._events.append(CertificateExpired(now, until_utc_s))

    def _take_bus(self, now: float) -> None:
        while (observation := self._bus.next_event()) is not None:
            self.receive_observation(observation, now)

    def _take_warnings(self, now: float) -> None:
        while (warning := self._held_warnings.next_warning()) is not None:
            self._group.receive_message(warning, now)
            self._take_group(now)

    def _take_group(self, now: float) -> None:
        while (event := self._group.next_event()) is not None:
            self._events.append(event)
            if isinstance(event, WarningRaised):
                self._risk.receive_warning(event, now)

    def _take_rest(self) -> None:
        cores = (
            self._group,
            self._held_warnings,
            self._watch,
            self._link,
            self._mvs,
            self._risk,
        )
        for core in cores:
            while (event := core.next_event()) is not None:
                self._events.append(event)

    def _neighbour(self, lead: Lead, now: float) -> PrecedingVehicle | None:
        """What the warning group needs of the camera's lead car: its ID, not its plate."""
        if lead.identity is LeadIdentity.NO_LEAD or lead.gap_m is None:
            return None
        car_id = None if lead.text is None else self._car_id(lead.text, now)
        return PrecedingVehicle(car_id, lead.gap_m, lead.closing_speed_m_s)

    def _car_id(self, plate_text: str, now: float) -> lcca.CarId:
        return self._digest.car_id(plate_text, now + self._security.utc_offset_s)
