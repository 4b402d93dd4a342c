"""A signing host vehicle on an open road, insiders who alarm it, and vehicles that truly cross.

The host drives north at constant speed. Its detector works and sees none of the others, so that
every alarm rests on claims alone.
"""

import math
from collections.abc import Callable, Container, Iterable, Iterator
from dataclasses import replace

import numpy as np

from onboard.kinematics.local_frame import LocalFrame
from onboard.messages import cpm, psm, sdsm, vam
from onboard.messages.bsm import BasicSafetyMessage
from onboard.messages.bsm_core import AccelerationSet, CoreData, PositionalAccuracy
from onboard.messages.bsm_safety import VehicleEventFlags, VehicleSafetyExtensions
from onboard.misbehaviour.signer_credibility import SignerIgnored
from onboard.mvs import cpm_coding
from onboard.mvs.cpm_coding import SharedObject
from onboard.mvs.footer_coding import encode_within
from onboard.mvs.sdsm_coding import MeasuredObject, message_of
from onboard.mvs.sdsm_coding import Sender as SharingSender
from onboard.observations import (
    DetectionList,
    Discarded,
    Lead,
    Position,
    Sensor,
    Side,
    Speed,
    TurnSignal,
    VehicleDetection,
)
from onboard.risk.alarm import Alarm, Cause, Level
from onboard.security.credentials import Credentials
from onboard.security.security_services import SecurityServices
from onboard.settings import parse_settings
from onboard.step import Input, ReceivedWsm
from onboard.trace.trace_line import Event
from onboard.tracking.evidence import Measurement, measurement_id
from onboard.vehicle.config import CarConfig
from onboard.vehicle.framing import RadioFraming, WaveFraming
from onboard.vehicle.its_g5_framing import ItsG5Framing
from onboard.vehicle.its_messages import ItsMessages
from onboard.vehicle.message_set import J2735Messages, MessageSet
from onboard.vehicle.stack import Stack
from onboard.wave_udp import psid
from sim_rig.road_side.person_messages import a_psm, a_vam

ORIGIN = LocalFrame(48.1, 11.5)
SPEED_M_S = 14.0
STEP_S = 0.1
FOOTER_BYTES = 400
PSEUDONYMS = 20
"""Certificates of one vehicle that are valid at a time: so many the US authorities issue a week."""
PLACE_SIGMA_M = 0.3
"""That insiders claim."""

Place = tuple[float, float]
"""Metres east and north of where the host vehicle starts."""
Sender = Callable[[float], Iterable[bytes]]
"""Returns the WSMs that are sent at a time."""
_OF_FRAMES = {WaveFraming.component, ItsG5Framing.component, "security"}
"""What drops a frame before its message is read."""


def placed(east_m: float, north_m: float) -> tuple[float, float]:
    """Return latitude and longitude of a place."""
    metres_per_degree = 111_200.0
    latitude_deg = ORIGIN.latitude_deg + north_m / metres_per_degree
    slant = math.cos(math.radians(latitude_deg))
    return latitude_deg, ORIGIN.longitude_deg + east_m / (metres_per_degree * slant)


class Counted:
    """A sender whose WSMs are counted."""

    def __init__(self, send: Sender) -> None:
        """Nothing is sent yet."""
        self._send, self.sent = send, 0

    def __call__(self, now: float) -> Iterator[bytes]:
        """Send as the sender does."""
        for wsm in self._send(now):
            self.sent += 1
            yield wsm


def refused(events: Iterable[Event]) -> int:
    """Return how many frames a vehicle dropped for their headers or signature."""
    return sum(isinstance(each, Discarded) and each.component in _OF_FRAMES for each in events)


def claimed_id(alarm: Alarm) -> str:
    """Return the temporary ID of the vehicle that an alarm is about, also if others use it."""
    return alarm.vehicle[:8]


