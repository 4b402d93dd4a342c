"""A warning that the braking car's speeds do not confirm is pending, then passes or is rejected."""

import math
from dataclasses import replace

import pytest

from onboard.messages.bsm import BasicSafetyMessage
from onboard.messages.bsm_core import CoreData
from onboard.messages.lcca import Warn, WarnCause
from onboard.misbehaviour.misbehaviour_detection import MisbehaviourDetector
from onboard.misbehaviour.pending_warnings import (
    AIR_S,
    FRESH_S,
    HOLD_S,
    MAX_PENDING,
    PendingWarnings,
)
from onboard.observations import Discarded

LEADER, FORWARDER = b"the lead", b"a member"
SIGNER, OTHER = b"signer 1", b"signer 2"


class Listener:
    """A car that received the leader's BSMs at 15 m/s for a second, until now = 1.0."""

    def __init__(self, *, check_braking: bool = True) -> None:
        self.misbehaviour = MisbehaviourDetector(check_braking=check_braking)
        self.misbehaviour.receive_car_id(SIGNER, LEADER)
        self.pending = PendingWarnings(self.misbehaviour)
        for tenth in range(11):
            self.hear_bsm(tenth / 10, 15.0)

    def hear_bsm(self, now: float, speed_m_s: float | None, made_at_s: float | None = None) -> None:
        made_at_s = now if made_at_s is None else made_at_s
        core = CoreData(0, b"abcd", speed_m_s=speed_m_s)
        self.misbehaviour.receive_bsm(SIGNER, BasicSafetyMessage(core), made_at_s, now)
        self.pending.handle_timer(now)

    def passed(self) -> list[Warn]:
        return [warning for warning, _ in iter(self.pending.next_warning, None)]

    def disbelieved(self) -> list[str]:
        return [event.reason for event in iter(self.pending.next_event, None)]


def warning(sequence: int = 1, sender: bytes = LEADER) -> Warn:
    return Warn(sender, LEADER, 1, LEADER, sequence, 0, 1, 1, WarnCause.DECELERATION, 6.0, 0.05, 1)


def test_a_warning_that_speeds_already_confirm_passes_at_once() -> None:
    car = Listener()
    car.hear_bsm(1.1, 14.0)

    car.pending.receive_warning(warning(), SIGNER, 1.11, 1.11)

    assert car.passed() == [replace(warning(), age_s=0.05 + AIR_S)]
    assert car.pending.get_timer() == math.inf


def test_a_warning_of_a_car_without_received_bsms_passes_at_once() -> None:
    car = Listener()
    from_afar = Warn(
        FORWARDER, LEADER, 4, b"far away", 1, 0, 1, 1, WarnCause.DECELERATION, 6.0, 0.2, 3
    )

    car.pending.receive_warning(from_afar, SIGNER, 1.05, 1.05)

    assert car.passed() == [replace(from_afar, age_s=0.2 + AIR_S)]


def test_a_warning_before_its_braking_shows_waits_for_the_next_bsm_and_ages() -> None:
    """Hard braking makes a BSM due at once: it follows the warning."""
    car = Listener()
    car.pending.receive_warning(warning(), SIGNER, 1.05, 1.05)
    assert car.passed() == []

    car.hear_bsm(1.052, 14.2)

    (passed,) = car.passed()
    assert passed.event_sequence == 1
    assert passed.age_s == pytest.approx(0.05 + AIR_S + 0.002)


def test_a_pending_warning_passes_late_when_no_bsm_arrives() -> None:
    car = Listener()
    car.pending.receive_warning(warning(), SIGNER, 1.05, 1.05)
    assert car.pending.get_timer() == 1.05 + HOLD_S

    car.pending.handle_timer(1.05 + HOLD_S)

    assert [passed.event_sequence for passed in car.passed()] == [1]
    assert car.disbelieved() == []


def test_a_forged_warning_of_a_car_at_constant_speed_is_rejected() -> None:
    car = Listener()
    car.pending.receive_warning(warning(), SIGNER, 1.05, 1.05)
    for now in (1.1, 1.2):
        car.hear_bsm(now, 15.0)

    car.pending.handle_timer(1.05 + HOLD_S)

    assert car.passed() == []
    assert car.disbelieved() == ["implausible_brake"]
    assert car.pending.get_timer() == math.inf


def test_delayed_bsms_from_before_the_warning_do_not_contradict_it() -> None:
    """An attacker that jams new BSMs and replays old ones cannot suppress a warning."""
    car = Listener()
    car.pending.receive_warning(warning(), SIGNER, 1.05, 1.05)
    for made_at_s in (1.02, 1.04):
        car.hear_bsm(1.1 + made_at_s / 100, 15.0, made_at_s)

    car.pending.handle_timer(1.05 + HOLD_S)

    assert len(car.passed()) == 1


