"""Joining, staying, leaving: narrated runs of two or three vehicles."""

from itertools import pairwise

import numpy as np
import pytest

from onboard.lcca.parameters import DEFAULTS
from onboard.lcca.transitions import GroupEvent, GroupState
from onboard.messages.lcca import NO_ID, Join, Leave, LeaveReason, Reply
from tests.lcca.one_car import OneCar, answer, member_of_a
from tests.lcca.road import Air, Road, Transmission, car_id, events_of, places, true_places

A, B, C, X = (car_id(name) for name in "ABCX")


class Losing:
    """An air that loses the first messages of one type from one car."""

    def __init__(self, count: int, kind: type, sender: str) -> None:
        self._left = count
        self._kind = kind
        self._sender = sender

    def __call__(self, transmission: Transmission, receiver: str) -> bool:
        if not isinstance(transmission.message, self._kind) or transmission.sender != self._sender:
            return False
        self._left -= 1
        return self._left >= 0


# Joining


def test_the_example_of_the_paper() -> None:
    # A, B and C in one lane. B is too close to A, C too close to B.
    road = Road()
    road.add_row("ABC")
    road.run(1.0)
    talk = [entry.message for entry in road.sent]
    # B sends M_join to A; A replies with ID_GL = A and GN_A = 1, so GN_B = 2.
    assert any(isinstance(m, Join) and (m.sender_id, m.to_id) == (B, A) for m in talk)
    reply = next(m for m in talk if isinstance(m, Reply) and m.sender_id == A)
    assert (reply.to_id, reply.leader_id, reply.number) == (B, A, 1)
    # C sends M_join to B; B replies with ID_GL = A and GN_B = 2, so GN_C = 3.
    reply = [m for m in talk if isinstance(m, Reply) and m.sender_id == B][-1]
    assert (reply.to_id, reply.leader_id, reply.number) == (C, A, 2)
    assert places(road) == {"A": ("A", 1), "B": ("A", 2), "C": ("A", 3)}
    # B follows A (it is on the warning list L_A), and C follows B.
    assert [car.group.followers for car in road.cars.values()] == [(B,), (C,), ()]
    states = [car.group.state for car in road.cars.values()]
    assert states == [GroupState.LEADER, GroupState.MEMBER, GroupState.MEMBER]


@pytest.mark.parametrize("count", range(6))
@pytest.mark.parametrize(("kind", "sender"), [(Join, "B"), (Reply, "A")])
def test_a_join_is_repeated_until_it_is_answered(count: int, kind: type, sender: str) -> None:
    road = Road()
    road.drops = Losing(count, kind, sender)
    road.add_row("AB")
    road.run(2.0)
    assert places(road) == {"A": ("A", 1), "B": ("A", 2)}
    joins = [entry.at for entry in road.sent if isinstance(entry.message, Join)][: count + 1]
    waits = [later - earlier for earlier, later in pairwise(joins)]
    planned = [min(0.1 * 2**n, 0.25) for n in range(count)]
    assert waits == pytest.approx(planned, abs=road.parameters.spread_s)
    joined_at = road.cars["B"].transitions[0].stamp_s
    assert joined_at == pytest.approx(joins[-1] + 2 * road.air.delay_s)


def test_a_lead_without_radio_is_sent_few_joins_while_it_is_ahead() -> None:
    road = Road()
    road.add_row("AB")[0].has_radio = False
    road.run(60.0)
    assert 200 <= len(road.sent) <= 260
    assert events_of(road.cars["B"]) == []
    road.cars["A"].lane = 1
    road.run(2.0)
    before = len(road.sent)
    road.run(10.0)
    assert len(road.sent) == before


def test_an_answered_join_is_refreshed_twice_a_second() -> None:
    road = Road()
    road.add_row("ABCDE")
    road.run(2.0)
    before = len(road.sent)
    road.run(60.0)
    # Four followers, one join and one reply each; some are early, on hearing the lead's.
    assert 4 * 2 * 110 <= len(road.sent) - before <= 4 * 2 * 130


@pytest.mark.parametrize(("loss", "at_most"), [(0.0, 0.85), (0.1, 0.95)])
def test_bsms_refresh_an_answered_join(loss: float, at_most: float) -> None:
    road = Road(Air(has_bsms=True, loss=loss))
    cars = road.add_row("ABCDE")
    road.run(6.0)
    before = len(road.sent)
    road.run(60.0)
    asked = [entry for entry in road.sent[before:] if isinstance(entry.message, Join | Reply)]
    assert asked == road.sent[before:]
    assert len(asked) / 60.0 / len(cars) < at_most
    assert all(car.transitions[-1].stamp_s < 6.0 for car in cars)


