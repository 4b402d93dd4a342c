"""Members and messages on the page, from messages that the stack has received."""

from typing import Any

import pytest

from onboard.hmi.driver_view import MemberView, Relation
from onboard.hmi.group_view import (
    BRAKES_S,
    MEMBER_S,
    MESSAGE_S,
    MOST_MEMBERS,
    MOST_MESSAGES,
    MOST_VEHICLES,
    GroupView,
)
from onboard.lcca.group import WarningGroup
from onboard.lcca.transitions import GroupState
from onboard.messages.exchanged import MessageReceived, MessageSent
from onboard.messages.lcca import NO_ID, Join
from onboard.observations import HardBrake
from tests.lcca.one_car import A, B, OneCar, member_of_a
from tests.lcca.road import car_id

C, D = car_id("C"), car_id("D")


def received(
    kind: str, sender: bytes, now: float, number: int = 1, leader: bytes = A, **content: Any
) -> MessageReceived:
    header = {"sender_id": sender.hex(), "leader_id": leader.hex(), "number": number}
    return MessageReceived(now, kind, None, header | content)


def warning(sender: bytes, origin: bytes, now: float, number: int = 2, **more: Any) -> Any:
    content: dict[str, Any] = {"event_origin_id": origin.hex(), "event_sequence": 7, "reach": 0} | {
        "origin_number": 1, "deceleration_m_s2": 6.5, "age_s": 0.02, "hops": 2
    }  # fmt: skip
    return received("warn", sender, now, number, **(content | more))


def short(car: bytes) -> str:
    return car.hex()[:4]


def others(view: GroupView, group: WarningGroup, now: float) -> dict[str | None, MemberView]:
    return {
        each.car: each for each in view.members(group, now) if each.relation is not Relation.HOST
    }


@pytest.fixture
def view() -> GroupView:
    return GroupView()


@pytest.fixture
def group() -> WarningGroup:
    """B, which follows A."""
    return member_of_a().group


def test_without_a_group_there_is_the_host_vehicle_alone(view: GroupView) -> None:
    view.receive_event(received("reply", C, 1.0, number=3, to_id=D.hex()))

    (host,) = view.members(OneCar().group, 1.0)

    assert (host.relation, host.state, host.number) == (Relation.HOST, GroupState.REGULAR, 1)
    assert host.car is None


def test_members_are_those_with_the_own_leader_in_the_order_of_their_numbers(
    view: GroupView, group: WarningGroup
) -> None:
    view.receive_event(MessageSent(1.0, "join", 4, 80, {"sender_id": B.hex()}))
    view.receive_event(received("join", C, 1.0, number=3, to_id=B.hex()))
    view.receive_event(received("reply", A, 1.1, to_id=B.hex()))
    view.receive_event(received("reply", D, 1.1, leader=D, to_id=A.hex()))

    members = view.members(group, 1.5)

    assert [(each.number, each.car, each.state, each.relation) for each in members] == [
        (1, short(A), GroupState.LEADER, Relation.PREDECESSOR),
        (2, short(B), GroupState.MEMBER, Relation.HOST),
        (3, short(C), GroupState.MEMBER, Relation.OTHER),
    ]
    assert [each.received_at_s for each in members] == [1.1, 1.5, 1.0]


def test_a_follower_is_a_member_before_it_tells_the_own_leader(
    view: GroupView, group: WarningGroup
) -> None:
    group.receive_message(Join(C, C, 1, B, 1, NO_ID, 0), 1.0)
    view.receive_event(received("join", C, 1.0, leader=C, to_id=B.hex()))

    follower = others(view, group, 1.0)[short(C)]

    assert (follower.relation, follower.state) == (Relation.FOLLOWER, GroupState.REGULAR)


def test_a_member_that_is_silent_or_leaves_is_dropped(view: GroupView, group: WarningGroup) -> None:
    for car in (C, D):
        view.receive_event(received("join", car, 1.0, number=3, to_id=A.hex()))
    assert others(view, group, 1.0 + MEMBER_S).keys() == {short(C), short(D)}

    view.receive_event(received("leave", C, 1.1, number=3, to_id=A.hex(), reason="gap"))

    assert others(view, group, 1.1).keys() == {short(D)}
    assert others(view, group, 1.01 + MEMBER_S) == {}


