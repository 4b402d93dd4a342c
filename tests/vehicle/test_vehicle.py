"""Vehicles in values: messages pass from one to the other as they are, without bytes."""

import numpy as np
import pytest
from typing_extensions import override

from onboard.core import Core
from onboard.lcca.events import WarningRaised
from onboard.messages.bsm import BasicSafetyMessage
from onboard.messages.exchanged import MessageReceived
from onboard.observations import BrakeCause, HardBrake, Position, Sensor, Speed
from onboard.risk.alarm import Alarm, Level
from onboard.risk.lcca_warning import LCCA
from onboard.security.plate_digest import PlateDigest
from onboard.security.pseudonyms import Pseudonyms
from onboard.settings import parse_settings
from onboard.trace.trace_line import Event
from onboard.vehicle.config import CarConfig
from onboard.vehicle.vehicle import ObservationSource, SentMessage, Vehicle
from tests.leads import known_lead

UTC_S = 1_700_000_100.0
AHEAD, BEHIND = "AAA1", "BBB2"


def vehicle(plate: str, bus: ObservationSource | None = None) -> Vehicle:
    security = {"plate_digest": {"scrypt_log2_n": 1}}
    config = parse_settings({"car": {"plate": plate}, "security": security}, CarConfig, plate)
    rng = np.random.default_rng(len(plate))
    digest = PlateDigest(config.security.plate_digest)
    return Vehicle(
        config,
        (Sensor.SPEED, Sensor.CAMERA),
        rng,
        now=0.0,
        utc_offset_s=UTC_S,
        pseudonym=Pseudonyms(plate, digest, None, rng).at(UTC_S),
        digest=digest,
        bus=bus,
    )


class Lane:
    """One vehicle behind the other, in steps of 20 ms."""

    def __init__(self) -> None:
        self.vehicles = {plate: vehicle(plate) for plate in (AHEAD, BEHIND)}
        self.sent: list[SentMessage] = []
        self.events: dict[str, list[Event]] = {plate: [] for plate in self.vehicles}
        self.now = 0.0

    def drive(self, duration_s: float) -> None:
        until_s = self.now + duration_s
        while self.now < until_s:
            self.now += 0.02
            for plate, each in self.vehicles.items():
                each.receive_observation(Speed(self.now, 15.0, 0.28, "test"), self.now)
                if plate == BEHIND:
                    each.receive_observation(known_lead(self.now, AHEAD), self.now)
                if each.get_timer() <= self.now:
                    each.handle_timer(self.now)
                self._send(plate, [*each.messages_to_send(self.now)])
                self.events[plate] += iter(each.next_event, None)

    def _send(self, plate: str, messages: list[SentMessage]) -> None:
        self.sent += messages
        for message in messages:
            for other, each in self.vehicles.items():
                if other != plate:
                    each.receive_message(message, None, self.now, self.now)


@pytest.fixture
def lane() -> Lane:
    two = Lane()
    two.drive(2.0)
    return two


def test_bsms_are_put_out_as_values_and_in_steps_of_20_ms_nine_to_ten_a_second(lane: Lane) -> None:
    bsms = sum(isinstance(each, BasicSafetyMessage) for each in lane.sent)
    assert 2 * 2 * 9 <= bsms <= 2 * 2 * 10


def test_a_braking_ahead_raises_the_alarm_behind(lane: Lane) -> None:
    brake = HardBrake(lane.now, 6.0, "test", BrakeCause.DECELERATION)
    lane.vehicles[AHEAD].receive_observation(brake, lane.now)
    lane.drive(0.5)

    raised = {
        plate: [
            each.cause for each in events if isinstance(each, Alarm) and each.level is Level.WARNING
        ]
        for plate, events in lane.events.items()
    }
    assert raised == {AHEAD: [], BEHIND: [LCCA]}


def test_a_message_is_reported_before_what_follows_from_it(lane: Lane) -> None:
    lane.events[BEHIND].clear()
    brake = HardBrake(lane.now, 6.0, "test", BrakeCause.DECELERATION)
    lane.vehicles[AHEAD].receive_observation(brake, lane.now)
    lane.drive(0.5)

    kinds = [type(event) for event in lane.events[BEHIND]]
    assert kinds.index(MessageReceived) < kinds.index(WarningRaised) < kinds.index(Alarm)


def test_what_its_bus_puts_out_when_its_timer_is_due_is_received() -> None:
    class OneSpeed(Core):
        """A bus whose timer is due once."""

        def __init__(self) -> None:
            self.speeds: list[Speed] = []

        @override
        def handle_timer(self, now: float) -> None:
            self.speeds.append(Speed(now, 15.0, 0.28, "test"))

        @override
        def next_event(self) -> Speed | None:
            return self.speeds.pop() if self.speeds else None

    one = vehicle(AHEAD, OneSpeed())
    one.handle_timer(0.2)
    (message,) = (each for each in one.messages_to_send(0.2) if each.kind == "bsm")

    assert isinstance(message, BasicSafetyMessage)
    assert message.core.speed_m_s == 15.0


def test_all_events_at_once_come_in_the_order_of_single_ones() -> None:
    def braking() -> Lane:
        lane = Lane()
        lane.drive(1.0)
        for each in lane.vehicles.values():
            each.receive_observation(Speed(lane.now, 15.0, 0.28, "test"), lane.now)
        brake = HardBrake(lane.now, 6.0, "test", BrakeCause.DECELERATION)
        lane.vehicles[AHEAD].receive_observation(brake, lane.now)
        lane._send(AHEAD, [*lane.vehicles[AHEAD].messages_to_send(lane.now)])
        for each in lane.vehicles.values():
            each.handle_timer(lane.now + 2.0)  # its sensors are lost, too
        return lane

    single = {plate: [*iter(one.next_event, None)] for plate, one in braking().vehicles.items()}
    at_once = {plate: one.take_events() for plate, one in braking().vehicles.items()}
    assert at_once == single
    assert len({type(event) for event in single[BEHIND]}) > 3


def test_its_position_is_the_last_of_its_receiver() -> None:
    one = vehicle(AHEAD)
    assert one.host.position(0.0) is None
    first, last = (
        Position(0.0, north_deg, 11.0, None, 1.0, 14.0, 0.0) for north_deg in (48.0, 48.1)
    )
    for fix in (first, last):
        one.receive_observation(fix, 0.0)
    assert one.host.position(0.0) == last