def test_only_the_predecessors_bsms_put_a_refresh_off() -> None:
    refreshed_at = {}
    for sender in (A, C):
        car = member_of_a()
        for number in range(1, 41):
            now = number / 10.0
            car.sees(A, now)
            car.group.receive_bsm(sender, now)
            if car.says(now):
                refreshed_at[sender] = now
                break
    assert refreshed_at == {C: 0.5, A: pytest.approx(2.1)}


def test_joins_go_only_to_an_identified_vehicle_that_is_too_close() -> None:
    car = OneCar()
    car.sees(None, 0.0)
    assert car.says(0.0) == []
    car.sees(A, 0.1, gap_m=39.7)
    assert car.says(0.1) == []
    car.sees(A, 0.2, gap_m=39.5)
    assert car.asks(0.2).to_id == A


def test_reading_the_own_plate_sends_no_join() -> None:
    car = OneCar(own_id=B)
    car.sees(B, 0.0)
    assert car.says(0.0) == []


def test_a_reply_names_the_position_at_its_sending() -> None:
    """Else it would undo the update that is sent before it, until the next refresh."""
    car = OneCar()
    car.sees(A, 0.0)
    join = car.asks(0.0)
    assert car.hears(Join(C, C, 1, B, 1, NO_ID, 0), 0.0) == ["followed"]
    assert car.hears(answer(join), 0.0) == ["joined"]
    replies = [message for message in car.says(0.0) if isinstance(message, Reply)]
    assert [(reply.leader_id, reply.number) for reply in replies] == [(A, 2)]


# Answers that are not believed


def test_a_reply_without_a_join_is_refused() -> None:
    car = OneCar()
    assert car.hears(Reply(A, A, 1, B, 0, 10, 20.0, NO_ID), 0.0) == ["not_asked"]


def test_a_reply_is_accepted_once_and_only_for_a_join_that_was_sent() -> None:
    car = OneCar()
    car.sees(A, 0.0)
    join = car.asks(0.0)
    early = Reply(A, A, 1, B, (join.sequence + 1) % 65536, 10, 20.0, NO_ID)
    assert car.hears(early, 0.0) == ["stale"]
    assert car.hears(answer(join), 0.0) == ["joined"]
    assert car.hears(answer(join), 0.0) == ["stale"]


def test_a_late_reply_does_not_bring_back_the_old_leader() -> None:
    car = member_of_a()
    first, second = car.asks(0.5), car.asks(0.6)
    assert car.hears(answer(second, leader=C, number=4, leader_sequence=7), 0.7) == ["renumbered"]
    assert car.hears(answer(first, leader=A, number=1, leader_sequence=11), 0.7) == ["stale"]
    assert (car.group.leader_id, car.group.group_number) == (C, 5)


def test_a_reply_whose_speed_contradicts_the_camera_is_refused() -> None:
    car = OneCar()
    car.sees(A, 0.0, closing=0.0)  # the lead drives 20 m/s, as we do
    assert car.hears(answer(car.asks(0.0), speed=27.0), 0.0) == ["implausible"]
    assert car.group.state is GroupState.REGULAR
    assert car.hears(answer(car.asks(0.1), speed=20.5), 0.1) == ["joined"]


def test_a_reply_is_refused_once_the_camera_reads_another_plate() -> None:
    car = OneCar()
    car.sees(X, 0.0)
    join = car.asks(0.0)
    car.sees(A, 0.05)
    assert car.hears(answer(join, leader=X), 0.06) == ["not_asked"]
    assert car.group.state is GroupState.REGULAR


def test_a_plate_misread_for_a_while_gets_joins_and_costs_no_membership() -> None:
    road = Road()
    b = road.add_row("AB")[1]
    road.run(2.0)
    b.misread_as = X
    road.run(0.8)
    assert any(isinstance(m, Join) and m.to_id == X for m in (e.message for e in road.sent))
    b.misread_as = None
    road.run(5.0)
    assert events_of(b) == [(GroupEvent.JOINED, "answered")]


def test_a_plate_misread_permanently_ends_the_membership() -> None:
    road = Road()
    b = road.add_row("AB")[1]
    road.run(2.0)
    b.misread_as = X
    road.run(1.2)
    assert events_of(b)[-1] == (GroupEvent.LEFT_ALONE, "not_ahead")


# Leaving


