"""The cores of one vehicle, connected, in values: the function that it has, without wires.

A `Vehicle` is given observations and decoded messages, and puts out messages to send and events.
It knows no bytes, frames or signatures; `Stack` has these. Studies drive it too.

A message from the air has passed the radio's `WaveLink`, which opens what is signed, and `Stack`,
which decodes it. `receive_message` hands it on by its kind. A BSM is first compared with earlier
ones of its sender; then shared sensing takes position and footer, and the alarms take the rest.

A picture has become observations in the camera's process. `receive_observation` hands on what
`HostSensors` lets pass: `HostState` keeps it for whoever asks later, and those who need every
sample are given it. An alarm that takes observations as they arrive assesses the danger at once.

Ten times a second `Surroundings` updates the tracks, and gives alarms, intersections and
identification where the vehicles are.
"""

from collections import deque
from collections.abc import Callable, Collection, Iterator
from dataclasses import replace
from typing import Protocol

import numpy as np
from typing_extensions import override

from onboard.access.adaptation import AccessAdaptation, ReactionObserved
from onboard.access.driver_model import DEFAULT_POPULATION, DriverModel
from onboard.core import Core
from onboard.intersections.intersections import Intersections
from onboard.lcca.events import BrakingStatement
from onboard.lcca.group import WarningGroup
from onboard.lcca.identification import Identification
from onboard.messages import lcca
from onboard.messages.bsm import BasicSafetyMessage
from onboard.messages.bsm_core import VehicleSize
from onboard.messages.cpm import CollectivePerceptionMessage
from onboard.messages.exchanged import MessageReceived
from onboard.messages.lcca import LccaMessage
from onboard.messages.map_data import MapData
from onboard.messages.sdsm import SensorDataSharingMessage
from onboard.messages.spat import Spat
from onboard.misbehaviour.alarm_claims import AlarmClaims
from onboard.misbehaviour.misbehaviour_detection import MisbehaviourDetector
from onboard.observations import Discarded, HardBrake, Lead, Position, Sensor, Speed
from onboard.risk.alarm import Assessment, Cause
from onboard.security.plate_digest import PlateDigest
from onboard.security.pseudonyms import Pseudonym
from onboard.sensors.host_sensors import HostSensors
from onboard.sensors.host_state import HostState
from onboard.step import HostObservation
from onboard.trace.trace_line import Event
from onboard.tracking.perceived_object import PerceivedObject
from onboard.vehicle.config import CarConfig
from onboard.vehicle.lcca_application import LccaApplication
from onboard.vehicle.risk_response import RiskResponse
from onboard.vehicle.shared_sensing import SharedSensing
from onboard.vehicle.surroundings import Surroundings
from onboard.wave_udp.settings import RadioProfile

SharedMessage = SensorDataSharingMessage | CollectivePerceptionMessage
SentMessage = BasicSafetyMessage | SharedMessage | LccaMessage
ReceivedMessage = SentMessage | MapData | Spat


class ObservationSource(Protocol):
    """A core that puts out observations only."""

    def get_timer(self) -> float:
        """See `Core`."""

    def handle_timer(self, now: float) -> None:
        """See `Core`."""

    def next_event(self) -> HostObservation | None:
        """Remove and return the oldest observation; `None` when there is none."""


