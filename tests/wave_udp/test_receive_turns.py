"""The share of time of known and unknown signers, on a clock that verifying moves."""

import math

import pytest

from onboard.messages import bsm
from onboard.messages.bsm import BasicSafetyMessage
from onboard.messages.bsm_core import CoreData
from onboard.messages.bsm_safety import VehicleEventFlags, VehicleSafetyExtensions
from onboard.security.ieee1609dot2 import encode_unsecured
from onboard.vehicle.framing import bsm_sender, is_plain_bsm
from onboard.wave_udp import psid
from onboard.wave_udp.receive_queue import NO_KEYS, ReceiveQueue
from onboard.wave_udp.receive_turns import (
    GATHER_S,
    LONGEST_TURN_S,
    RADIO_TURN_S,
    UNKNOWN_SIGNERS_SHARE,
    ReceiveTurns,
)
from onboard.wave_udp.wsmp import WaveShortMessage, encode

VERIFY_S = 0.000_25
"""Time that the cores take for one frame."""

UNKNOWN_PSID = psid.BSM + 1
"""Under which the frames of unknown signers come here."""


class Car:
    """A queue, its turns, and a clock that moves only while a frame is handled."""

    def __init__(self) -> None:
        self.now = 100.0
        self.count = 0
        self.queue = ReceiveQueue(
            psid.LCCA,
            bsm_sender,
            lambda message: None if message.psid == UNKNOWN_PSID else NO_KEYS,
            may_wait=is_plain_bsm,
        )
        self.has_input = True
        self.turns = ReceiveTurns(self.queue, lambda: self.now, lambda: self.has_input)

    def receive(self, service: int, count: int) -> None:
        for number in range(count):
            self.turns.put(encode(WaveShortMessage(psid=service, payload=number.to_bytes(4))))

    def receive_bsm(
        self, safety: VehicleSafetyExtensions | None = None, *, at_once: bool = False
    ) -> None:
        self.count += 1
        message = BasicSafetyMessage(CoreData(self.count, b"IDID"), safety)
        payload = encode_unsecured(bsm.encode(message))
        self.turns.put(encode(WaveShortMessage(psid=psid.BSM, payload=payload)), at_once=at_once)

    def step(self) -> int:
        """Return how many frames one step handles."""
        handled = 0
        for _ in self.turns.take(self.now):
            self.now += VERIFY_S
            handled += 1
        return handled


@pytest.fixture
def car() -> Car:
    return Car()


def test_a_step_takes_bsms_for_one_turn(car: Car) -> None:
    car.receive(psid.BSM, 10)

    assert car.step() == math.ceil(RADIO_TURN_S / VERIFY_S)


def test_a_turn_is_longer_while_no_wire_has_input(car: Car) -> None:
    car.has_input = False
    car.receive(psid.BSM, 20)

    assert car.step() * VERIFY_S == pytest.approx(LONGEST_TURN_S, abs=1.5 * VERIFY_S)


def test_a_longer_turn_ends_with_the_first_input(car: Car) -> None:
    car.has_input = False
    car.receive(psid.BSM, 20)
    turn = car.turns.take(car.now)
    for _ in range(5):
        next(turn)
        car.now += VERIFY_S
    car.has_input = True

    assert list(turn) == []


def test_a_step_with_group_messages_takes_all_of_them_and_no_bsm(car: Car) -> None:
    car.receive(psid.BSM, 10)
    car.receive(psid.LCCA, 20)

    assert car.step() == 20
    assert not car.queue.has_urgent
    assert car.queue.has_known


def test_a_frame_of_an_unknown_signer_is_taken_even_beside_group_messages(car: Car) -> None:
    car.receive(psid.LCCA, 20)
    car.receive(UNKNOWN_PSID, 5)

    assert car.step() == 20 + 1


def test_the_timer_is_set_only_while_frames_wait(car: Car) -> None:
    assert car.turns.get_timer() == math.inf
    car.receive(UNKNOWN_PSID, 1)
    assert car.turns.get_timer() <= car.now
    car.step()
    assert car.turns.get_timer() == math.inf


def test_bsms_wait_for_others_from_the_first_one_on(car: Car) -> None:
    car.receive_bsm()
    due_at = car.turns.get_timer()
    car.now += 0.5 * GATHER_S
    car.receive_bsm()

    assert due_at == car.turns.get_timer() == pytest.approx(car.now + 0.5 * GATHER_S)
    assert not car.queue.is_pressing
    assert car.step() == 2, "any step takes them"
    assert car.turns.get_timer() == math.inf


@pytest.mark.parametrize("service", [psid.LCCA, psid.SPAT])
def test_no_frame_waits_with_one_that_is_no_bsm(car: Car, service: int) -> None:
    car.receive_bsm()
    car.receive(service, 1)

    assert car.queue.is_pressing
    assert car.turns.get_timer() <= car.now


def test_a_bsm_of_an_event_does_not_wait(car: Car) -> None:
    car.receive_bsm(VehicleSafetyExtensions(VehicleEventFlags.HARD_BRAKING))

    assert car.queue.is_pressing


def test_no_bsm_waits_where_a_warning_waits_for_it(car: Car) -> None:
    car.receive_bsm(at_once=True)

    assert car.turns.get_timer() <= car.now


def test_what_a_turn_leaves_is_due_at_once(car: Car) -> None:
    for _ in range(10):
        car.receive_bsm()
    car.step()

    assert car.queue.has_known
    assert car.turns.get_timer() <= car.now


def test_after_their_turn_unknown_signers_wait_until_their_share_of_time_is_kept(car: Car) -> None:
    car.receive(UNKNOWN_PSID, 200)
    began_at = car.now
    handled = car.step()
    spent_s = car.now - began_at

    assert handled == math.ceil(RADIO_TURN_S / VERIFY_S)
    assert spent_s / (car.turns.get_timer() - began_at) == pytest.approx(UNKNOWN_SIGNERS_SHARE)
    assert car.step() == 0, "not yet due"
    car.now = car.turns.get_timer()
    assert car.step() == handled
