"""Which warnings and updates one member accepts, and what it repeats."""

import math
from dataclasses import replace

import numpy as np
import pytest

from onboard.lcca.events import MeasuredLead, WarningOver
from onboard.lcca.group import WarningGroup
from onboard.lcca.parameters import DEFAULTS, GroupParameters
from onboard.messages.lcca import NO_ID, Join, Reply, Update, Warn, WarnCause
from onboard.observations import Discarded, HardBrake
from tests.lcca.road import car_id
from tests.typed import a

A, B, C = (car_id(name) for name in "ABC")


class Listener:
    """B, a member of A's group with number 2, followed by C."""

    def __init__(self, *, proves_ids: bool = False, **changes: float) -> None:
        prompt = {"spread_s": 0.0}
        instantly = GroupParameters(**(prompt | changes))  # type: ignore[arg-type]
        self.group = WarningGroup(instantly, B, np.random.default_rng(1), proves_ids=proves_ids)
        self.group.receive_speed(20.0, 0.0)
        self.group.receive_lead(MeasuredLead(A, 20.0, 0.0), 0.0)
        (join,) = self.group.messages_to_send(0.0)
        assert isinstance(join, Join)
        self.hears(Reply(A, A, 1, B, join.sequence, 10, 20.0, NO_ID))
        self.hears(Join(C, A, 3, B, 0, NO_ID, 0))
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


@pytest.mark.parametrize("proves_ids", [False, True])
@pytest.mark.parametrize("stated_at_s", [None, -0.1])
def test_only_the_next_vehicle_or_proof_ends_a_braking(
    proves_ids: bool, stated_at_s: float | None
) -> None:
    car = Listener(proves_ids=proves_ids)
    car.hears(warn())
    over = warn(event_sequence=6, cause=WarnCause.OVER)
    repeated = replace(over, sender_id=OUTSIDER, stated_at_s=stated_at_s)

    ended = car.hears(repeated) == ["warning_over"]

    assert ended is (proves_ids and stated_at_s is not None)
    assert ended or car.hears(over) == ["warning_over"]


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
    ends = warn(event_sequence=22, first_sequence=20, cause=WarnCause.OVER)
    assert car.hears(ends) == ["warning_over"]
    assert car.hears(warn(event_sequence=21, first_sequence=20, age_s=1.0)) == ["outdated"]


Z = b"leader-z"


def update(**changes: object) -> Update:
    """A has joined a group as its number 4 behind Z."""
    fields: dict[str, object] = {
        "sender_id": A,
        "leader_id": Z,
        "number": 4,
        "leader_sequence": 77,
    }
    return Update(**(fields | changes))  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("changes", "words", "number"),
    [
        ({}, ["transition"], 5),
        ({"sender_id": OUTSIDER}, [], 2),
        ({"sender_id": OUTSIDER, "leader_id": A, "leader_sequence": 11}, [], 2),
        ({"sender_id": C}, [], 2),
        ({"leader_id": A, "number": 1}, ["up_to_date"], 2),
        ({"leader_id": A, "number": 4, "leader_sequence": 11}, ["transition"], 5),
        ({"leader_id": A, "number": 4, "leader_sequence": 10}, ["loop"], 2),
        ({"leader_id": B}, ["loop"], 2),
    ],
)
def test_a_member_follows_its_predecessor_only_to_another_position(
    changes: dict[str, object], words: list[str], number: int
) -> None:
    car = Listener()
    assert car.hears(update(**changes)) == words
    assert car.group.group_number == number


def test_a_member_that_is_moved_moves_its_followers() -> None:
    car = Listener()
    car.hears(update())
    assert car.group.messages_to_send(0.0) == [Update(B, Z, 5, 77)]


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
        car.hears(Join(OUTSIDER, A, 4, C, 0, NO_ID, 0))  # the radio reaches two vehicles behind
        car.hears(warn(reach=3))
    assert copies(stays, 0.01) == []
    assert copies(leaves, 0.01) == ["update"]  # to its follower: I lead you now
    assert copies(stays, 0.02) == ["warn"]
    assert copies(leaves, 0.02) == []


def test_a_repeated_warning_has_the_present_number_of_the_braking_vehicle() -> None:
    # A, number 4 now, braked as number 1. Who is number 2 to 4 of the new group is ahead of it.
    car = Listener()
    car.hears(warn(reach=3))
    assert car.hears(update()) == ["transition"]
    car.group.handle_timer(0.05)
    (copy,) = (m for m in car.group.messages_to_send(0.05) if isinstance(m, Warn))
    assert (copy.leader_id, copy.number, copy.origin_number) == (b"leader-z", 5, 4)