def test_a_vehicle_that_falls_back_leaves_and_is_removed_from_the_followers() -> None:
    road = Road()
    a, b = road.add_row("AB")
    road.run(2.0)
    b.position_m = -60.0
    road.run(1.2)
    leave = [entry.message for entry in road.sent if isinstance(entry.message, Leave)]
    assert leave == [Leave(B, A, 2, A, LeaveReason.GAP)]
    assert events_of(b)[-1] == (GroupEvent.LEFT_ALONE, "gap")
    assert events_of(a)[-1] == (GroupEvent.UNFOLLOWED, "leave")
    assert a.group.state is b.group.state is GroupState.REGULAR


def test_after_a_lost_leave_the_follower_expires() -> None:
    road = Road()
    a, b = road.add_row("AB")
    road.run(2.0)
    road.drops = lambda transmission, receiver: isinstance(transmission.message, Leave)
    b.position_m = -60.0
    road.run(3.7)
    assert events_of(a)[-1] == (GroupEvent.UNFOLLOWED, "expired")


def test_a_noisy_gap_around_the_safety_distance_changes_no_membership() -> None:
    road = Road()
    _, b = road.add_row("AB")
    noise = np.random.default_rng(3)
    for _ in range(600):
        b.position_m = -39.6 + float(noise.normal(0.0, 1.0))
        road.run(0.1)
    assert len(events_of(b)) <= 1


def test_bsms_replace_joins_for_a_limited_time() -> None:
    road = Road(Air(has_bsms=True))
    a, b = road.add_row("AB")
    road.run(4.0)
    road.drops = lambda transmission, receiver: transmission.sender == "B"
    road.run(DEFAULTS.join_lifetime_s + 0.1)
    assert events_of(a)[-1] == (GroupEvent.UNFOLLOWED, "expired")
    assert events_of(b)[-1] == (GroupEvent.LEFT_ALONE, "leader_silent")


@pytest.mark.parametrize(
    ("what", "kept_s", "gone_s", "cause"),
    [("has_camera", 0.8, 1.1, "not_ahead"), ("has_bus", 1.7, 2.1, "speed_unknown")],
)
def test_a_lost_sensor_ends_the_membership_after_a_stated_time(
    what: str, kept_s: float, gone_s: float, cause: str
) -> None:
    road = Road()
    b = road.add_row("AB")[1]
    road.run(2.0)
    setattr(b, what, False)
    road.run(kept_s)
    assert b.group.state is GroupState.MEMBER
    road.run(gone_s - kept_s)
    assert events_of(b)[-1] == (GroupEvent.LEFT_ALONE, cause)
    setattr(b, what, True)
    road.run(0.6)
    assert b.group.state is GroupState.MEMBER


@pytest.mark.parametrize(
    ("has_bsms", "answered_s", "cause", "left_s"),
    [
        (False, 0.3, "no_answer", DEFAULTS.membership_lifetime_s),
        (True, 0.3, "no_answer", 0.3 + DEFAULTS.membership_lifetime_s),
        (True, 1.0, "leader_silent", DEFAULTS.leader_silence_s),
    ],
)
def test_a_silent_predecessor_is_left_and_a_silent_follower_expires(
    answered_s: float, cause: str, left_s: float, *, has_bsms: bool
) -> None:
    """By what was received of it last, some time after its last reply: that, or a BSM."""
    road = Road(Air(has_bsms=has_bsms))
    a, b, c = road.add_row("ABC")
    road.run(4.0)
    before = len(road.sent)
    while not any(
        isinstance(each.message, Reply) and each.message.to_id == C for each in road.sent[before:]
    ):
        road.run(0.01)
    replied_at = road.now
    road.run(answered_s)
    b.has_radio = False
    road.run(3.2)
    assert events_of(a)[-1] == (GroupEvent.UNFOLLOWED, "expired")
    assert events_of(c)[-1] == (GroupEvent.LEFT_ALONE, cause)
    assert c.transitions[-1].stamp_s - replied_at == pytest.approx(left_s, abs=0.11)  # a frame
    b.has_radio = True
    road.run(1.0)
    assert places(road) == true_places(road)


def test_a_follower_whose_bsms_do_not_count_is_kept_by_its_joins() -> None:
    """Those of its predecessor count, and put the joins off."""
    road = Road(Air(has_bsms=True, loss=0.3))
    a, b = road.add_row("AB")
    b.is_disputed = True
    road.run(6.0)
    is_kept = []
    for _ in range(2400):
        road.run(0.05)
        is_kept.append(B in a.group.followers)
    assert np.mean(is_kept) > 0.99


def test_a_vehicle_whose_daemon_restarts_is_accepted_again() -> None:
    road = Road()
    road.add_row("ABC")
    road.run(5.0)
    road.remove("A")
    road.add("A", 0.0)
    road.run(5.0)
    assert places(road) == true_places(road)
