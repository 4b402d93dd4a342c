"""Groups that split, merge, close into circles and change their IDs."""

from dataclasses import replace
from itertools import pairwise

import pytest

from onboard.lcca.adjacent_ids import AdjacentIds
from onboard.lcca.events import WarningRaised
from onboard.lcca.transitions import TRANSITIONS, GroupEvent, GroupState
from onboard.messages.lcca import NO_ID, Join, Leave, LeaveReason, Reply, Update, Warn, WarnCause
from tests.lcca.one_car import OneCar, answer
from tests.lcca.road import Air, Road, car_id, events_of, places, true_places

A, B, C, X = (car_id(name) for name in "ABCX")


# Another lead


def test_a_vehicle_that_cuts_in_joins_without_a_leave_of_others() -> None:
    road = Road()
    a, b, c = road.add_row("ABC", gap_m=30.0)
    road.run(3.0)
    x = road.add("X", -15.0)
    road.run(3.0)
    assert places(road) == {"A": ("A", 1), "X": ("A", 2), "B": ("A", 3), "C": ("A", 4)}
    assert {event for event, _ in events_of(b)[2:]} <= {GroupEvent.JOINED, GroupEvent.RENUMBERED}
    assert {event for event, _ in events_of(c)[1:]} == {GroupEvent.RENUMBERED}
    leaves = [entry.message for entry in road.sent if isinstance(entry.message, Leave)]
    assert [(leave.sender_id, leave.reason) for leave in leaves] == [
        (B, LeaveReason.FOLLOWS_ANOTHER)
    ]
    assert a.group.followers == (X,)
    assert x.group.followers == (B,)


def test_after_a_lane_change_out_of_the_group_the_next_vehicle_closes_up() -> None:
    road = Road()
    _, b, c = road.add_row("ABC", gap_m=15.0)
    road.run(3.0)
    b.lane = 1
    road.run(3.0)
    assert places(road) == {"A": ("A", 1), "B": ("B", 1), "C": ("A", 2)}
    assert events_of(b)[-1] == (GroupEvent.LEFT_ALONE, "not_ahead")
    assert GroupEvent.LEFT_ALONE not in {event for event, _ in events_of(c)}


@pytest.mark.parametrize("updates_lost", [False, True])
def test_a_group_splits_where_the_gap_opens(updates_lost: bool) -> None:
    road = Road()
    road.drops = lambda entry, _: updates_lost and isinstance(entry.message, Update)
    cars = road.add_row("ABCDE")
    road.run(3.0)
    for car in cars[2:]:
        car.position_m -= 40.0
    road.run(1.2)
    assert (GroupEvent.LEFT_LEADING, "gap") in events_of(cars[2])
    road.run(1.5 if updates_lost else 0.0)
    assert places(road) == {
        "A": ("A", 1),
        "B": ("A", 2),
        "C": ("C", 1),
        "D": ("C", 2),  # GN_j - GN_i + 1: number 4 behind number 3 is number 2
        "E": ("C", 3),
    }
    assert [car.group.state for car in cars[1:3]] == [GroupState.MEMBER, GroupState.LEADER]


@pytest.mark.parametrize("updates_lost", [False, True])
def test_two_groups_merge_and_the_second_learns_its_new_leader(updates_lost: bool) -> None:
    road = Road()
    road.drops = lambda entry, _: updates_lost and isinstance(entry.message, Update)
    road.add_row("AB")
    for i, name in enumerate("CDE"):
        road.add(name, -80.0 - 20.0 * i)
    road.run(3.0)
    assert places(road)["E"] == ("C", 3)
    for name in "CDE":
        road.cars[name].position_m += 40.0
    road.run(1.5 if updates_lost else 0.5)
    assert places(road) == true_places(road)
    assert places(road)["E"] == ("A", 5)


def test_without_updates_a_new_leader_spreads_by_refreshes() -> None:
    road = Road()
    road.drops = lambda entry, _: isinstance(entry.message, Update)
    for i, name in enumerate("ABCDEFGHIJ"):
        road.add(name, -80.0 - 20.0 * i)
    road.add("Z", 0.0)
    road.run(5.0)
    for name in "ABCDEFGHIJ":
        road.cars[name].position_m += 50.0
    road.run(2.0)
    assert places(road)["J"] == ("Z", 11)
    reached = [road.cars[name].transitions[-1].stamp_s for name in "ABCDEFGHIJ"]
    one_car_s = road.parameters.spread_s + 3 * road.air.delay_s
    assert all(later - earlier <= one_car_s for earlier, later in pairwise(reached))


