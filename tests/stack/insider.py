"""A signing host vehicle on an open road, and an insider with one certificate who alarms it."""

import math
from collections.abc import Callable, Iterable

import numpy as np

from onboard import psid
from onboard.config import CarConfig
from onboard.kinematics.local_frame import LocalFrame
from onboard.messages import bsm
from onboard.messages.bsm import BasicSafetyMessage
from onboard.messages.bsm_core import CoreData, PositionalAccuracy
from onboard.messages.bsm_safety import VehicleEventFlags, VehicleSafetyExtensions
from onboard.mvs.footer_coding import encode_within
from onboard.observations import DetectionList, Position, Speed, VehicleDetection
from onboard.risk.alarm import Alarm, Cause, Level
from onboard.security.credentials import Credentials
from onboard.security.security_services import SecurityServices
from onboard.security.signer_credibility import SignerIgnored
from onboard.settings import parse_settings
from onboard.stack import Stack
from onboard.step import Input, ReceivedWsm
from onboard.trace.trace_line import Event
from onboard.tracking.evidence import Measurement, MeasurementId
from onboard.wave_udp import wsmp
from onboard.wave_udp.wsmp import WaveShortMessage
from tests.security.trial import ALICE, UTC_S

ORIGIN = LocalFrame(48.1, 11.5)
SPEED_M_S = 14.0
STEP_S = 0.1

Sent = bytes
"""A WSM."""


def placed(east_m: float, north_m: float) -> tuple[float, float]:
    metres_per_degree = 111_200.0
    latitude_deg = ORIGIN.latitude_deg + north_m / metres_per_degree
    slant = math.cos(math.radians(latitude_deg))
    return latitude_deg, ORIGIN.longitude_deg + east_m / (metres_per_degree * slant)


class Insider:
    """Signs what it likes; knows where the host vehicle is."""

    def __init__(self, keys: Credentials, name: bytes = b"evil") -> None:
        self.name = name
        self.security = SecurityServices(UTC_S, keys)
        self.count = 0

    def bsm_at(
        self,
        place_m: tuple[float, float],
        velocity_m_s: tuple[float, float],
        now: float,
        *,
        name: bytes | None = None,
        braking: bool = False,
        footer: bytes | None = None,
    ) -> Sent:
        self.count += 1
        latitude_deg, longitude_deg = placed(*place_m)
        core = CoreData(
            self.count % 128,
            name or self.name,
            (UTC_S + now) % 60.0,
            latitude_deg,
            longitude_deg,
            None,
            PositionalAccuracy(0.5, 0.5),
            speed_m_s=math.hypot(*velocity_m_s),
            heading_rad=math.atan2(*velocity_m_s) % math.tau,
        )
        events = VehicleEventFlags.HARD_BRAKING if braking else None
        safety = VehicleSafetyExtensions(events=events) if braking else None
        payload = bsm.encode(BasicSafetyMessage(core, safety, footer=footer))
        return self.signed(payload, psid.BSM, now)

    def signed(self, payload: bytes, service: int, now: float) -> Sent:
        secured = self.security.secure(payload, service, now)
        return wsmp.encode(WaveShortMessage(service, secured))

    def footer(
        self, number: int, place_m: tuple[float, float], now: float, sigma_m: float = 0.3
    ) -> bytes:
        """A vehicle without radio at a place, as if it had just been measured."""
        stamp_ms = round((UTC_S + now) * 1000)
        identity = MeasurementId(self.name, stamp_ms)
        anchor = LocalFrame(*placed(*place_m))
        measured = Measurement(identity, np.zeros(2), sigma_m**2 * np.eye(2))
        data, _ = encode_within([(number, measured)], stamp_ms, anchor, anchor, 400)
        return data


class Victim:
    """Drives north at constant speed past nobody; its detector looks ahead and works."""

    def __init__(self, *, checks: bool = True, detector: bool = True) -> None:
        tree = {
            "car": {"plate": "AAA1"},
            "gnss": {},
            "security": {"plate_digest": {"scrypt_log2_n": 1}, "check_braking": checks},
        }
        if detector:
            tree["detector"] = {}
        config = parse_settings(tree, CarConfig, "test")
        self.stack = Stack(
            config,
            config.sensors(),
            np.random.default_rng(1),
            now=0.0,
            utc_s=UTC_S,
            credentials=ALICE,
        )
        self.has_detector = detector
        self.now = 0.0
        self.north_m = 0.0
        self.speed_m_s = SPEED_M_S
        self.seen: tuple[VehicleDetection, ...] = ()
        self.events: list[Event] = []

    def drive(self, duration_s: float, *attacks: Callable[[float], Iterable[Sent]]) -> None:
        for _ in range(round(duration_s / STEP_S)):
            self.step(*attacks)

    def step(self, *attacks: Callable[[float], Iterable[Sent]]) -> None:
        self.now += STEP_S
        now = self.now
        self.north_m += STEP_S * self.speed_m_s
        fix = Position(now, *placed(0.0, self.north_m), None, 0.5, self.speed_m_s, 0.0)
        inputs: list[Input] = [fix, Speed(now, self.speed_m_s, 0.1, "dbc")]
        if self.has_detector:
            inputs.append(DetectionList(now, self.seen))
        inputs += [ReceivedWsm(now, wsm) for attack in attacks for wsm in attack(now)]
        self.events += self.stack.step(inputs, now).events

    def raised(self, since_s: float = 0.0) -> list[Alarm]:
        """The alarms that began since a time."""
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

    def alarmed_s(self) -> float:
        """How long at least one alarm was on."""
        active: set[tuple[Cause, str]] = set()
        total_s, before_s = 0.0, 0.0
        for event in [*(each for each in self.events if isinstance(each, Alarm))]:
            total_s += (event.stamp_s - before_s) if active else 0.0
            before_s = event.stamp_s
            key = event.cause, event.vehicle
            active = active - {key} if event.level is Level.NONE else active | {key}
        return total_s + (self.now - before_s if active else 0.0)

    def ignored(self) -> list[SignerIgnored]:
        return [event for event in self.events if isinstance(event, SignerIgnored)]