class Signer:
    """A radio with a certificate, whose BSMs may be true or not."""

    def __init__(
        self,
        keys: Credentials,
        utc_s: float,
        temporary_id: bytes = b"evil",
        *,
        its_g5: bool = False,
    ) -> None:
        """Start at time 0, which is `utc_s`.

        Args:
            keys: the certificate, and those that it trusts.
            utc_s: seconds since 1970.
            temporary_id: of its BSMs.
            its_g5: whether it sends CAMs instead.
        """
        self._messages: MessageSet = ItsMessages() if its_g5 else J2735Messages()
        self._framing: RadioFraming = (
            ItsG5Framing(psid.LCCA, lambda: None) if its_g5 else WaveFraming()
        )
        self.its_g5 = its_g5
        self.temporary_id = temporary_id
        self.events: list[bytes] = []
        """DENMs that go with the last CAM."""
        self._utc_s = utc_s
        self._security = SecurityServices(utc_s, keys)
        self._sent = 0

    def bsm_at(
        self,
        place_m: Place | None,
        velocity_m_s: tuple[float, float],
        now: float,
        *,
        temporary_id: bytes | None = None,
        brakes: bool = False,
        acceleration_m_s2: float | None = None,
        footer: bytes | None = None,
        accuracy_m: float = 0.5,
    ) -> bytes:
        """Return a signed BSM in a WSM, or its CAM in a packet.

        Args:
            place_m: that it claims; `None` for none.
            velocity_m_s: east and north, that it claims.
            now: the time.
            temporary_id: another one than the own.
            brakes: whether the hard braking flag is set.
            acceleration_m_s2: that it claims.
            footer: of MVS.
            accuracy_m: sigma of the place, that it claims.
        """
        self._sent += 1
        latitude_deg, longitude_deg = (None, None) if place_m is None else placed(*place_m)
        core = CoreData(
            self._sent % 128,
            temporary_id or self.temporary_id,
            (self._utc_s + now) % 60.0,
            latitude_deg,
            longitude_deg,
            None,
            PositionalAccuracy(*(() if place_m is None else (accuracy_m, accuracy_m))),
            speed_m_s=math.hypot(*velocity_m_s),
            heading_rad=math.atan2(*velocity_m_s) % math.tau,
            acceleration=AccelerationSet(longitudinal_m_s2=acceleration_m_s2),
        )
        safety = VehicleSafetyExtensions(events=VehicleEventFlags.HARD_BRAKING) if brakes else None
        message = BasicSafetyMessage(core, safety, footer=footer)
        *self.events, awareness = [
            self.signed(each.data, each.service, now)
            for each in self._messages.encode(message, now, self._utc_s + now)
        ]
        return awareness

    def person_at(self, place_m: Place, now: float, temporary_id: bytes) -> bytes:
        """Return a signed PSM in a WSM, or its VAM in a packet, of a person who stands there."""
        if self.its_g5:
            message = a_vam(temporary_id, placed(*place_m), self._utc_s + now)
            return self.signed(vam.encode(message), psid.VAM, now)
        self._sent += 1
        person = a_psm(temporary_id, placed(*place_m), self._utc_s + now, self._sent % 128)
        return self.signed(psm.encode(person), psid.PSM, now)

    def footer(self, number: int, place_m: Place, now: float) -> bytes:
        """Return a footer with a vehicle without radio, as if measured now."""
        stamp_ms = round((self._utc_s + now) * 1000)
        identity = measurement_id(self.temporary_id, stamp_ms)
        anchor = LocalFrame(*placed(*place_m))
        measured = Measurement(identity, np.zeros(2), PLACE_SIGMA_M**2 * np.eye(2))
        data, _ = encode_within([(number, measured)], stamp_ms, anchor, anchor, FOOTER_BYTES)
        return data

    def sdsm_at(self, number: int, place_m: Place, now: float) -> bytes:
        """Return a signed SDSM in a WSM with a vehicle without radio, as if measured now."""
        now_ms, sender, measured = self._measured_at(place_m, now)
        self._sent += 1
        message = message_of(
            [MeasuredObject(number, measured, np.zeros(2), 1.0)],
            sender,
            now_ms,
            sender.anchor,
            self._sent % 128,
        )
        return self.signed(sdsm.encode(message), psid.SENSOR_SHARING, now)

    def _measured_at(self, place_m: Place, now: float) -> tuple[int, SharingSender, Measurement]:
        """Return UTC in ms, a sender at a place, and its measurement of a vehicle there."""
        now_ms = round((self._utc_s + now) * 1000)
        identity = measurement_id(self.temporary_id, now_ms)
        here = LocalFrame(*placed(*place_m))
        return (
            now_ms,
            SharingSender(self.temporary_id, here, PLACE_SIGMA_M),
            Measurement(identity, np.zeros(2), PLACE_SIGMA_M**2 * np.eye(2)),
        )

    def cpm_at(self, number: int, place_m: Place, now: float, *, evidence: bool) -> bytes:
        """Return a signed CPM in a packet, as `sdsm_at`; `evidence`: with what MVS adds."""
        now_ms, sender, measured = self._measured_at(place_m, now)
        each = SharedObject(number, measured, np.zeros(2), 1.0, is_sensed=True)
        message, _ = cpm_coding.encode_within(
            [each], sender, now_ms, sender.anchor, FOOTER_BYTES, perceived=1
        )
        if not evidence:
            message = replace(message, perceived=replace(message.perceived, evidence=None))
        return self.signed(cpm.encode(message), psid.CPM, now)

    def signed(self, payload: bytes, service: int, now: float) -> bytes:
        """Return a payload signed, in a frame."""
        signed_part = self._framing.signed_part(payload, service, 0, now, self._utc_s + now)
        return self._framing.frame(service, self._security.secure(signed_part, service, now))


