"""The share of time of known and unknown signers, on a clock that verifying moves."""

import math

import pytest

from onboard.vehicle.framing import bsm_sender
from onboard.wave_udp import psid
from onboard.wave_udp.receive_queue import NO_KEYS, ReceiveQueue
from onboard.wave_udp.receive_turns import RADIO_TURN_S, UNKNOWN_SIGNERS_SHARE, ReceiveTurns
from onboard.wave_udp.wsmp import WaveShortMessage, encode

VERIFY_S = 0.000_25
"""Time that the cores take for one frame."""

UNKNOWN_PSID = psid.BSM + 1
"""Under which the frames of unknown signers come here."""


class Car:
    """A queue, its turns, and a clock that moves only while a frame is handled."""

    def __init__(self) -> None:
        self.now = 100.0
        self.queue = ReceiveQueue(
            psid.LCCA,
            bsm_sender,
            lambda message: None if message.psid == UNKNOWN_PSID else NO_KEYS,
        )
        self.turns = ReceiveTurns(self.queue, lambda: self.now)

    def receive(self, service: int, count: int) -> None:
        for number in range(count):
            self.queue.put(encode(WaveShortMessage(psid=service, payload=number.to_bytes(4))))

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


def test_the_timer_is_set_only_while_frames_of_unknown_signers_wait(car: Car) -> None:
    assert car.turns.get_timer() == math.inf
    car.receive(psid.BSM, 1)
    assert car.turns.get_timer() == math.inf
    car.receive(UNKNOWN_PSID, 1)
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
