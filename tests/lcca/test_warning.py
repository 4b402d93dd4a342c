"""Which members are warned, and how many messages that takes."""

from dataclasses import replace
from itertools import accumulate, pairwise

import networkx as nx
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from onboard.lcca.events import WarningLevel, WarningOver, WarningRaised
from onboard.lcca.forwarding import Forwarding, Reach
from onboard.lcca.group_position import GroupPosition
from onboard.lcca.parameters import GroupParameters
from onboard.lcca.refused_warnings import MAX_WARNINGS, RefusedWarnings
from onboard.lcca.transitions import GroupState
from onboard.lcca.warning_list import WarningList
from onboard.messages.lcca import NO_ID, Join, Reply, Update, Warn, WarnCause
from onboard.observations import BrakeCause
from tests.lcca.road import Air, Car, Road, Transmission, car_id, places, true_places

A, B, C = (car_id(name) for name in "ABC")


def row(names: str, air: Air | None = None, seed: int = 0, gap_m: float = 20.0) -> Road:
    """One group in one lane, formed."""
    road = Road(air, seed=seed)
    road.add_row(names, gap_m)
    road.run(5.0)
    assert places(road) == true_places(road)
    return road


def warned(road: Road) -> str:
    return "".join(car.name for car in road.cars.values() if car.warnings)


def fewest_transmissions(road: Road, origin: str, last: str) -> int:
    """The oracle: a row is covered from `origin` to `last` by no fewer than a shortest path."""
    behind = [
        car.name for car in road.cars.values() if car.position_m <= road.cars[origin].position_m
    ]
    return nx.shortest_path_length(road.air_graph().subgraph(behind), origin, last)


# Who


def test_the_demonstration_of_the_paper() -> None:
    # Three cars in a lane, one in another; the first brakes.
    road = Road()
    road.add_row("ABC")
    d = road.add("D", -10.0, lane=1)
    road.run(2.0)
    road.brake("A", 7.0)
    road.run(1.0)
    assert warned(road) == "BC"
    assert d.discarded == ["not_in_group"]
    assert road.cars["C"].warnings == [
        WarningRaised(
            stamp_s=2.002,
            origin_id=A,
            sequence=road.warns()[0].message.event_sequence,
            origin_number=1,
            group_number=3,
            leader_id=A,
            cause=BrakeCause.DECELERATION,
            deceleration_m_s2=7.0,
            age_s=0.0,
            hops=1,
        )
    ]


def test_vehicles_ahead_discard_the_warning() -> None:
    road = row("ABCD")
    road.brake("C")
    road.run(1.0)
    assert warned(road) == "D"
    assert "from_behind" in road.cars["A"].discarded
    assert "from_behind" in road.cars["B"].discarded


def test_another_group_discards_the_warning() -> None:
    road = Road()
    road.add_row("ABC", lane=0)
    road.add_row("XYZ", lane=1)
    road.run(2.0)
    road.brake("A")
    road.run(1.0)
    assert warned(road) == "BC"
    assert [road.cars[name].discarded[-1] for name in "XYZ"] == ["other_group"] * 3


def test_a_regular_vehicle_sends_no_warning() -> None:
    road = row("AB", gap_m=60.0)
    road.brake("A")
    road.run(1.0)
    assert road.warns() == []


def test_the_last_members_warning_is_sent_and_not_repeated() -> None:
    # LCCA: "whenever i is in the LEADER/MEMBER state and performs an emergency brake".
    road = row("ABC")
    road.brake("C")
    road.run(1.0)
    assert len(road.warns()) == 1
    assert warned(road) == ""


def test_each_braking_is_one_alarm_and_two_at_once_are_two() -> None:
    road = row("ABCD", Air(reach_m=45.0))
    road.brake("A")
    road.run(0.003)
    road.brake("B")
    road.run(1.0)
    origins = {car.name: [w.origin_number for w in car.warnings] for car in road.cars.values()}
    assert origins == {"A": [], "B": [1], "C": [1, 2], "D": [2, 1]} or origins["D"] == [1, 2]
    assert len(road.warns()) == fewest_transmissions(road, "A", "D") + 1


