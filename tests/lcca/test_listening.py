"""Which warnings and updates one member accepts."""

import math

import numpy as np
import pytest

from onboard.lcca.events import MeasuredLead
from onboard.lcca.group import WarningGroup
from onboard.lcca.parameters import GroupParameters
from onboard.messages.lcca import NO_ID, Join, Reply, Update, Warn, WarnCause
from onboard.observations import Discarded, HardBrake
from tests.lcca.road import car_id
from tests.typed import a

A, B, C = (car_id(name) for name in "ABC")


class Listener:
    """B, a member of A's group with number 2, followed by C."""

    def __init__(self, **changes: float) -> None:
        prompt = {"spread_s": 0.0}
        instantly = GroupParameters(**(prompt | changes))  # type: ignore[arg-type]
        self.group = WarningGroup(instantly, B, np.random.default_rng(1))
        self.group.receive_speed(20.0, 0.0)
        self.group.receive_lead(MeasuredLead(A, 20.0, 0.0), 0.0)
        (join,) = self.group.messages_to_send(0.0)
        assert isinstance(join, Join)
        self.hears(Reply(A, A, 1, B, join.sequence, 10, 20.0, NO_ID))
        self.hears(Join(C, A, 3, B, 0, NO_ID, 0, NO_ID))
        self.group.messages_to_send(0.0)

    def hears(self, message: Warn | Reply | Join | Update) -> list[str]:
        self.group.receive_message(message, 0.0)
        words = []
        while (event := self.group.next_event()) is not None:
            words.append(event.reason if isinstance(event, Discarded) else event.kind)
        return words


def warn(**changes: object) -> Warn:
    fields: dict[str, object] = {
        "sender_id": A,
        "leader_id": A,
        "number": 1,
        "event_origin_id": A,
        "event_sequence": 5,
        "reach": 1,
        "origin_number": 1,
        "first_sequence": 5,
        "cause": WarnCause.DECELERATION,
        "deceleration_m_s2": 6.0,
        "age_s": 0.1,
        "hops": 1,
    }
    return Warn(**(fields | changes))  # type: ignore[arg-type]


OUTSIDER = b"outsider"


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({}, ["warning"]),
        ({"age_s": 2.9}, ["warning"]),
        ({"age_s": 3.1}, ["stale"]),
        ({"sender_id": OUTSIDER, "number": 1}, ["warning"]),
        ({"sender_id": OUTSIDER, "number": 2, "origin_number": 2}, ["from_behind"]),
        ({"sender_id": C, "number": 3, "origin_number": 3}, ["from_behind"]),
        ({"sender_id": C, "number": 3}, ["warning"]),  # repeated behind, braked ahead
        ({"sender_id": OUTSIDER, "leader_id": OUTSIDER}, ["other_group"]),
        ({"leader_id": OUTSIDER, "number": 9}, ["warning"]),  # A is followed: it is ahead
        ({"sender_id": C, "number": 3, "event_origin_id": B}, ["own_echo"]),
        ({"sender_id": B}, ["own_echo"]),
        ({"sender_id": OUTSIDER, "number": 1, "cause": WarnCause.OVER}, ["not_followed"]),
        ({"cause": WarnCause.OVER}, []),  # A is followed
    ],
)
def test_a_member_accepts_or_refuses_a_warning(
    changes: dict[str, object], words: list[str]
) -> None:
    assert Listener().hears(warn(**changes)) == words


def test_every_further_copy_of_a_warning_is_a_duplicate() -> None:
    car = Listener()
    assert car.hears(warn()) == ["warning"]
    assert car.hears(warn()) == ["duplicate"]
    assert car.hears(warn(sender_id=C, number=3, hops=2)) == ["duplicate"]
    assert car.hears(warn(sender_id=OUTSIDER, leader_id=OUTSIDER)) == ["duplicate"]


def test_the_end_of_another_braking_ends_nothing() -> None:
    car = Listener()
    assert car.hears(warn(event_sequence=20, first_sequence=20)) == ["warning"]
    assert car.hears(warn(event_sequence=19, first_sequence=5, cause=WarnCause.OVER)) == []
    ends = warn(event_sequence=21, first_sequence=20, cause=WarnCause.OVER)
    assert car.hears(ends) == ["warning_over"]
    assert car.hears(warn(event_sequence=20, first_sequence=20, age_s=1.0)) == ["outdated"]


