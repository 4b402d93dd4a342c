"""A whole signing vehicle under any order of true, false, late and broken inputs."""

import math

import numpy as np
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule

from onboard.lcca.events import WarningRaised
from onboard.messages import lcca
from onboard.observations import (
    DetectionList,
    HardBrake,
    Lead,
    LeadIdentity,
    Position,
    Sensor,
    SensorLost,
    Speed,
    VehicleDetection,
)
from onboard.risk.alarm import Alarm, Level
from onboard.settings import parse_settings
from onboard.step import Input, ReceivedWsm
from onboard.trace.trace_line import Event, as_line
from onboard.tracking.tracks import MAX_TRACKS
from onboard.vehicle.config import CarConfig
from onboard.vehicle.stack import Stack
from onboard.wave_udp import psid
from sim_rig.studies.attacks.attack_world import Signer, placed
from tests.leads import known_lead
from tests.security.trial import ALICE, BOB, CAROL, DAVE, UTC_S

metres = st.floats(-200.0, 200.0)
speeds_m_s = st.floats(0.0, 60.0)
names = st.sampled_from([b"one.", b"two.", b"thre", bytes(4)])
car_ids = st.sampled_from([bytes(8), b"car id 1", b"car id 2", b"car id 3"])
numbers = st.integers(0, 9)
signers = st.integers(0, 2)

MOST_OBJECTS = MAX_TRACKS + 100