# How many messages, and how soon


@settings(max_examples=25, derandomize=True)
@given(
    gaps_m=st.lists(st.floats(6.0, 38.0), min_size=2, max_size=14),
    reach_m=st.floats(39.0, 200.0),
    origin=st.integers(0, 5),
    seed=st.integers(0, 99),
)
def test_on_a_perfect_channel_the_number_of_copies_is_minimal(
    gaps_m: list[float], reach_m: float, origin: int, seed: int
) -> None:
    road = Road(Air(reach_m=reach_m), seed=seed)
    names = "ABCDEFGHIJKLMNOP"[: len(gaps_m) + 1]
    for name, behind_m in zip(names, accumulate(gaps_m, initial=0.0), strict=True):
        road.add(name, -behind_m)
    road.run(4.0)
    assert places(road) == true_places(road)
    first = names[min(origin, len(names) - 2)]
    braked_at = road.now
    road.brake(first)
    road.run(0.9)
    assert len(road.warns()) == fewest_transmissions(road, first, names[-1])
    for car in road.cars.values():
        behind = names.index(car.name) > names.index(first)
        assert len(car.warnings) == int(behind)
        for warning in car.warnings:
            hops = fewest_transmissions(road, first, car.name)
            assert warning.hops == hops
            # Repeated at once: only the air takes time.
            assert warning.stamp_s - braked_at == pytest.approx(hops * road.air.delay_s)
            assert warning.age_s == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("names", ["ABCDEF", "ABCDEFG", "ABCDEFGH"])
@pytest.mark.parametrize("reach_m", [45.0, 65.0, 300.0])
def test_the_number_of_copies_of_an_update_is_minimal(names: str, reach_m: float) -> None:
    road = row(names, Air(reach_m=reach_m))
    road.add("Z", 80.0)
    road.run(2.0)
    before = len(road.sent)
    for name in names:
        road.cars[name].position_m += 50.0  # the whole group closes up to Z
    road.run(1.0)
    assert places(road) == true_places(road)
    updates = [e.sender for e in road.sent[before:] if isinstance(e.message, Update)]
    assert len(updates) == fewest_transmissions(road, "A", names[-1])


def test_a_warning_costs_no_message_beyond_its_copies() -> None:
    # Acknowledgements of begin and end are joins sent before they are due.
    def joins(brakes: bool) -> int:
        road = row("ABCDEF", Air(reach_m=45.0))
        before = len(road.sent)
        if brakes:
            road.brake("A")
        road.run(0.3)
        if brakes:
            road.release("A")
        road.run(20.0)
        return sum(isinstance(entry.message, Join) for entry in road.sent[before:])

    assert abs(joins(brakes=True) - joins(brakes=False)) <= 3 * 5


# On a bad channel


@pytest.mark.parametrize("seed", range(40))
def test_with_a_third_of_all_messages_lost_every_member_is_warned_once(seed: int) -> None:
    road = Road(Air(reach_m=45.0, loss=0.3, jitter_s=0.004), seed=seed)
    road.add_row("ABCDEFGH")
    road.run(6.0)
    road.brake("A")
    road.run(3.0)
    assert [len(car.warnings) for car in road.cars.values()] == [0, 1, 1, 1, 1, 1, 1, 1]


def test_two_leaders_that_brake_at_the_same_moment_collide_once_only() -> None:
    """They do not hear each other: equal waits would collide at each repetition."""
    road = Road()
    road.add_row("ABCD", lane=0)
    road.add_row("WXYZ", lane=1)
    road.run(5.0)

    def collides(entry: Transmission, _to: str) -> bool:
        others = (other for other in road.warns() if other.sender != entry.sender)
        return isinstance(entry.message, Warn) and (
            entry.at == began or any(entry.at - other.at < 0.0005 for other in others)
        )

    began = road.now
    road.drops = collides
    road.brake("A")
    road.brake("W")
    road.run(0.21)
    assert warned(road) == "BCDXYZ"