def update(**changes: object) -> Update:
    """A joins a group as its number 4 behind Z."""
    fields: dict[str, object] = {
        "sender_id": A,
        "leader_id": b"leader-z",
        "number": 4,
        "event_origin_id": A,
        "event_sequence": 5,
        "reach": 1,
        "previous_leader_id": A,
        "shift": -3,
        "leader_sequence": 77,
    }
    return Update(**(fields | changes))  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("changes", "words", "number"),
    [
        ({}, ["transition"], 5),
        ({"sender_id": OUTSIDER}, ["transition"], 5),
        ({"sender_id": OUTSIDER, "number": 5}, ["from_behind"], 2),
        ({"sender_id": OUTSIDER, "previous_leader_id": OUTSIDER}, ["other_group"], 2),
        ({"sender_id": OUTSIDER, "previous_leader_id": C, "leader_id": A}, ["up_to_date"], 2),
        ({"sender_id": OUTSIDER, "leader_id": A, "leader_sequence": 10}, ["up_to_date"], 2),
        ({"sender_id": OUTSIDER, "leader_id": A, "leader_sequence": 11}, ["transition"], 5),
        ({"leader_id": A, "number": 1, "shift": 0}, ["up_to_date"], 2),
        ({"leader_id": B}, ["loop"], 2),
        ({"previous_leader_id": OUTSIDER}, ["transition"], 5),  # from the car it follows
    ],
)
def test_a_member_accepts_or_refuses_an_update(
    changes: dict[str, object], words: list[str], number: int
) -> None:
    car = Listener()
    assert car.hears(update(**changes)) == words
    assert car.group.group_number == number


def test_a_member_whose_shift_differs_sends_its_own_update() -> None:
    car = Listener()
    car.hears(update(previous_leader_id=OUTSIDER))
    (own,) = car.group.messages_to_send(0.0)
    assert isinstance(own, Update)
    assert (own.event_origin_id, own.previous_leader_id, own.shift) == (B, A, -3)


def test_the_age_of_a_repeated_warning_includes_the_waiting_time() -> None:
    car = Listener()
    car.group.receive_message(warn(reach=3), 0.0)  # two slots before the named one
    at = car.group.get_timer()
    car.group.handle_timer(0.02)
    copies = [m for m in car.group.messages_to_send(0.02) if isinstance(m, Warn)]
    assert at < math.inf
    assert [(copy.hops, round(copy.age_s, 6), copy.number) for copy in copies] == [(2, 0.12, 2)]


def copies(car: Listener, now: float) -> list[str]:
    car.group.handle_timer(now)
    out = car.group.messages_to_send(now)
    return [message.kind for message in out if isinstance(message, Warn | Update)]


def test_a_vehicle_that_has_left_forwards_nothing() -> None:
    stays, leaves = Listener(), Listener(lead_hold_s=0.01)
    for car in (stays, leaves):
        car.hears(
            Join(OUTSIDER, A, 4, C, 0, NO_ID, 0, NO_ID)
        )  # the radio reaches two vehicles behind
        car.hears(warn(reach=3))
    assert copies(stays, 0.01) == []
    assert copies(leaves, 0.01) == ["update"]  # to its follower: I lead you now
    assert copies(stays, 0.02) == ["warn"]
    assert copies(leaves, 0.02) == []


def test_a_repeated_warning_has_the_present_number_of_the_braking_vehicle() -> None:
    # A, number 4 now, braked as number 1. Who is number 2 to 4 of the new group is ahead of it.
    car = Listener()
    car.hears(warn(reach=3))
    assert car.hears(update(event_sequence=6)) == ["transition"]
    car.group.handle_timer(0.05)
    (copy,) = (m for m in car.group.messages_to_send(0.05) if isinstance(m, Warn))
    assert (copy.leader_id, copy.number, copy.origin_number) == (b"leader-z", 5, 4)


def test_a_warning_from_a_vehicle_that_left_the_group_is_not_repeated() -> None:
    # A left its group and leads; the braking car was ahead of it.
    car = Listener()
    z = b"leader-z"
    assert car.hears(update(event_sequence=6)) == ["transition"]
    ahead = warn(event_origin_id=OUTSIDER, leader_id=z, number=4, origin_number=2, reach=3)
    assert car.hears(ahead) == ["warning"]
    split = update(leader_id=A, number=1, previous_leader_id=z, shift=3, event_sequence=7)
    assert car.hears(split) == ["transition"]
    car.group.handle_timer(0.05)
    assert not any(isinstance(m, Warn) for m in car.group.messages_to_send(0.05))


def test_an_outdated_update_is_not_forwarded() -> None:
    car = Listener()
    car.hears(update(reach=3))
    newer = update(
        previous_leader_id=b"leader-z", leader_id=b"leader-y", event_sequence=6, leader_sequence=9
    )
    assert car.hears(newer) == ["transition"]
    car.group.handle_timer(0.05)
    sent = [m for m in car.group.messages_to_send(0.05) if isinstance(m, Update)]
    assert {message.leader_id for message in sent} == {b"leader-y"}


def test_a_warning_is_sent_before_other_messages() -> None:
    car = Listener()
    car.hears(Join(C, A, 3, B, 1, NO_ID, 0, NO_ID))
    car.group.receive_hard_brake(HardBrake(0.0, 5.0, "test"), 0.2)
    out = car.group.messages_to_send(0.2)
    assert [message.kind for message in out] == ["warn", "reply"]
    assert a(Warn, out[0]).age_s == pytest.approx(0.2)