def pseudonyms_of(
    keys: Credentials, insider: int, utc_s: float, *, its_g5: bool = False
) -> list[Signer]:
    """Return a radio for each pseudonym of an insider."""
    return [
        Signer(
            replace(keys, pseudonyms=(each,)),
            utc_s,
            bytes((0xD0 + insider,)) + bytes((0, 0, n)),
            its_g5=its_g5,
        )
        for n, each in enumerate(keys.pseudonyms)
    ]


class AttackedHost:
    """The host vehicle and its alarms."""

    def __init__(
        self,
        keys: Credentials,
        utc_s: float,
        *,
        checks: bool = True,
        detector: bool = True,
        camera: bool = False,
        **settings: object,
    ) -> None:
        """Start at time 0, which is `utc_s`.

        Args:
            keys: of the host vehicle.
            utc_s: seconds since 1970.
            checks: whether brakings and claims are checked.
            detector: whether it has one.
            camera: the same.
            settings: further ones of the vehicle, by the section of its configuration.
        """
        tree: dict[str, object] = {
            "car": {"plate": "AAA1"},
            "gnss": {},
            "security": {"plate_digest": {"scrypt_log2_n": 1}, "check_braking": checks},
            **settings,
        }
        if detector:
            tree["detector"] = {}
        config = parse_settings(tree, CarConfig, "the attacked host")
        rng = np.random.default_rng(1)
        sensors = config.sensors() | ({Sensor.CAMERA} if camera else set())
        self.stack = Stack(config, sensors, rng, now=0.0, utc_s=utc_s, credentials=keys)
        self.utc_s = utc_s
        self.now = 0.0
        self.north_m = 0.0
        self.seen: tuple[VehicleDetection, ...] = ()
        """By its detector."""
        self.lead: Lead | None = None
        """By its camera."""
        self.signals: Side | None = None
        """Turn signal that is on."""
        self.events: list[Event] = []
        self._has_detector = detector

    def drive(self, duration_s: float, *senders: Sender) -> None:
        """Drive, and receive what `senders` send ten times a second."""
        for _ in range(round(duration_s / STEP_S)):
            self.now += STEP_S
            self.north_m += STEP_S * SPEED_M_S
            fix = Position(self.now, *placed(0.0, self.north_m), None, 0.5, SPEED_M_S, 0.0)
            inputs: list[Input] = [fix, Speed(self.now, SPEED_M_S, 0.1, "dbc")]
            if self._has_detector:
                inputs.append(DetectionList(self.now, self.seen))
            inputs += [] if self.lead is None else [self.lead]
            if self.signals is not None:
                inputs.append(TurnSignal(self.now, self.signals, is_on=True, source="dbc"))
            inputs += [ReceivedWsm(self.now, wsm) for send in senders for wsm in send(self.now)]
            self.events += self.stack.step(inputs, self.now).events

    def raised(self, since_s: float = 0.0) -> list[Alarm]:
        """Return the alarms that began since a time, each once however its level changed."""
        active: set[tuple[Cause, str]] = set()
        began = []
        for event in self.events:
            if not isinstance(event, Alarm):
                continue
            key = event.cause, event.vehicle
            if event.level is Level.NONE:
                active.discard(key)
            elif key not in active:
                active.add(key)
                began += [event] if event.stamp_s >= since_s else []
        return began

    def alarmed_s(self, true: Container[str] = ()) -> float:
        """Return for how long at least one alarm was on, beside those of `true` vehicles."""
        active: set[tuple[Cause, str]] = set()
        total_s = before_s = 0.0
        for event in self.events:
            if not isinstance(event, Alarm) or claimed_id(event) in true:
                continue
            total_s += event.stamp_s - before_s if active else 0.0
            before_s, key = event.stamp_s, (event.cause, event.vehicle)
            active = active - {key} if event.level is Level.NONE else active | {key}
        return total_s + (self.now - before_s if active else 0.0)

    def ignored(self) -> list[SignerIgnored]:
        """Return the reports of signers that are ignored."""
        return [event for event in self.events if isinstance(event, SignerIgnored)]