@pytest.mark.long
@pytest.mark.parametrize(("cars", "loss"), [(40, 0.0), (16, 0.3)])
def test_leader_sequence_numbers_reach_the_end_of_a_long_group_in_time(
    cars: int, loss: float
) -> None:
    road = Road(Air(reach_m=150.0, loss=loss), seed=3)
    for i in range(cars):
        road.add(f"{i:02d}", -20.0 * i)
    road.run(10.0)
    assert places(road) == true_places(road)
    settled = {name: len(car.transitions) for name, car in road.cars.items()}
    road.run(15.0)
    assert {name: len(car.transitions) for name, car in road.cars.items()} == settled


def test_every_listed_transition_occurs_on_the_road() -> None:
    road = Road()
    cars = road.add_row("ABC", gap_m=15.0)  # REGULAR is followed, joins; a MEMBER is followed
    road.run(2.0)
    x = road.add("X", -7.0)  # cuts in: a MEMBER joins another car, C is renumbered
    road.run(3.0)
    cars[2].position_m = -100.0  # falls back: a MEMBER leaves alone, another is followed no more
    road.run(3.0)
    x.position_m, cars[1].position_m = -60.0, -75.0  # a MEMBER leaves leading
    road.run(3.0)
    x.position_m = -15.0  # a LEADER joins
    road.run(3.0)
    x.lane = 1  # a LEADER is followed no more, and is REGULAR
    cars[1].lane = 2
    road.run(3.0)
    happened = {(t.state_before, t.event) for car in road.cars.values() for t in car.transitions}
    assert happened == {(state, event) for state, row in TRANSITIONS.items() for event in row}


# Circles


@pytest.mark.parametrize("seed", range(20))
def test_two_vehicles_that_read_each_others_plate_do_not_count_up(seed: int) -> None:
    road = Road(Air(jitter_s=0.08), seed=seed)
    a, b = road.add_row("AB")
    ahead = road.add("Z", 20.0)
    ahead.has_radio = False
    a.misread_as = B
    for _ in range(100):
        road.run(0.1)
        assert a.group.group_number <= 2
        assert b.group.group_number <= 2
    a.misread_as = None
    road.run(5.0)
    assert places(road) == true_places(road)


def test_a_leader_that_reads_the_last_members_plate_stays_leader() -> None:
    road = Road()
    road.add("Z", 20.0).has_radio = False
    cars = road.add_row("ABCD")
    road.run(2.0)
    cars[0].misread_as = car_id("D")
    road.run(10.0)
    assert places(road) == true_places(road)
    assert "loop" in cars[0].discarded
    # D is asked, but does not list its own leader as a follower.
    assert "loop" in cars[3].discarded
    assert cars[3].group.followers == ()


def test_a_member_that_reads_the_plate_of_a_vehicle_behind_does_not_follow_it() -> None:
    road = Road()
    cars = road.add_row("ABCD")
    road.run(2.0)
    cars[1].misread_as = car_id("D")
    for _ in range(100):
        road.run(0.1)
        assert all(car.group.group_number <= 4 for car in cars)
        assert cars[1].group.predecessor_id != car_id("D")


# IDs that change


@pytest.mark.parametrize("spread_s", [0.0, 0.5, 1.5])
def test_a_group_outlasts_the_change_of_all_ids(spread_s: float) -> None:
    road = Road()
    cars = road.add_row("ABCDE")
    road.run(3.0)
    said = [len(car.transitions) for car in cars]
    before_change = len(road.sent)
    road.change_ids(spread_s)
    road.run(spread_s + 3.0)
    assert places(road) == true_places(road)
    for car, before in zip(cars, said, strict=True):
        assert {t.event for t in car.transitions[before:]} <= {
            GroupEvent.JOINED,
            GroupEvent.RENUMBERED,
        }
        assert car.group.leader_id == car_id("A", 1)
    assert not any(isinstance(entry.message, Leave) for entry in road.sent[before_change:])


def test_no_message_holds_both_the_old_and_the_new_id_of_one_vehicle() -> None:
    road = Road()
    road.add_row("ABCDE")
    road.run(3.0)
    before = len(road.sent)
    road.change_ids()
    road.run(3.0)
    assert not any(isinstance(entry.message, Update) for entry in road.sent[before:])


