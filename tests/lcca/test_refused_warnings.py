"""Warnings that are received before their group is joined."""

from dataclasses import replace

import pytest

from onboard.lcca.refused_warnings import MAX_WARNINGS, RefusedWarnings
from onboard.lcca.transitions import GroupState
from onboard.messages.lcca import Warn, WarnCause
from tests.lcca.one_car import OneCar, answer
from tests.lcca.road import Air, Road, car_id
from tests.lcca.rows import warned

A, B, C, D = map(car_id, "ABCD")


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


@pytest.mark.parametrize("is_end_first", [True, False])
def test_a_braking_that_was_over_before_joining_is_not_warned_of(*, is_end_first: bool) -> None:
    # D has repeated the braking, and not its end, which goes from each vehicle to the next.
    begin = Warn(D, A, 4, A, 5, 0, 1, 5, WarnCause.DECELERATION, 6.0, 0.5, 3)
    end = Warn(B, A, 2, A, 6, 0, 1, 5, WarnCause.OVER, 0.0, 0.0, 2)
    joining = OneCar(own_id=C)
    for each in (end, begin) if is_end_first else (begin, end):
        assert joining.hears(each, 0.0) == ["not_in_group"]
    joining.sees(B, 0.1)
    assert joining.hears(answer(joining.asks(0.1), number=2), 0.1) == ["joined"]


def test_warnings_received_before_joining_are_of_bounded_number_and_age() -> None:
    refused = RefusedWarnings(lifetime_s=3.0)
    warn = Warn(A, A, 1, A, 5, 0, 1, 5, WarnCause.DECELERATION, 6.0, 0.5, 1)
    for i in range(MAX_WARNINGS + 5):
        refused.receive_warn(replace(warn, event_origin_id=i.to_bytes(8)), 10.0)
    refused.receive_warn(replace(warn, event_origin_id=i.to_bytes(8), age_s=2.9), 10.0)
    taken = list(refused.take(10.2))
    assert len(taken) == MAX_WARNINGS - 1
    assert {round(each.age_s, 3) for each in taken} == {0.7}
    assert list(refused.take(10.2)) == []


def test_a_copy_that_others_send_does_not_take_the_place_of_the_braking_vehicles_own() -> None:
    refused = RefusedWarnings(lifetime_s=3.0)
    warn = Warn(A, A, 1, A, 5, 0, 1, 5, WarnCause.DECELERATION, 6.0, 0.5, 1)
    refused.receive_warn(warn, 10.0)
    for age_s in (2.9, 60.0):
        refused.receive_warn(replace(warn, sender_id=b"insider!", age_s=age_s), 10.0)
    assert [each.sender_id for each in refused.take(10.2)] == [A]