def test_the_next_candidate_repeats_if_the_designated_forwarder_received_nothing() -> None:
    # From A the radio reaches D. D misses it; C waits one slot, B would have waited two.
    road = row("ABCDEFG", Air(reach_m=65.0))
    road.drops = lambda entry, to: (
        isinstance(entry.message, Warn) and entry.sender == "A" and to == "D"
    )
    road.brake("A")
    road.run(0.1)
    assert [entry.sender for entry in road.warns()] == ["A", "C", "F"]
    waited = road.warns()[1].at - road.warns()[0].at
    assert waited == pytest.approx(road.air.delay_s + road.parameters.slot_s)
    assert warned(road) == "BCDEFG"


def test_a_candidate_behind_the_designated_forwarder_waits_half_a_slot_less() -> None:
    # E hears A by a stroke of luck, although A has only heard as far as D. D misses it.
    road = row("ABCDEFG", Air(reach_m=65.0))
    road.air = Air(reach_m=85.0)
    road.drops = lambda entry, to: (
        isinstance(entry.message, Warn) and entry.sender == "A" and to == "D"
    )
    road.brake("A")
    road.run(0.05)
    assert [entry.sender for entry in road.warns()] == ["A", "E"]


def test_a_forged_group_number_delays_a_warning_by_a_slot_or_two_a_hop() -> None:
    road = row("ABCDEFGH", Air(reach_m=45.0))
    forged = Join(b"attacker", A, 60_000, b"somebody", 0, NO_ID, 0, NO_ID)
    for car in road.cars.values():
        car.group.receive_message(forged, road.now)
    began = road.now

    road.brake("A")
    road.run(0.9)

    delays_s = [road.cars[name].warnings[0].stamp_s - began for name in "BCDEFGH"]
    assert max(delays_s) < 0.05
    assert len(road.warns()) == 4


def test_an_impossible_reach_does_not_delay_an_update() -> None:
    # Anybody may claim to be the 65,535th of a group, and its leader then names that reach.
    parameters = GroupParameters()
    reach = Reach(parameters)
    forwarding = Forwarding(
        parameters, GroupPosition(B, 3.0, 0), WarningList(2.5), reach, np.random.default_rng(0)
    )
    for behind in (1, 2):
        reach.receive(behind.to_bytes(8), behind, 10.0)
    forwarding.receive(Update(A, A, 1, A, 7, 65535, C, 1, 0), 1, 10.0)
    assert forwarding.get_timer() == pytest.approx(10.0 + 2 * parameters.slot_s)


def test_a_candidate_behind_cancels_when_the_designated_forwarder_repeats() -> None:
    # E hears A by luck and would repeat after half a slot, but D, the named one, does so at once.
    road = row("ABCDEFGH", Air(reach_m=65.0))
    # It hears D's copy before its own turn, and G's only after.
    reach_m = 65.0
    road.air = Air(reach_m=85.0, delay_s=0.003)

    def beyond_reach(entry: Transmission, to: str) -> bool:
        apart_m = abs(road.cars[entry.sender].position_m - road.cars[to].position_m)
        return apart_m > reach_m and (entry.sender, to) != ("A", "E")

    road.drops = beyond_reach
    road.brake("A")
    road.run(1.0)
    assert [entry.sender for entry in road.warns()] == ["A", "D", "G"]
    assert warned(road) == "BCDEFGH"


def test_a_follower_that_acknowledged_early_gets_no_repetition() -> None:
    # B misses the first copy and the one that C repeats. When A repeats it, C has long
    # acknowledged it to B.
    road = row("ABCD", Air(reach_m=45.0))
    road.drops = lambda entry, to: (
        to == "B" and isinstance(entry.message, Warn) and entry.message.age_s < 0.05
    )
    road.brake("A")
    road.run(0.9)
    assert warned(road) == "BCD"
    assert [entry.sender for entry in road.warns()] == ["A", "C", "A"]


