"""Warnings where messages are lost, forged or hidden."""

import math
from itertools import pairwise

import numpy as np
import pytest

from onboard.lcca.followers import Followers
from onboard.lcca.forwarding import Forwarding, Reach
from onboard.lcca.group_position import GroupPosition
from onboard.lcca.parameters import GroupParameters
from onboard.messages.lcca import NO_ID, Join, Warn, WarnCause
from tests.lcca.road import Air, Road, Transmission, car_id
from tests.lcca.rows import fewest_transmissions, row, warned

A, B = (car_id(name) for name in "AB")


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
    forged = Join(b"attacker", A, 60_000, b"somebody", 0, NO_ID, 0)
    for car in road.cars.values():
        car.group.receive_message(forged, road.now)
    began = road.now

    road.brake("A")
    road.run(0.9)

    delays_s = [road.cars[name].warnings[0].stamp_s - began for name in "BCDEFGH"]
    assert max(delays_s) < 0.05
    assert len(road.warns()) == 4


def test_an_impossible_reach_delays_a_warning_by_the_own_reach_only() -> None:
    # Anybody may claim to be the 65,535th of a group, and its leader then names that reach.
    parameters = GroupParameters()
    reach = Reach(parameters)
    forwarding = Forwarding(
        parameters, GroupPosition(B, 0), Followers(parameters), reach, np.random.default_rng(0)
    )
    for behind in (1, 2):
        reach.receive_distance(behind.to_bytes(8), behind, 10.0)
    warn = Warn(A, A, 1, A, 7, 65535, 1, 7, WarnCause.DECELERATION, 6.0, 0.0, 1)
    forwarding.receive_first(warn, 1, 10.0)
    assert forwarding.get_timer() == pytest.approx(10.0 + 2 * parameters.slot_s)


def test_copies_of_a_vehicle_with_the_own_number_are_bounded_and_left_with_the_group() -> None:
    """It follows the same vehicle, as one that cuts in, or says so."""
    parameters, position = GroupParameters(), GroupPosition(B, 0)
    position.take(A, 3, 1)
    followers = Followers(parameters)
    followers.receive_join(car_id("C"), 10.0)
    forwarding = Forwarding(
        parameters, position, followers, Reach(parameters), np.random.default_rng(0)
    )
    for k in range(200):
        braking = car_id("A", k % 100), k, 0, 2, k, WarnCause.DECELERATION, 6.0, 0.0, 1
        forwarding.receive_first(Warn(car_id("D"), A, 3, *braking), 0, 10.0)
    assert len(forwarding.copies_to_send(is_member=True, now=10.1)) == 64
    forwarding.drop_others()
    assert forwarding.get_timer() == math.inf


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
    ages = [entry.warn.age_s for entry in road.warns() if entry.at >= released_at]
    assert ages == pytest.approx([each - released_at for each in at])
    assert {entry.warn.hops for entry in road.warns()} == {1}


def test_a_follower_that_has_changed_its_id_is_sent_few_repetitions_under_the_former_one() -> None:
    """Nobody tells which new ID is whose: the former one falls silent, and expires later."""
    road = row("ABC", Air(reach_m=45.0))
    road.change_ids(spread_s=0.5)
    road.run(1.5)
    before = len(road.warns())
    road.brake("A")
    road.run(0.9)
    assert warned(road) == "BC"
    assert len(road.warns()) - before == fewest_transmissions(road, "A", "C")


def test_a_follower_tells_under_its_new_id_what_it_has_received() -> None:
    road = row("AB")
    road.brake("A")
    road.run(0.2)
    before = len(road.warns())
    road.change_ids()
    road.run(0.5)
    assert {entry.warn.event_origin_id for entry in road.warns()[before:]} == {car_id("A", 1)}


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