def test_the_origin_of_a_warning_brakes_also_where_it_is_out_of_reach(
    view: GroupView, group: WarningGroup
) -> None:
    view.receive_event(warning(C, A, 1.0))

    braking = {car for car, each in others(view, group, 0.99 + BRAKES_S).items() if each.brakes}

    assert braking == {short(A)}
    view.receive_event(received("reply", A, 3.0, to_id=B.hex()))
    assert not others(view, group, 1.01 + BRAKES_S)[short(A)].brakes


def test_a_warning_that_braking_is_over_ends_it(view: GroupView, group: WarningGroup) -> None:
    view.receive_event(warning(C, A, 1.0, cause="deceleration"))
    view.receive_event(warning(C, A, 1.5, cause="over"))

    assert not others(view, group, 1.5)[short(A)].brakes


def test_the_host_vehicle_brakes_until_that_is_over(view: GroupView) -> None:
    group = OneCar().group
    view.receive_event(HardBrake(1.0, 6.0, "obd"))
    assert view.members(group, 1.1)[0].brakes
    view.receive_event(HardBrake(1.5, 0.0, "obd", is_over=True))
    assert not view.members(group, 1.5)[0].brakes


def test_a_message_is_shown_by_its_declared_fields_without_ids_and_counters(
    view: GroupView,
) -> None:
    view.receive_event(MessageSent(0.5, "join", 4, 80, {"sender_id": B.hex()}))
    view.receive_event(warning(C, A, 1.0, lanes=2))
    view.receive_event(received("reply", A, 1.2, to_id=B.hex(), sequence=4, speed_m_s=20.0))

    reply, warn = view.messages(1.5)

    assert (reply.message, reply.receiver, reply.is_to_host) == ("reply", short(B), True)
    assert reply.content == {"speed_m_s": 20.0}
    assert (warn.sender, warn.leader, warn.number, warn.receiver) == (short(C), short(A), 2, None)
    assert warn.content == {
        "origin_number": 1, "deceleration_m_s2": 6.5, "age_s": 0.02, "hops": 2, "lanes": 2
    }  # fmt: skip


def test_repetitions_share_one_row_with_the_time_of_the_last(view: GroupView) -> None:
    view.receive_event(received("join", C, 1.0, number=3, to_id=B.hex()))
    view.receive_event(warning(C, A, 1.2))
    view.receive_event(received("join", C, 1.5, number=4, to_id=B.hex()))

    warn, join = view.messages(1.5)

    assert (warn.message, join.message) == ("warn", "join")
    assert (join.received_at_s, join.number) == (1.5, 4)


def test_old_messages_are_not_shown(view: GroupView) -> None:
    view.receive_event(warning(C, A, 1.0))

    assert len(view.messages(1.0 + MESSAGE_S)) == 1
    assert view.messages(1.01 + MESSAGE_S) == ()


def test_bsms_are_no_group_messages(view: GroupView) -> None:
    view.receive_event(MessageReceived(1.0, "bsm", None, {}))
    view.receive_event(MessageSent(1.0, "bsm", 5, 200, {}))

    assert view.messages(1.0) == ()


def test_a_flood_leaves_the_warning_and_what_is_stored_bounded(
    view: GroupView, group: WarningGroup
) -> None:
    view.receive_event(warning(C, A, 1.0))
    for number in range(2, 5000):
        sender = number.to_bytes(8)
        view.receive_event(received("join", sender, 1.0, number=number, to_id=A.hex()))
    view.receive_event(received("reply", A, 1.0, to_id=B.hex()))

    messages, members = view.messages(1.0), view.members(group, 1.0)

    assert len(messages) == MOST_MESSAGES
    assert "warn" in {each.message for each in messages}
    assert len(members) == MOST_MEMBERS + 1
    assert len(view._vehicles) == MOST_VEHICLES