def test_a_member_accepts_the_copy_of_a_vehicle_behind() -> None:
    road = row("ABCDEFG", Air(reach_m=65.0))
    road.drops = lambda entry, to: (
        isinstance(entry.message, Warn) and entry.sender == "A" and to == "C"
    )
    road.brake("A")
    road.run(0.01)
    assert [entry.sender for entry in road.warns()] == ["A", "D"]
    assert warned(road) == "BCDEFG"
    road.run(0.9)
    assert len(road.warns()) == 2


def test_repetitions_to_a_follower_without_acknowledgement_are_bounded() -> None:
    road = row("AB")
    road.drops = lambda entry, to: isinstance(entry.message, Warn)
    road.brake("A")
    road.run(0.05)
    road.release("A")
    released_at = road.now
    road.run(3.0)
    at = [entry.at for entry in road.warns() if entry.at >= released_at]
    assert len(at) == 1 + road.parameters.warn_repeats
    acknowledge_s, spread_s = road.parameters.acknowledge_s, road.parameters.spread_s
    assert all(0.0 <= b - a - acknowledge_s <= spread_s for a, b in pairwise(at))
    assert len({round(b - a, 6) for a, b in pairwise(at)}) > 1  # hidden vehicles do not collide
    ages = [entry.message.age_s for entry in road.warns() if entry.at >= released_at]
    assert ages == pytest.approx([each - released_at for each in at])
    assert {entry.message.hops for entry in road.warns()} == {1}


@pytest.mark.parametrize("others", ["", "X"])
def test_a_vehicle_that_joins_a_braking_one_is_warned(others: str) -> None:
    """The gap shrinks because that car brakes, so this is when cars join."""
    road = Road()
    road.add("A", 0.0)
    for name in others:  # which follows already
        road.add(name, -25.0)
    late = [road.add("B", -10.0, lane=1), road.add("C", -20.0, lane=1)]
    road.run(3.0)
    road.brake("A")
    road.run(0.8)
    assert warned(road) == others
    for car in late:
        car.lane = 0
    road.run(0.5)
    assert "B" in warned(road)
    assert road.cars["B"].warnings[0].age_s == pytest.approx(1.0, abs=0.2)
    before = len(road.warns())
    road.run(5.0)
    assert warned(road) == others + "BC"
    assert all(len(car.warnings) <= 1 for car in road.cars.values())
    assert len(road.warns()) - before <= 5 * 2


# Braking is a state


def braking_ahead(car: Car) -> list[str]:
    """What the car's driver is told of brakings ahead."""
    kinds = (WarningRaised, WarningLevel, WarningOver)
    return [event.kind for event in car.said if isinstance(event, kinds)]


def test_a_vehicle_that_joins_long_after_the_onset_is_warned_while_the_braking_lasts() -> None:
    road = Road()
    road.add("A", 0.0)
    late = road.add("B", -10.0, lane=1)
    road.run(3.0)
    road.brake("A")
    road.run(10.0)
    late.lane = 0
    began = road.now
    road.run(0.5)
    assert late.group.state is GroupState.MEMBER
    (warning,) = late.warnings
    joined_at = late.transitions[-1].stamp_s
    assert warning.stamp_s - joined_at < 0.05
    assert began < joined_at


def test_a_vehicle_that_joins_after_the_end_is_not_warned() -> None:
    road = Road()
    road.add("A", 0.0)
    late = road.add("B", -10.0, lane=1)
    road.run(3.0)
    road.brake("A")
    road.run(1.0)
    road.release("A")
    late.lane = 0
    road.run(2.0)
    assert late.group.state is GroupState.MEMBER
    assert road.warns() == []


def test_the_end_of_a_braking_reaches_all_and_a_second_braking_warns_anew() -> None:
    road = row("ABCDE", Air(reach_m=45.0))
    for _ in range(2):
        road.brake("A")
        road.run(1.5)
        road.release("A")
        road.run(0.5)
    for name in "BCDE":
        assert braking_ahead(road.cars[name]) == ["warning", "warning_over"] * 2


