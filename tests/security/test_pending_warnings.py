"""A group's warning has to be borne out by the braking car's own speeds; the others are held."""

import math

import pytest

from onboard.messages.bsm import BasicSafetyMessage
from onboard.messages.bsm_core import CoreData
from onboard.messages.lcca import Warn
from onboard.observations import Discarded
from onboard.security.misbehaviour_detection import MisbehaviourDetector
from onboard.security.pending_warnings import HOLD_S, MAX_PENDING, PendingWarnings

LEADER, FORWARDER = b"the lead", b"a member"
SIGNER, OTHER = b"signer 1", b"signer 2"


class Listener:
    """A car that has heard the leader drive 15 m/s for a second, until now = 1.0."""

    def __init__(self, *, check_braking: bool = True) -> None:
        self.misbehaviour = MisbehaviourDetector(check_braking=check_braking)
        self.misbehaviour.receive_car_id(SIGNER, LEADER)
        self.pending = PendingWarnings(self.misbehaviour)
        for tenth in range(11):
            self.hear_bsm(tenth / 10, 15.0)

    def hear_bsm(self, now: float, speed_m_s: float | None) -> None:
        core = CoreData(0, b"abcd", speed_m_s=speed_m_s)
        self.misbehaviour.receive_bsm(SIGNER, BasicSafetyMessage(core), now)
        self.pending.handle_timer(now)

    def passed(self) -> list[Warn]:
        return list(iter(self.pending.next_warning, None))

    def disbelieved(self) -> list[str]:
        return [event.reason for event in iter(self.pending.next_event, None)]


def warning(sequence: int = 1, sender: bytes = LEADER) -> Warn:
    return Warn(sender, LEADER, 1, LEADER, sequence, 0, 1, 6.0, 0.05, 1)


def test_a_warning_whose_brake_already_shows_passes_at_once() -> None:
    car = Listener()
    car.hear_bsm(1.1, 14.0)

    car.pending.receive_warning(warning(), 1.11, 1.11)

    assert car.passed() == [warning()]
    assert car.pending.get_timer() == math.inf


def test_a_warning_of_a_car_that_nobody_here_can_judge_passes_at_once() -> None:
    car = Listener()
    from_afar = Warn(FORWARDER, LEADER, 4, b"far away", 1, 0, 1, 6.0, 0.2, 3)

    car.pending.receive_warning(from_afar, 1.05, 1.05)

    assert car.passed() == [from_afar]


def test_a_warning_that_comes_before_its_brake_shows_waits_for_the_next_bsm_and_says_so() -> None:
    """A hard brake makes a BSM due at once: it comes right behind the warning."""
    car = Listener()
    car.pending.receive_warning(warning(), 1.05, 1.05)
    assert car.passed() == []

    car.hear_bsm(1.052, 14.2)

    (passed,) = car.passed()
    assert passed.event_sequence == 1
    assert passed.age_s == pytest.approx(0.05 + 0.002)


def test_a_warning_passes_late_rather_than_never_when_no_bsm_comes() -> None:
    car = Listener()
    car.pending.receive_warning(warning(), 1.05, 1.05)
    assert car.pending.get_timer() == 1.05 + HOLD_S

    car.pending.handle_timer(1.05 + HOLD_S)

    assert [passed.event_sequence for passed in car.passed()] == [1]
    assert car.disbelieved() == []


def test_the_forged_brake_of_a_car_that_drives_on_as_before_is_not_believed() -> None:
    car = Listener()
    car.pending.receive_warning(warning(), 1.05, 1.05)
    for now in (1.1, 1.2):
        car.hear_bsm(now, 15.0)

    car.pending.handle_timer(1.05 + HOLD_S)

    assert car.passed() == []
    assert car.disbelieved() == ["implausible_brake"]
    assert car.pending.get_timer() == math.inf


def test_bsms_made_before_the_warning_and_held_back_do_not_speak_against_it() -> None:
    """Whoever can jam the fresh ones and play old ones silences nobody."""
    car = Listener()
    car.pending.receive_warning(warning(), 1.05, 1.05)
    for made_at_s in (1.02, 1.04):
        car.hear_bsm(made_at_s, 15.0)

    car.pending.handle_timer(1.05 + HOLD_S)

    assert len(car.passed()) == 1


def test_the_time_on_the_way_adds_to_a_warnings_age() -> None:
    car = Listener()
    car.hear_bsm(1.1, 14.0)

    car.pending.receive_warning(warning(), made_at_s=1.11, now=3.11)

    assert [passed.age_s for passed in car.passed()] == [pytest.approx(0.05 + 2.0)]


def test_a_clock_that_is_ahead_makes_no_warning_younger_than_it_says() -> None:
    car = Listener()
    car.hear_bsm(1.1, 14.0)

    car.pending.receive_warning(warning(), made_at_s=1.9, now=1.11)

    assert [passed.age_s for passed in car.passed()] == [0.05]


def test_bsms_that_tell_no_speed_do_not_speak_against_a_brake() -> None:
    car = Listener()
    car.pending.receive_warning(warning(), 1.05, 1.05)
    car.hear_bsm(1.1, None)

    car.pending.handle_timer(1.05 + HOLD_S)

    assert len(car.passed()) == 1


def test_every_copy_of_a_forgery_is_held_and_the_first_true_bsm_lets_all_of_them_pass() -> None:
    car = Listener()
    car.pending.receive_warning(warning(), 1.05, 1.05)
    car.pending.receive_warning(warning(sender=FORWARDER), 1.06, 1.06)
    assert car.passed() == []

    car.hear_bsm(1.1, 14.0)

    assert [passed.sender_id for passed in car.passed()] == [LEADER, FORWARDER]


def test_who_is_to_be_believed_is_left_open_when_two_claim_to_be_the_same_car() -> None:
    """Otherwise, whoever drives steadily could take a braking car's name and silence it."""
    car = Listener()
    car.misbehaviour.receive_car_id(OTHER, LEADER)

    car.pending.receive_warning(warning(), 1.05, 1.05)

    assert len(car.passed()) == 1


def test_a_flood_of_doubtful_warnings_is_not_believed_and_takes_bounded_memory() -> None:
    car = Listener()
    for sequence in range(MAX_PENDING + 3):
        car.pending.receive_warning(warning(sequence), 1.05, 1.05)

    assert car.disbelieved() == ["too_many_warnings"] * 3
    assert car.pending.get_timer() < math.inf


def test_a_demonstration_with_brake_buttons_can_do_without() -> None:
    car = Listener(check_braking=False)

    car.pending.receive_warning(warning(), 1.05, 1.05)

    assert len(car.passed()) == 1


def test_what_was_not_believed_names_the_car() -> None:
    car = Listener()
    car.pending.receive_warning(warning(), 1.05, 1.05)
    car.hear_bsm(1.1, 15.0)
    car.pending.handle_timer(1.4)

    event = car.pending.next_event()

    assert isinstance(event, Discarded)
    assert LEADER.hex() in str(event.detail)
