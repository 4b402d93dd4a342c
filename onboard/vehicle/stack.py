"""One vehicle on its wires, still without I/O: bytes, signatures and frames around a `Vehicle`.

`Stack.step` is the one place where a vehicle receives, decides and sends. The daemon, the rig in
virtual time and both replays call it.
"""

import math
from collections.abc import Callable, Iterable, Iterator
from functools import partial
from itertools import starmap
from typing import TYPE_CHECKING

import numpy as np

from onboard.access.driver_model import DriverModel
from onboard.errors import DecodeError
from onboard.its_g5.congestion_control import CongestionControl
from onboard.kinematics.units import STANDARD_GRAVITY_M_S2
from onboard.lcca.group import WarningGroup
from onboard.lcca.identification import Identification
from onboard.messages import lcca
from onboard.messages.bsm import BasicSafetyMessage
from onboard.messages.exchanged import MessageSent
from onboard.messages.lcca import LccaPdu
from onboard.obd.can_frame import CanFrame
from onboard.obd.vehicle_bus import VehicleBus
from onboard.observations import (
    BrakeCause,
    Curvature,
    Discarded,
    HardBrake,
    Position,
    Sensor,
    SensorLost,
    SensorRecovered,
)
from onboard.security.credentials import Credentials
from onboard.security.plate_digest import PlateDigest
from onboard.security.pseudonyms import CertificateExpired, FreshEntropy, Pseudonyms
from onboard.security.region import TwoDLocation
from onboard.security.rejection import RejectionReason
from onboard.security.security_services import Opened, SecurityServices
from onboard.sensors.host_state import PLACE_VALID_S
from onboard.step import (
    BrakeButton,
    Input,
    ProgramMessage,
    ReceivedWsm,
    SentWsm,
    StepOutputs,
    send_later,
)
from onboard.tracking.perceived_object import PerceivedObject
from onboard.vehicle.config import CarConfig
from onboard.vehicle.framing import RadioFraming, WaveFraming
from onboard.vehicle.lcca_link import LccaLink, RefusalError
from onboard.vehicle.message_set import J2735Messages, MessageSet
from onboard.vehicle.vehicle import ReceivedMessage, SentMessage, SharedMessage, Vehicle
from onboard.vehicle.wave_link import WaveLink
from onboard.wave_udp import psid
from onboard.wave_udp.settings import RadioProfile
from onboard.wave_udp.wsmp import WaveShortMessage

if TYPE_CHECKING:
    from onboard.obd.broadcast import BroadcastSignals

LCCA_LIFETIME_S = 0.5
"""Time a group message may wait for the radio; after it, the group's own timers repeat it."""

BSM_LIFETIME_S = 0.1
"""Time a BSM may wait for the radio: the shortest interval to the next one (SAE J2945/1)."""

PROGRAM_LIFETIME_S = 1.0
"""Time a message of another program may wait for the radio."""