def test_a_harder_braking_is_a_level_of_the_same_one() -> None:
    road = row("ABC")
    road.brake("A", 5.0)
    road.run(0.3)
    road.brake("A", 5.4)
    road.run(0.3)
    road.brake("A", 9.0)
    road.run(0.3)
    road.brake("A", 60.0, BrakeCause.COLLISION)
    road.run(0.3)
    assert braking_ahead(road.cars["C"]) == ["warning", "warning_level", "warning_level"]
    assert road.cars["C"].said[-1].deceleration_m_s2 == 25.5
    assert road.cars["C"].said[-1].cause is BrakeCause.COLLISION


def test_a_braking_lasts_for_those_behind_as_long_as_it_lasts() -> None:
    road = row("ABC")
    road.brake("A")
    road.run(30.0)
    assert [braking_ahead(road.cars[name]) for name in "BC"] == [["warning"]] * 2
    assert len(road.warns()) <= 31


def test_a_braking_vehicle_that_falls_silent_is_warned_of_for_the_event_lifetime() -> None:
    # A crash may destroy the radio.
    road = row("ABC")
    road.brake("A")
    road.run(0.1)
    road.cars["A"].has_radio = False
    road.run(road.parameters.event_lifetime_s - 0.2)
    assert braking_ahead(road.cars["C"]) == ["warning"]
    road.run(0.3)
    assert braking_ahead(road.cars["C"]) == ["warning", "warning_over"]
    assert road.cars["C"].said[-1].reason == "expired"


def test_a_warning_that_arrives_after_the_end_is_outdated() -> None:
    road = row("AB")
    delayed: list[Transmission] = []

    def first_copy(entry: Transmission, to: str) -> bool:
        if isinstance(entry.message, Warn) and not delayed:
            delayed.append(entry)
            return True
        return False

    road.drops = first_copy
    road.brake("A")
    road.run(0.01)
    road.release("A")
    road.run(0.5)
    b = road.cars["B"]
    road.do(b, lambda now: b.group.receive_message(delayed[0].message, now))
    assert b.warnings == []
    assert b.discarded[-1] == "outdated"


def test_a_forged_sequence_number_far_ahead_does_not_suppress_a_braking() -> None:
    road = row("ABC")
    road.brake("A")
    road.run(0.1)
    forged = replace(road.warns()[0].message, event_sequence=40_000, cause=WarnCause.OVER)
    for name in "BC":
        car = road.cars[name]
        road.do(car, lambda now, car=car: car.group.receive_message(forged, now))
    assert braking_ahead(road.cars["C"]) == ["warning"]  # An end comes from B only.
    road.run(1.1)
    assert braking_ahead(road.cars["C"]) == ["warning", "warning_over", "warning"]


def test_the_button_warns_of_a_test_that_ends_by_itself() -> None:
    road = row("ABC")
    road.brake("A", 4.0, BrakeCause.TEST)
    road.run(2.0)
    assert braking_ahead(road.cars["C"]) == ["warning", "warning_over"]
    assert road.cars["C"].warnings[0].cause is BrakeCause.TEST


def test_a_real_braking_takes_the_place_of_a_test_and_not_the_other_way_round() -> None:
    road = row("ABC")
    road.brake("A", 4.0, BrakeCause.TEST)
    road.run(0.5)
    road.brake("A", 7.0)
    road.run(0.5)
    road.brake("A", 4.0, BrakeCause.TEST)
    road.run(2.0)
    c = road.cars["C"]
    assert braking_ahead(c) == ["warning", "warning_level"]
    assert c.said[-1].cause is BrakeCause.DECELERATION


# Warnings received before joining