class Vehicle(Core):
    """One vehicle, in values."""

    def __init__(
        self,
        config: CarConfig,
        sensors: Collection[Sensor],
        rng: np.random.Generator,
        *,
        now: float,
        utc_offset_s: float,
        pseudonym: Pseudonym,
        digest: PlateDigest,
        driver: DriverModel | None = None,
        is_road_side_unit: Callable[[bytes], bool] | None = None,
        bus: ObservationSource | None = None,
        link: Core | None = None,
        radio_opens_at: Callable[[float], float] = lambda now: now,
    ) -> None:
        """Start at `now`.

        Args:
            config: settings of the vehicle.
            sensors: those fitted, which can time out.
            rng: source of all random draws.
            now: time on the clock of the cores in s.
            utc_offset_s: UTC in seconds since 1970 less that time.
            pseudonym: the present identifiers.
            digest: derives vehicle IDs from plates.
            driver: model learnt in earlier drives; the population's mean if not given.
            is_road_side_unit: whether a signer is one; `None` if messages are not signed: nobody's
                credibility is then known.
            bus: puts out observations; its timer has its place among those of the other cores.
            link: the radio's core, whose timer and events have theirs.
            radio_opens_at: given a `now`, returns when to ask again whether an awareness message
                would be sent at once; at most `now` if it would.
        """
        self._config = config
        self._utc_offset_s = utc_offset_s
        self._bus = bus
        self._radio_opens_at = radio_opens_at
        self._sensors = HostSensors(config.sensor_timeouts.limits_s(sensors), now)
        self.host = HostState()
        self._misbehaviour = MisbehaviourDetector(check_braking=config.security.check_braking)
        self._claims: AlarmClaims | None = None
        if is_road_side_unit is not None and config.security.check_braking:
            self._claims = AlarmClaims(
                self._misbehaviour.signer_of,
                is_road_side_unit,
                self.host,
                has_sight=Sensor.CAMERA in sensors or Sensor.DETECTOR in sensors,
            )
        self._lcca = LccaApplication(
            config.lcca.parameters(),
            config.car.plate,
            pseudonym,
            rng,
            digest=digest,
            utc_offset_s=utc_offset_s,
            misbehaviour=self._misbehaviour,
            claims=self._claims,
        )
        size_m = config.car.length_m, config.car.width_m
        self._sharing = SharedSensing(
            config.mvs,
            VehicleSize(length_m=size_m[0], width_m=size_m[1]),
            pseudonym,
            rng,
            self.host,
            now=now,
            utc_offset_s=utc_offset_s,
            tracks_sensed=config.brake_request is not None,
            etsi=config.radio_profile is RadioProfile.ITS_G5,
        )
        self._access = (
            AccessAdaptation(driver or DriverModel(DEFAULT_POPULATION), self.host)
            if config.access.enabled
            else None
        )
        self._intersections = Intersections()
        self._risk = RiskResponse(
            config.risk,
            size_m,
            self.host,
            brake_request=config.brake_request,
            admit=self._admit,
        )
        self._take_reaction_time()
        self._surroundings = Surroundings(
            self._sharing.mvs,
            self._intersections,
            self._claims,
            self._risk,
            self._lcca.identification,
            signer_of=self._misbehaviour.signer_of,
            now=now,
        )
        self._events: deque[Event] = deque()
        self._cores = tuple(self._all_cores(link))
        # Most cores lack one of the two, which every step would call in vain.
        self._timers = (
            self._surroundings.get_timer,
            *(core.get_timer for core in self._cores if _has_own("get_timer", core)),
        )
        self._reporting = [core for core in reversed(self._cores) if _has_own("next_event", core)]

    def _all_cores(self, link: Core | None) -> Iterator[Core | ObservationSource]:
        """Yield all cores, from the wires to the decisions.

        Timers are handled in this order. Events are put out in the reverse order: a decision
        precedes the reports of the cores that it is based on.
        """
        if self._config.beacons:  # without, its timer would stay due: no BSM is ever taken
            yield from self._sharing.cores
        if self._access is not None:
            yield self._access
        if self._bus is not None:
            yield self._bus
        if self._risk.brake_requester is not None:
            yield self._risk.brake_requester
        if self._claims is not None:
            yield from self._claims.cores
        yield from (self._risk.monitor, self._intersections, self._sharing.mvs)
        if link is not None:
            yield link
        yield self._sensors
        yield from self._lcca.cores

    @property
    def group(self) -> WarningGroup:
        """Warning group, for display."""
        return self._lcca.group

    @property
    def identification(self) -> Identification:
        """Identification of the lead, for display."""
        return self._lcca.identification

    @property
    def awaits_speeds(self) -> bool:
        """Whether a received warning waits for a BSM that confirms it."""
        return self._lcca.awaits_speeds

    @property
    def surroundings(self) -> tuple[PerceivedObject | None, list[PerceivedObject]]:
        """Host vehicle (`None` without a position) and perceived objects at the last assessment."""
        return self._surroundings.host_vehicle, self._surroundings.objects

    def set_utc_offset(self, utc_offset_s: float) -> None:
        """Set UTC less the time of the cores, which messages and IDs need."""
        self._utc_offset_s = utc_offset_s
        self._lcca.utc_offset_s = utc_offset_s
        self._sharing.set_utc_offset(utc_offset_s)

    def change_pseudonym(self, pseudonym: Pseudonym, now: float) -> None:
        """Change all identifiers at once, so that nothing links the old ones to the new ones."""
        self._lcca.change_pseudonym(pseudonym, now)
        self._sharing.change_pseudonym(pseudonym, now)
        self._lcca.follow_lead(now)

    # ---- time and events ------------------------------------------------------------------

    @override
    def get_timer(self) -> float:
        """Return when `handle_timer` is next due."""
        return min([timer() for timer in self._timers])

    @override
    def handle_timer(self, now: float) -> None:
        """Assess the risk if that is due, and handle the timers of all cores."""
        self._lcca.prepare_next_epoch(now)
        if now >= self._surroundings.get_timer():
            self._events.extend(self._surroundings.assess(now))
        for core in self._cores:
            core.handle_timer(now)
            self._pass_on(core, now)

    def _pass_on(self, core: Core | ObservationSource, now: float) -> None:
        """Take from a core what others are given; the events of most are only put out."""
        if core is self._access:
            self._take_access(now)
        elif core is self._bus:
            self.take_bus(now)
        elif core in self._lcca.cores:
            self._take_lcca(now)

    @override
    def next_event(self) -> Event | None:
        """Return the oldest event not yet taken; after those in order of time, each core's own."""
        if self._events:
            return self._events.popleft()
        events = (core.next_event() for core in self._reporting)
        return next((event for event in events if event is not None), None)

    def take_events(self) -> list[Event]:
        """Return all events not yet taken, in the order of `next_event`."""
        taken = list(self._events)
        self._events.clear()
        for core in self._reporting:
            while (event := core.next_event()) is not None:
                taken.append(event)
        return taken

    def put_out(self, event: Event) -> None:
        """Give an event of the wires its place in time among the vehicle's own."""
        self._events.append(event)

    # ---- in -------------------------------------------------------------------------------

    def receive_observation(self, observation: HostObservation, now: float) -> None:
        """Take what a sensor of the vehicle has measured."""
        if self._sensors.receive_observation(observation, now):
            self.take_checked(observation, now)

    def take_checked(self, observation: HostObservation, now: float) -> None:
        """Take what a sensor has measured that is known to be right."""
        self.host.receive_observation(observation)
        self._sharing.receive_observation(observation, now)
        match observation:
            case Speed():
                self._receive_speed(observation, now)
            case HardBrake():
                self._lcca.receive_hard_brake(observation, now)
            case Lead():
                self._receive_lead(observation, now)
            case Position():
                self._intersections.receive_position(observation)
        self._risk.receive_observation(observation, now)
        if self._access is not None:
            self._access.receive_observation(observation, now)
            self._take_access(now)
        self._events.append(observation)

    def _receive_speed(self, speed: Speed, now: float) -> None:
        if self._claims is not None:
            self._claims.receive_speed(speed.speed_m_s, now)
        self._lcca.receive_speed(speed, now)

    def _receive_lead(self, lead: Lead, now: float) -> None:
        if self._claims is not None:
            self._claims.receive_lead(lead, now)
        self._lcca.receive_lead(lead, now)

    def take_bus(self, now: float) -> None:
        """Receive the observations that the bus puts out."""
        while self._bus is not None and (observation := self._bus.next_event()) is not None:
            self.receive_observation(observation, now)

    def receive_message(
        self,
        message: ReceivedMessage,
        signer_id: bytes | None,
        made_at_s: float,
        now: float,
        stated: BrakingStatement | None = None,
    ) -> None:
        """Take a message from the air.

        Args:
            message: as decoded.
            signer_id: HashedId8 of its signer; `None` if it is not signed.
            made_at_s: when it was generated by its sender's clock, as a time of the cores.
            now: time of reception.
            stated: of a signed copy of a warning, what the braking vehicle stated.
        """
        match message:
            case BasicSafetyMessage():
                self._receive_bsm(message, signer_id, made_at_s, now)
            case SensorDataSharingMessage():
                if self._is_id_of("sdsm", message.source_id, signer_id, now):
                    self._sharing.mvs.receive_sdsm(message, now)
            case CollectivePerceptionMessage():
                if self._is_id_of("cpm", message.station_id, signer_id, now):
                    self._sharing.mvs.receive_cpm(message, now)
            case MapData():
                self._intersections.receive_map(message, signer_id, now)
            case Spat():
                utc_s = now + self._utc_offset_s
                self._intersections.receive_spat(message, signer_id, now, utc_s)
            case _:
                content = lcca.as_dict(message)
                self.put_out(MessageReceived(now, message.kind, signer_id, content))
                self._lcca.receive_message(
                    message,
                    signer_id,
                    made_at_s,
                    now,
                    stated,
                    heading_rad=self._sharing.heading_rad(now),
                )
                self._take_lcca(now)

    def _receive_bsm(
        self, message: BasicSafetyMessage, signer_id: bytes | None, made_at_s: float, now: float
    ) -> None:
        core = message.core
        sender = signer_id or core.temporary_id
        reason = self._misbehaviour.receive_bsm(sender, message, made_at_s, now)
        self._lcca.check_pending_warnings(now)
        self._take_lcca(now)
        if reason is not None:
            self._discard("bsm", reason, core.temporary_id, now)
            return
        if signer_id is not None and self._config.beacons:
            self._lcca.receive_bsm(signer_id, core.speed_m_s, now)
            self._take_lcca(now)
        remote_id = self._misbehaviour.remote_id(sender, core.temporary_id)
        if remote_id != core.temporary_id:
            # Footers name the sources of measurements by temporary ID: two cannot have one.
            message = replace(message, core=replace(core, temporary_id=remote_id), footer=None)
        if self._sharing.receive_bsm(message, sender, now):
            self._risk.monitor.receive_bsm(message, now)
        if core.speed_m_s is not None:
            self._lcca.identification.receive_speed_on_air(
                sender, core.temporary_id, core.speed_m_s, now
            )

    def _is_id_of(
        self, component: str, source_id: bytes, signer_id: bytes | None, now: float
    ) -> bool:
        """Return whether a temporary ID is its signer's; what shares under another's is dropped."""
        if self._misbehaviour.remote_id(signer_id or source_id, source_id) == source_id:
            return True
        self._discard(component, "implausible_identity", source_id, now)
        return False

    def _discard(self, component: str, reason: str, temporary_id: bytes, now: float) -> None:
        self._events.append(Discarded(now, component, reason, f"from {temporary_id.hex()}"))

    # ---- out ------------------------------------------------------------------------------

    def group_messages_to_send(self, now: float) -> Iterator[SentMessage]:
        """Yield the messages of the warning group that are due."""
        yield from self._lcca.messages_to_send(now)

    def messages_to_send(self, now: float) -> Iterator[SentMessage]:
        """Yield the messages that are due, those of LCCA first, in the order of sending.

        A BSM is composed when it is drawn: fusing what goes with it takes time. With many vehicles
        around, that is done in slices, in this step and the next ones.
        """
        yield from self.group_messages_to_send(now)
        if not self._config.beacons:
            return
        if self._sharing.is_due(now) and not self._is_prepared(now):
            return
        yield from self._sharing.messages_to_send(now, self._radio_opens_at)

    def _is_prepared(self, now: float) -> bool:
        """Whether tracks and footer are up to date; if not, a slice of them is done in a step."""
        is_assessed = now < self._surroundings.get_timer()
        return is_assessed and self._sharing.prepare_slice(now)

    # ---- between the cores ----------------------------------------------------------------

    def _admit(self, cause: Cause, assessment: Assessment, now: float) -> bool:
        return self._claims is None or self._claims.admit(cause, assessment, now)

    def _take_access(self, now: float) -> None:
        access = self._access
        if access is None:
            return
        self._sharing.transmitter.receive_max_interval(access.longest_interval_s, now)
        while (event := access.next_event()) is not None:
            self._events.append(event)
            if isinstance(event, ReactionObserved):
                self._take_reaction_time()

    def _take_reaction_time(self) -> None:
        if self._access is not None and self._access.reaction_s is not None:
            self._risk.receive_reaction_time(self._access.reaction_s)

    def _take_lcca(self, now: float) -> None:
        for event in self._lcca.take_events(now):
            self._events.append(event)
            self._risk.receive_event(event, now)


def _has_own(method: str, core: Core | ObservationSource) -> bool:
    """Whether a core has another method than that of `Core`, which does nothing."""
    return getattr(type(core), method) is not getattr(Core, method)