class AnyDrive(RuleBasedStateMachine):
    """Steps at any time after the last; what senders claim of time may be seconds off."""

    @initialize(seed=st.integers(0, 9))
    def start(self, seed: int) -> None:
        tree = {
            "car": {"plate": "AAA1"},
            "gnss": {},
            "detector": {},
            "security": {"plate_digest": {"scrypt_log2_n": 1, "epoch_s": 10.0}},
        }
        config = parse_settings(tree, CarConfig, "any drive")
        rng = np.random.default_rng(seed)
        sensors = (Sensor.CAMERA, Sensor.DETECTOR, Sensor.POSITION, Sensor.SPEED)
        self.stack = Stack(config, sensors, rng, now=0.0, utc_s=UTC_S, credentials=ALICE)
        self.signers = [Signer(keys, UTC_S) for keys in (BOB, CAROL, DAVE)]
        self.now, self.north_m = 0.0, 0.0
        self.speed_m_s, self.late_s = 15.0, 0.0
        self.events: list[Event] = []

    def receive(self, *inputs: Input, after_s: float = 0.1, utc_off_s: float = 0.0) -> None:
        self.now += after_s
        self.north_m += after_s * self.speed_m_s
        at_s = self.now - self.late_s
        outputs = self.stack.step(
            (
                Speed(at_s, self.speed_m_s, 0.1, "obd"),
                Position(at_s, *placed(0.0, self.north_m), None, 0.5, self.speed_m_s, 0.0),
                *inputs,
            ),
            self.now,
            UTC_S + self.now + utc_off_s,
        )
        assert outputs.timer_at >= 0.0
        self.events = outputs.events

    @rule(
        after_s=st.sampled_from([0.0, 0.01, 0.1, 1.0, 12.0]),
        utc_off_s=st.sampled_from([0.0, 0.0, 0.5, -40.0]),
    )
    def wait(self, after_s: float, utc_off_s: float) -> None:
        self.receive(after_s=after_s, utc_off_s=utc_off_s)

    @rule(speed_m_s=speeds_m_s, late_s=st.sampled_from([0.0, 0.0, 0.1, 2.0]))
    def drive(self, speed_m_s: float, late_s: float) -> None:
        self.speed_m_s, self.late_s = speed_m_s, late_s

    @rule(number=numbers, range_m=st.floats(0.5, 150.0), bearing_rad=st.floats(-1.0, 1.0))
    def see(self, number: int, range_m: float, bearing_rad: float) -> None:
        seen = VehicleDetection(self.now, number, range_m, 0.3, bearing_rad, 0.01)
        self.receive(DetectionList(self.now, (seen,)))

    @rule(gap_m=st.floats(1.0, 60.0), closing_m_s=st.floats(-20.0, 20.0), is_there=st.booleans())
    def look(self, gap_m: float, closing_m_s: float, *, is_there: bool) -> None:
        lead = known_lead(self.now, "BBB2", gap_m, closing_m_s)
        self.receive(lead if is_there else Lead(self.now, LeadIdentity.NO_LEAD))

    @rule(braking_m_s2=st.floats(0.0, 12.0), is_over=st.booleans())
    def brake(self, braking_m_s2: float, *, is_over: bool) -> None:
        self.receive(HardBrake(self.now, braking_m_s2, "obd", is_over=is_over))

    @rule(sensor=st.sampled_from([Sensor.CAMERA, Sensor.POSITION, Sensor.DETECTOR]))
    def lose(self, sensor: Sensor) -> None:
        self.receive(SensorLost(self.now, sensor, None, "unplugged"))

    @rule(
        who=signers,
        name=names,
        east_m=metres,
        north_m=metres,
        angle=st.floats(0.0, 6.0),
        speed_m_s=speeds_m_s,
        brakes=st.booleans(),
        number=numbers,
        late_s=st.sampled_from([0.0, 0.3, 4.0]),
    )
    def hear_bsm(
        self,
        *,
        who: int,
        name: bytes,
        east_m: float,
        north_m: float,
        angle: float,
        speed_m_s: float,
        brakes: bool,
        number: int,
        late_s: float,
    ) -> None:
        signer, at_s = self.signers[who], max(self.now - late_s, 0.0)
        place_m = east_m, self.north_m + north_m
        footer = signer.footer(number, (north_m, self.north_m + east_m), at_s)
        velocity = speed_m_s * math.sin(angle), speed_m_s * math.cos(angle)
        wsm = signer.bsm_at(
            place_m, velocity, at_s, temporary_id=name, brakes=brakes, footer=footer
        )
        self.receive(ReceivedWsm(self.now, wsm))

    @rule(
        who=signers,
        sender=car_ids,
        leader=car_ids,
        number=numbers,
        sequence=st.integers(0, 20),
        cause=st.sampled_from(list(lcca.WarnCause)),
    )
    def hear_warning(
        self,
        *,
        who: int,
        sender: bytes,
        leader: bytes,
        number: int,
        sequence: int,
        cause: lcca.WarnCause,
    ) -> None:
        warn = lcca.Warn(
            sender, leader, number, sender, sequence, 3, number, sequence, cause, 6.0, 0.1, 1
        )
        wsm = self.signers[who].signed(lcca.encode(warn), psid.LCCA, self.now)
        self.receive(ReceivedWsm(self.now, wsm))

    @rule(
        who=signers,
        service=st.sampled_from([psid.BSM, psid.LCCA, psid.MAP]),
        payload=st.binary(max_size=60),
    )
    def hear_anything(self, who: int, service: int, payload: bytes) -> None:
        self.receive(ReceivedWsm(self.now, self.signers[who].signed(payload, service, self.now)))

    @rule(data=st.binary(max_size=80))
    def hear_noise(self, data: bytes) -> None:
        self.receive(ReceivedWsm(self.now, data))

    @invariant()
    def every_alarm_has_a_cause(self) -> None:
        for event in getattr(self, "events", []):
            assert as_line(event)
            if isinstance(event, Alarm) and event.level is not Level.NONE:
                assert event.reasons
            if isinstance(event, WarningRaised):
                assert event.deceleration_m_s2 >= 0.0

    @invariant()
    def memory_is_bounded(self) -> None:
        if hasattr(self, "stack"):
            assert len(self.stack.surroundings[1]) <= MOST_OBJECTS
            assert len(self.stack.group.followers) <= 64


AnyDrive.TestCase.settings = settings(max_examples=10, stateful_step_count=40, deadline=None)
TestAnyDrive = AnyDrive.TestCase