@pytest.mark.parametrize("clock_error_s", [-2.0, 0.0, 2.0])
def test_a_senders_clock_does_not_change_a_warnings_age(clock_error_s: float) -> None:
    car = Listener()
    car.hear_bsm(1.1, 14.0)

    car.pending.receive_warning(warning(), SIGNER, made_at_s=1.11 + clock_error_s, now=1.11)

    assert [passed.age_s for passed in car.passed()] == [pytest.approx(0.05 + AIR_S)]


@pytest.mark.parametrize("clock_error_s", [-2.0, 2.0])
def test_a_forwarders_clock_does_not_change_what_speeds_say_of_a_braking(
    clock_error_s: float,
) -> None:
    forged, true = Listener(), Listener()
    for car, speed_m_s in ((forged, 15.0), (true, 14.0)):
        car.pending.receive_warning(warning(sender=FORWARDER), SIGNER, 1.05 + clock_error_s, 1.05)
        car.hear_bsm(1.1, speed_m_s)
        car.pending.handle_timer(1.05 + HOLD_S)

    assert forged.disbelieved() == ["implausible_brake"]
    assert len(true.passed()) == 1


@pytest.mark.parametrize("off_s", [-FRESH_S - 0.1, FRESH_S + 0.1])
def test_a_copy_that_was_kept_for_long_is_stale(off_s: float) -> None:
    """An attacker can jam a warning and replay it to those who missed it."""
    car = Listener()

    car.pending.receive_warning(warning(), SIGNER, made_at_s=1.05 + off_s, now=1.05)

    assert car.disbelieved() == ["stale"]
    assert car.passed() == []


@pytest.mark.parametrize("cause", [WarnCause.TEST, WarnCause.OVER])
def test_a_test_and_an_end_need_no_speeds_that_show_braking(cause: WarnCause) -> None:
    car = Listener()

    car.pending.receive_warning(replace(warning(), cause=cause), SIGNER, 1.05, 1.05)

    assert len(car.passed()) == 1


def test_bsms_without_speed_do_not_contradict_braking() -> None:
    car = Listener()
    car.pending.receive_warning(warning(), SIGNER, 1.05, 1.05)
    car.hear_bsm(1.1, None)

    car.pending.handle_timer(1.05 + HOLD_S)

    assert len(car.passed()) == 1


def test_every_copy_of_a_warning_is_pending_and_the_first_confirming_bsm_passes_them_all() -> None:
    car = Listener()
    car.pending.receive_warning(warning(), SIGNER, 1.05, 1.05)
    car.pending.receive_warning(warning(sender=FORWARDER), SIGNER, 1.06, 1.06)
    assert car.passed() == []

    car.hear_bsm(1.1, 14.0)

    assert [passed.sender_id for passed in car.passed()] == [LEADER, FORWARDER]


def test_a_communication_id_of_two_senders_is_not_checked() -> None:
    """Otherwise an attacker could claim a braking car's ID and suppress its warning."""
    car = Listener()
    car.misbehaviour.receive_car_id(OTHER, LEADER)

    car.pending.receive_warning(warning(), SIGNER, 1.05, 1.05)

    assert len(car.passed()) == 1


def test_too_many_pending_warnings_are_rejected_in_bounded_memory() -> None:
    car = Listener()
    for sequence in range(MAX_PENDING + 3):
        car.pending.receive_warning(warning(sequence), SIGNER, 1.05, 1.05)

    assert car.disbelieved() == ["too_many_warnings"] * 3
    assert car.pending.get_timer() < math.inf


@pytest.mark.parametrize("insiders", [1, 5, 30])
def test_whoever_has_most_pending_warnings_displaces_own_ones_only(insiders: int) -> None:
    """Else an insider, whose BSMs contradict him, would suppress the warnings of all others."""
    car = Listener()
    names = [b"insider" + bytes((each,)) for each in range(insiders)]
    for name in names:
        car.misbehaviour.receive_car_id(name, name)
        for tenth in range(11):
            core = CoreData(0, name[-4:], speed_m_s=15.0)
            car.misbehaviour.receive_bsm(name, BasicSafetyMessage(core), tenth / 10, tenth / 10)
    for number in range(2 * MAX_PENDING):
        name = names[number % insiders]
        false = replace(warning(number), sender_id=name, event_origin_id=name)
        car.pending.receive_warning(false, name, 1.05, 1.05)

    car.pending.receive_warning(warning(), SIGNER, 1.05, 1.05)
    car.hear_bsm(1.052, 14.2)

    assert [each.event_origin_id for each in car.passed()] == [LEADER]


def test_check_braking_can_be_switched_off() -> None:
    car = Listener(check_braking=False)

    car.pending.receive_warning(warning(), SIGNER, 1.05, 1.05)

    assert len(car.passed()) == 1


def test_a_rejected_warning_names_the_car() -> None:
    car = Listener()
    car.pending.receive_warning(warning(), SIGNER, 1.05, 1.05)
    car.hear_bsm(1.1, 15.0)
    car.pending.handle_timer(1.4)

    event = car.pending.next_event()

    assert isinstance(event, Discarded)
    assert LEADER.hex() in str(event.detail)