def test_a_warning_received_before_joining_is_judged_again_on_joining() -> None:
    # A, two ahead, brakes while C is not a member yet. A's and B's radios are lost after that.
    road = Road()
    road.add_row("AB")
    late = road.add("C", -40.0, lane=1)
    road.run(3.0)
    road.brake("A")
    road.run(0.1)
    assert "not_in_group" in late.discarded
    road.drops = lambda entry, _: isinstance(entry.message, Warn)
    late.lane = 0
    road.run(0.5)
    (warning,) = late.warnings
    assert warning.origin_id == A
    assert warning.age_s == pytest.approx(warning.stamp_s - 3.0, abs=0.01)


def test_a_follower_that_received_no_warning_is_warned_by_the_vehicle_that_it_joins() -> None:
    road = Road(Air(reach_m=45.0))
    road.add_row("ABCD")
    late = road.add("E", -80.0, lane=1)
    road.run(3.0)
    road.drops = lambda entry, to: to == "E" and entry.sender != "D"
    road.brake("A")
    road.run(0.5)
    late.lane = 0
    road.run(0.5)
    assert warned(road) == "BCDE"
    assert late.warnings[0].stamp_s - late.transitions[-1].stamp_s < 0.05


def test_a_warning_of_the_lane_that_was_left_is_not_passed_on() -> None:
    road = Road()
    road.add_row("AB", lane=0)
    road.add_row("XY", lane=1)
    road.run(3.0)
    road.brake("A")
    road.run(0.2)
    road.cars["B"].lane, road.cars["B"].position_m = 1, -35.0  # between Y and whoever comes
    road.run(0.5)
    late = road.add("C", -50.0, lane=1)
    road.run(1.0)
    assert late.group.state is GroupState.MEMBER
    assert late.warnings == []


def test_warnings_received_before_joining_are_of_bounded_number_and_age() -> None:
    refused = RefusedWarnings(lifetime_s=3.0)
    warn = Warn(A, A, 1, A, 5, 0, 1, 5, WarnCause.DECELERATION, 6.0, 0.5, 1)
    for i in range(MAX_WARNINGS + 5):
        refused.receive(replace(warn, event_origin_id=i.to_bytes(8)), 10.0)
    refused.receive(replace(warn, event_origin_id=i.to_bytes(8), age_s=2.9), 10.0)
    taken = list(refused.take(10.2))
    assert len(taken) == MAX_WARNINGS - 1
    assert {round(each.age_s, 3) for each in taken} == {0.7}
    assert list(refused.take(10.2)) == []


def test_a_lost_acknowledgement_is_sent_again_and_raises_no_second_alarm() -> None:
    road = row("AB")
    lost: list[Transmission] = []

    def first_acknowledgement(entry: Transmission, to: str) -> bool:
        if (
            isinstance(entry.message, Join)
            and entry.message.acknowledged_origin_id == A
            and not lost
        ):
            lost.append(entry)
            return True
        return False

    road.drops = first_acknowledgement
    road.brake("A")
    road.run(0.9)
    assert len(lost) == 1
    assert len(road.warns()) == 2
    assert len(road.cars["B"].warnings) == 1
    assert "duplicate" in road.cars["B"].discarded


def test_a_member_with_an_outdated_leader_accepts_its_predecessor() -> None:
    # The group joins Z, and no update and no reply arrives: C still takes A for its leader.
    road = row("ABC")
    road.add("Z", 80.0)
    road.run(1.0)
    road.drops = lambda entry, to: to == "C" and isinstance(entry.message, Update | Reply)
    for name in "ABC":
        road.cars[name].position_m += 50.0
    road.run(0.6)
    assert places(road)["B"] == ("Z", 3)
    assert places(road)["C"] == ("A", 3)
    road.brake("Z")
    road.run(1.0)
    assert warned(road) == "ABC"
    assert "other_group" in road.cars["C"].discarded


def test_a_warning_during_a_change_of_ids_arrives() -> None:
    for after_s in np.arange(0.0, 0.6, 0.05):
        road = row("ABCDEF", Air(reach_m=45.0))
        road.change_ids(spread_s=0.5)
        road.run(float(after_s))
        road.brake("A")
        road.run(2.0)
        assert [len(car.warnings) for car in road.cars.values()] == [0, 1, 1, 1, 1, 1]