def test_a_warning_from_a_vehicle_that_left_the_group_is_not_repeated() -> None:
    # A left its group and leads; the braking car was ahead of it.
    car = Listener()
    assert car.hears(update()) == ["transition"]
    ahead = warn(event_origin_id=OUTSIDER, leader_id=Z, number=4, origin_number=2, reach=3)
    assert car.hears(ahead) == ["warning"]
    split = update(leader_id=A, number=1, leader_sequence=78)
    assert car.hears(split) == ["transition"]
    car.group.handle_timer(0.05)
    assert not any(isinstance(m, Warn) for m in car.group.messages_to_send(0.05))


def test_a_copy_that_others_make_up_takes_nothing_from_the_known_one() -> None:
    """Whoever has received the true one may claim any age and numbers for his copy."""
    car = Listener()
    car.hears(Join(OUTSIDER, A, 4, C, 0, NO_ID, 0))  # the radio reaches two vehicles behind
    car.hears(warn(event_origin_id=Z, number=1, origin_number=1, reach=3, age_s=0.1))
    for age_s in (0.0, 0.5, 2.99, 60.0):
        forged = warn(
            sender_id=OUTSIDER, event_origin_id=Z, number=1, reach=9, age_s=age_s, hops=200
        )
        assert car.hears(forged) == ["duplicate"]
    car.group.handle_timer(0.02)
    (copy,) = (m for m in car.group.messages_to_send(0.02) if isinstance(m, Warn))
    assert (copy.origin_number, copy.hops, round(copy.age_s, 6)) == (1, 2, 0.12)


@pytest.mark.parametrize("stated_at_s", [None, -0.1])
@pytest.mark.parametrize("pretended_s", [0.8, 2.95])
def test_a_copy_that_comes_first_and_pretends_to_be_old_ends_nothing_early(
    pretended_s: float, stated_at_s: float | None
) -> None:
    car = Listener()
    car.hears(Join(OUTSIDER, A, 4, C, 0, NO_ID, 0))  # the radio reaches two vehicles behind
    true = warn(event_origin_id=Z, reach=3, stated_at_s=stated_at_s)
    car.hears(replace(true, sender_id=OUTSIDER, age_s=pretended_s, hops=2))
    assert car.hears(true) == []
    car.group.handle_timer(0.2)
    copies = [m for m in car.group.messages_to_send(0.2) if isinstance(m, Warn)]
    assert [round(each.age_s, 6) for each in copies] == [0.3]
    car.group.handle_timer(DEFAULTS.event_lifetime_s - 0.11)
    assert not any(isinstance(each, WarningOver) for each in iter(car.group.next_event, None))


def test_a_copy_from_behind_delays_a_warning_until_acknowledgements_are_checked() -> None:
    car = Listener()
    car.hears(warn(reach=3))
    car.hears(warn(sender_id=OUTSIDER, number=60_000))
    at = DEFAULTS.acknowledge_s + DEFAULTS.spread_s
    car.group.handle_timer(at)
    assert "warn" in [m.kind for m in car.group.messages_to_send(at)]


def test_what_a_braking_vehicle_signed_tells_its_warnings_apart_whatever_copies_say() -> None:
    """A later braking of another signer under the same number is another one."""
    car = Listener()
    car.hears(warn(stated_at_s=-0.1))
    assert car.hears(warn(sender_id=OUTSIDER, age_s=-0.3, stated_at_s=-0.1)) == ["duplicate"]
    assert car.hears(warn(age_s=0.0, stated_at_s=0.5)) != ["duplicate"]


def test_an_older_warning_that_comes_late_does_not_take_the_place_of_the_newer_one() -> None:
    car = Listener()
    car.hears(warn(event_sequence=9, first_sequence=9, age_s=0.0))
    car.hears(warn(event_sequence=5, first_sequence=5, age_s=1.0))
    at = car.group.get_timer()
    sent: list[int] = []
    while at < 0.5:
        car.group.handle_timer(at)
        sent += [m.event_sequence for m in car.group.messages_to_send(at) if isinstance(m, Warn)]
        at = car.group.get_timer()
    assert 9 in sent


def test_a_warning_is_sent_before_other_messages() -> None:
    car = Listener()
    car.hears(Join(C, A, 3, B, 1, NO_ID, 0))
    car.group.receive_hard_brake(HardBrake(0.0, 5.0, "test"), 0.2)
    out = car.group.messages_to_send(0.2)
    assert [message.kind for message in out] == ["warn", "reply"]
    assert a(Warn, out[0]).age_s == pytest.approx(0.2)