class Stack:
    """One vehicle, its bus, its radio and its certificates."""

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
        fresh_entropy: FreshEntropy | None = None,
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
            fresh_entropy: asked at each change of the pseudonym for a new seed of `rng`.
        """
        self._config = config
        radio = config.radio
        if radio is not None and radio.profile is RadioProfile.ITS_G5:
            # Not imported with WAVE, whose start is a tenth shorter without.
            from onboard.vehicle.its_g5_framing import ItsG5Framing  # noqa: PLC0415
            from onboard.vehicle.its_messages import ItsMessages  # noqa: PLC0415

            self._messages: MessageSet = ItsMessages()
            self.framing: RadioFraming = ItsG5Framing(
                config.lcca_psid, self._last_fix, others=config.ports_of_programs
            )
            control = CongestionControl(radio.congestion_control, now)
        else:
            self._messages, self.framing, control = J2735Messages(), WaveFraming(), None
        self._security = SecurityServices(
            utc_s - now,
            credentials,
            certificate_interval_s=self.framing.certificate_interval_s,
            distributes=self.framing.distributes,
        )
        self._is_clock_wrong = False
        self._digest = digest or PlateDigest(config.security.plate_digest)
        self._pseudonyms = Pseudonyms(
            config.car.plate, self._digest, credentials, rng, fresh_entropy
        )
        self._pseudonym = self._pseudonyms.at(utc_s)
        self._bus = VehicleBus(config.obd, signals)
        services = {*self._messages.components, config.lcca_psid}
        self._link = WaveLink(self._security, services, self.framing, control)
        self._lcca_link = LccaLink(
            self._security, config.lcca_psid, credentials, self._digest, self.framing.payload_in
        )
        self._vehicle = Vehicle(
            config,
            tuple(sensors),
            rng,
            now=now,
            utc_offset_s=utc_s - now,
            pseudonym=self._pseudonym,
            digest=self._digest,
            driver=driver,
            is_road_side_unit=None if credentials is None else self._security.is_road_side_unit,
            bus=self._bus,
            link=self._link,
            radio_opens_at=self._link.opens_at,
        )
        self._use_credential(now)

    @property
    def digest(self) -> PlateDigest:
        """Plate digest, whose slow results are derived ahead in a thread."""
        return self._digest

    @property
    def group(self) -> WarningGroup:
        """Warning group, for display."""
        return self._vehicle.group

    @property
    def identification(self) -> Identification:
        """Identification of the lead, for display."""
        return self._vehicle.identification

    @property
    def surroundings(self) -> tuple[PerceivedObject | None, list[PerceivedObject]]:
        """Host vehicle (`None` without a position) and perceived objects at the last assessment."""
        return self._vehicle.surroundings

    @property
    def awaits_speeds(self) -> bool:
        """Whether a received warning waits for a BSM that confirms it."""
        return self._vehicle.awaits_speeds

    def curvature(self, now: float) -> Curvature | None:
        """Curvature of the vehicle's path, for the camera; `None` while nothing measures it."""
        return self._vehicle.host.curvature(now)

    def known_signer(self, wsm: WaveShortMessage) -> bytes | None:
        """See `WaveLink`."""
        return self._link.known_signer(wsm)

    def certificate_in(self, wsm: WaveShortMessage) -> tuple[bytes, bool] | None:
        """See `WaveLink`."""
        return self._link.certificate_in(wsm)

    # ---- the step -------------------------------------------------------------------------

    def step(
        self,
        inputs: Iterable[Input],
        now: float,
        utc_s: float | None = None,
        send: Callable[[SentWsm], None] = send_later,
    ) -> StepOutputs:
        """Receive `inputs`, handle the timer if it is due, and put out what follows.

        Args:
            inputs: in the order of arrival. Each is handled before the next is drawn, so that a
                lazy iterable can end the step's inputs by the clock.
            now: time on the clock of the cores in s; never less than in an earlier step.
            utc_s: the same instant in seconds since 1970, which messages and IDs need; `None`
                keeps the offset.
            send: called with each WSM as soon as it is signed; the outputs have it as well.
        """
        if utc_s is not None:
            self._security.utc_offset_s = utc_s - now
            self._vehicle.set_utc_offset(utc_s - now)
        self._change_pseudonym_if_due(now)
        for each in inputs:
            self._receive(each, now)
        wsms: list[SentWsm] = []
        if self.get_timer() <= now:
            self._send(self._urgent_wsms_to_send(now), send, wsms)  # assessing takes long
            self._vehicle.handle_timer(now)
        self._send(self._wsms_to_send(now), send, wsms)
        can_frames = self._bus.frames_to_send(now)
        return StepOutputs(wsms, can_frames, self._vehicle.take_events(), self.get_timer())

    def get_timer(self) -> float:
        """Return when the next step is due without any input; `math.inf` if never."""
        return self._vehicle.get_timer()

    def _change_pseudonym_if_due(self, now: float) -> None:
        """Change it before anything is received: what then waits to be sent names the new one."""
        pseudonym = self._pseudonyms.at(self._security.utc_s(now))
        if pseudonym is not self._pseudonym:
            self._pseudonym = pseudonym
            self._vehicle.change_pseudonym(pseudonym, now)
            self._use_credential(now)

    def _use_credential(self, now: float) -> None:
        self.framing.use_pseudonym(self._pseudonym)
        self._lcca_link.use_pseudonym(self._pseudonym)
        credential = self._pseudonym.credential
        if credential is None:
            return
        self._security.sign_with(credential)
        if self._pseudonym.is_out_of_date(self._security.utc_s(now)):
            until_utc_s = credential.certificate.subject.valid_until_utc_s
            self._vehicle.put_out(CertificateExpired(now, until_utc_s))

    # ---- in -------------------------------------------------------------------------------

    def _receive(self, received: Input, now: float) -> None:
        match received:
            case ReceivedWsm():
                self._receive_wsm(received.data, now)
            case CanFrame():
                self._bus.receive_frame(received, now)
                self._vehicle.take_bus(now)
            case BrakeButton():
                threshold_m_s2 = self._config.obd.hard_brake_threshold_g * STANDARD_GRAVITY_M_S2
                test = HardBrake(now, threshold_m_s2, "button", BrakeCause.TEST)
                self._vehicle.receive_observation(test, now)
            case ProgramMessage(service=service, user_priority=priority, data=data):
                self._link.submit(data, service, priority, PROGRAM_LIFETIME_S, now)
            case SensorRecovered(sensor=Sensor.RADIO) if self._is_clock_wrong:
                self._vehicle.receive_observation(received, now)
                self._report_wrong_clock(now)  # the unit is reached, and no one else
            case _:
                self._vehicle.receive_observation(received, now)

    def _receive_wsm(self, data: bytes, now: float) -> None:
        received = self._link.receive_wsm(data, now)
        self._check_clock(now)
        if received is None:
            return
        service, opened, data = received
        if service not in psid.AWARENESS and not opened.is_valid_at(self._own_place(now)):
            self._discard_outside_region(opened, now)
            return
        is_lcca = service == self._config.lcca_psid
        try:
            message: ReceivedMessage | LccaPdu | None = (
                lcca.decode(data)
                if is_lcca
                else self._messages.decode(
                    service, data, opened.signer_id, self._security.utc_s(now), opened.ssp
                )
            )
        except DecodeError as error:
            component = "lcca" if is_lcca else self._messages.components[service]
            self._vehicle.put_out(Discarded(now, component, error.reason, error.detail))
            return
        if isinstance(message, BasicSafetyMessage) and not opened.is_valid_at(
            _place_in(message) or self._own_place(now)
        ):
            self._discard_outside_region(opened, now)
            return
        if isinstance(message, LccaPdu):
            self._receive_lcca(message, opened, now)
            return
        if message is not None:
            made_at_s = self._security.made_at_s(opened, now)
            self._vehicle.receive_message(message, opened.signer_id, made_at_s, now)

    def _check_clock(self, now: float) -> None:
        """Show the radio as lost while all others have another time: what they send is refused."""
        is_wrong = self._security.clock_check.is_wrong
        if is_wrong == self._is_clock_wrong:
            return
        self._is_clock_wrong = is_wrong
        if is_wrong:
            self._report_wrong_clock(now)
        else:
            self._vehicle.receive_observation(SensorRecovered(now, Sensor.RADIO), now)

    def _report_wrong_clock(self, now: float) -> None:
        loss = SensorLost(now, Sensor.RADIO, None, "clock_wrong")
        self._vehicle.receive_observation(loss, now)

    def _receive_lcca(self, pdu: LccaPdu, opened: Opened, now: float) -> None:
        try:
            message, stated = self._lcca_link.receive_pdu(pdu, opened, self._own_place(now), now)
        except RefusalError as refusal:
            detail = f"{pdu.message.kind} from {pdu.message.sender_id.hex()}"
            self._vehicle.put_out(Discarded(now, "lcca", str(refusal), detail))
            return
        made_at_s = self._security.made_at_s(opened, now)
        self._vehicle.receive_message(message, opened.signer_id, made_at_s, now, stated)

    def _discard_outside_region(self, opened: Opened, now: float) -> None:
        """Report a message from where its certificate is not valid."""
        reason, signer = RejectionReason.OUTSIDE_REGION, opened.signer_id or b""
        self._vehicle.put_out(Discarded(now, "security", reason, f"from {signer.hex()}"))

    def _own_place(self, now: float) -> TwoDLocation | None:
        """Return where the vehicle is, as far as that is known."""
        fix = self._vehicle.host.position(now, PLACE_VALID_S)
        return None if fix is None else TwoDLocation(fix.latitude_deg, fix.longitude_deg)

    def _last_fix(self) -> Position | None:
        return self._vehicle.host.position(0.0, math.inf)

    # ---- out ------------------------------------------------------------------------------

    def _send(
        self, wsms: Iterator[SentWsm], send: Callable[[SentWsm], None], sent: list[SentWsm]
    ) -> None:
        """Send each WSM before the next is composed."""
        for wsm in wsms:
            send(wsm)
            sent.append(wsm)

    def _urgent_wsms_to_send(self, now: float) -> Iterator[SentWsm]:
        """Yield what the group answers to the inputs of a step."""
        for message in self._vehicle.group_messages_to_send(now):
            self._submit(message, now)
        yield from starmap(partial(SentWsm, now), self._link.urgent_wsms_to_send(now))

    def _wsms_to_send(self, now: float) -> Iterator[SentWsm]:
        """Yield what the radio is given, a warning before the BSM after it is composed."""
        for message in self._vehicle.messages_to_send(now):
            self._submit(message, now)
            yield from starmap(partial(SentWsm, now), self._link.urgent_wsms_to_send(now))
        yield from starmap(partial(SentWsm, now), self._link.wsms_to_send(now))

    def _submit(self, message: SentMessage, now: float) -> None:
        if not isinstance(message, BasicSafetyMessage | SharedMessage):
            self._submit_lcca(message, now)
            return
        for service, data, priority in self._messages.encode(
            message, now, self._security.utc_s(now)
        ):
            self._link.submit(data, service, priority, BSM_LIFETIME_S, now)

    def _submit_lcca(self, message: lcca.LccaMessage, now: float) -> None:
        data, priority = self._lcca_link.encode(message), message.user_priority
        size_bytes = self._link.submit(
            data,
            self._config.lcca_psid,
            priority,
            LCCA_LIFETIME_S,
            now,
            may_wait=isinstance(message, lcca.Join | lcca.Reply),
        )
        self._vehicle.put_out(
            MessageSent(now, message.kind, priority, size_bytes, lcca.as_dict(message))
        )


def _place_in(message: BasicSafetyMessage) -> TwoDLocation | None:
    core = message.core
    if core.latitude_deg is None or core.longitude_deg is None:
        return None
    return TwoDLocation(core.latitude_deg, core.longitude_deg)