def test_sequence_numbers_begin_anew_with_the_id() -> None:
    road = Road()
    road.add_row("ABC")
    road.run(3.0)
    before = len(road.sent)
    road.change_ids()
    road.run(3.0)
    joins = [
        (entry.sender, entry.message.sequence, at >= before)
        for at, entry in enumerate(road.sent)
        if isinstance(entry.message, Join)
    ]
    for name in "BC":
        last = [number for sender, number, is_after in joins if (sender, is_after) == (name, False)]
        next_ = [number for sender, number, is_after in joins if (sender, is_after) == (name, True)]
        assert abs(next_[0] - last[-1]) > 100


def test_the_leaders_count_does_not_run_on_over_a_change_and_its_group_stays() -> None:
    road = Road()
    road.add_row("ABC")
    road.run(3.0)
    for _ in range(5):
        before, transitions = len(road.sent), len(road.cars["C"].transitions)
        road.change_ids(spread_s=0.5)
        road.run(6.0)
        counts = [
            (entry.message.leader_sequence, at >= before)
            for at, entry in enumerate(road.sent)
            if isinstance(entry.message, Reply) and entry.sender == "A"
        ]
        last = [count for count, is_after in counts if not is_after][-1]
        next_ = [count for count, is_after in counts if is_after][-1]
        assert (next_ - last) % (1 << 16) > 100
        said = road.cars["C"].transitions[transitions:]
        assert {each.group_number for each in said} <= {3}
    assert road.cars["C"].group.leader_id == road.cars["A"].group.leader_id


def test_after_the_change_the_previous_id_is_invalid() -> None:
    car = OneCar(own_id=B)
    car.group.set_own_id(X, 1.0)
    car.says(1.0)
    assert car.hears(Join(C, C, 1, B, 0, NO_ID, 0), 2.0) == ["followed"]
    assert car.hears(Leave(C, X, 2, B, LeaveReason.GAP), 2.1) == ["unfollowed"]
    assert car.hears(Join(C, C, 1, B, 0, NO_ID, 0), 4.1) == []
    assert car.hears(Join(C, C, 1, X, 0, NO_ID, 0), 4.1) == ["followed"]


def test_what_the_predecessor_says_of_its_leaders_next_id_names_no_sender() -> None:
    """Else a lead could speak for whomever it names as its leader, until the epoch ends."""
    car = OneCar(own_id=B)
    car.sees(A, 0.0)
    reply = answer(car.asks(0.0), leader=C, number=2)
    assert car.hears(replace(reply, next_leader_id=X), 0.0) == ["joined"]
    braking = Warn(X, X, 1, X, 5, 0, 1, 5, WarnCause.DECELERATION, 6.0, 0.0, 1)
    car.group.receive_message(braking, 0.1)
    raised = [e.origin_id for e in iter(car.group.next_event, None) if isinstance(e, WarningRaised)]
    assert raised == [X]  # of the group that C leads, by its next ID
    assert car.group.leader_id == C
    car.group.set_own_id(b"own-next", 0.2)
    car.group.receive_message(replace(braking, sender_id=C, event_origin_id=C), 0.3)
    raised = [e.origin_id for e in iter(car.group.next_event, None) if isinstance(e, WarningRaised)]
    assert raised == [C]  # and X is not C


def test_only_a_leader_is_known_by_the_id_that_others_say_it_will_have() -> None:
    ids = AdjacentIds(3.0)
    ids.receive_next(A, b"A next__")
    ids.receive_next_leader(C, X)
    leave = Leave(X, X, 2, X, LeaveReason.GAP)
    assert ids.translated(leave, 0.0) == Leave(X, C, 2, X, LeaveReason.GAP)
    assert ids.translated(replace(leave, sender_id=b"A next__"), 0.0).sender_id == A
    ids.change_epoch(B, b"B next__", 1.0)
    leave = Leave(C, C, 2, B, LeaveReason.GAP)
    assert ids.translated(leave, 1.1) == Leave(C, X, 2, b"B next__", LeaveReason.GAP)
    assert ids.translated(leave, 4.1) == leave


def test_own_messages_are_ignored() -> None:
    car = OneCar(own_id=B)
    assert car.hears(Join(B, B, 1, B, 0, NO_ID, 0), 0.0) == ["own_echo"]
