"""Lanes of a MAP message, and which of them a vehicle is on."""

import math
from dataclasses import replace

import pytest

from onboard.intersections.approach_lane import ApproachLane, approach_lanes
from onboard.kinematics.local_frame import LocalFrame
from onboard.messages import map_data
from onboard.messages.fields import Chosen
from onboard.messages.lane_nodes import ComputedLane, LatLon, Node
from onboard.messages.lanes import UNKNOWN_SIGNAL_GROUP, GenericLane, OtherLane
from tests.messages.crossing_messages import crossing_map, intersections_of, lane, ways_of

FRAME = LocalFrame(42.0, -83.0)
EAST, NORTH = (1.0, 0.0), (0.0, 1.0)
(GEOMETRY,) = intersections_of(map_data.decode(map_data.encode(crossing_map())))
EASTWARDS, NORTHWARDS, AWAY = GEOMETRY.lanes


def lanes_of(*lanes: GenericLane) -> tuple[ApproachLane, ...]:
    return approach_lanes(replace(GEOMETRY, lanes=lanes), FRAME)


def test_lanes_that_lead_to_a_signal_are_found_with_their_course() -> None:
    first, second = lanes_of(*GEOMETRY.lanes)
    assert (first.lane_id, first.signal_groups, first.width_m) == (1, frozenset({2}), 3.5)
    assert first.points_m == ((-8.0, 0.0), (-60.0, 0.0), (-200.0, 0.0))
    assert (second.lane_id, second.signal_groups) == (2, frozenset({4}))


@pytest.mark.parametrize(
    ("position_m", "course", "place"),
    [
        ((-20.0, 1.0), EAST, (12.0, 1.0)),
        ((-130.0, -2.0), EAST, (122.0, 2.0)),
        ((-205.0, 0.0), EAST, (197.0, 0.0)),
        ((-20.0, 1.0), (-1.0, 0.0), None),
        ((-20.0, 1.0), NORTH, None),
        ((-7.0, 0.0), EAST, None),
        ((-220.0, 0.0), EAST, None),
    ],
    ids=["near", "second segment", "beyond the end", "oncoming", "across", "past", "far"],
)
def test_a_vehicle_is_placed_by_position_and_course(
    position_m: tuple[float, float], course: tuple[float, float], place: tuple[float, float] | None
) -> None:
    (eastwards,) = lanes_of(EASTWARDS)
    assert eastwards.place(position_m, course) == place


@pytest.mark.parametrize("side", [1.0, -1.0], ids=["left", "right"])
def test_outside_of_a_bend_no_part_is_beside_a_vehicle_and_the_bend_is_the_nearest_place(
    side: float,
) -> None:
    """Else its signal was unknown for as long as it drove there."""
    (bent,) = lanes_of(lane(1, [(0.0, 0.0), (-20.0, 0.0), (-40.0, side * 20.0)], signal_group=2))
    halfway = (math.cos(math.pi / 8.0), side * -math.sin(math.pi / 8.0))
    outside_m = (-20.0 - 1.5 * math.sin(math.pi / 8.0), side * -1.5 * math.cos(math.pi / 8.0))

    assert bent.place(outside_m, halfway) == pytest.approx((20.0, 1.5))


def test_past_the_stop_line_no_bend_close_before_it_is_the_place_of_a_vehicle() -> None:
    (bent,) = lanes_of(lane(1, [(0.0, 0.0), (-1.0, 0.0), (-21.0, 20.0)], signal_group=2))

    assert bent.place((0.3, -0.5), EAST) is None


def test_a_node_may_have_a_position_instead_of_an_offset() -> None:
    there = FRAME.position_m(42.0005, -83.001)
    nodes = (*EASTWARDS.node_list.value[:2], Node(Chosen("node_lat_lon", LatLon(-83.001, 42.0005))))
    (found,) = lanes_of(replace(EASTWARDS, node_list=Chosen("nodes", nodes)))
    assert found.points_m[2] == pytest.approx(tuple(there))


def test_a_computed_lane_has_the_course_of_another_one_moved_beside_it() -> None:
    computed = ComputedLane(1, Chosen("small", 0.0), Chosen("small", -3.5))
    beside = replace(EASTWARDS, lane_id=5, node_list=Chosen("computed", computed))
    found = lanes_of(EASTWARDS, beside)
    assert found[1].points_m == ((-8.0, -3.5), (-60.0, -3.5), (-200.0, -3.5))


@pytest.mark.parametrize("group", [None, 0])
def test_a_way_without_a_signal_or_with_an_unknown_one_counts_as_unknown(group: int | None) -> None:
    (straight,) = ways_of(EASTWARDS)
    ways = (straight, replace(straight, signal_group=group))
    (found,) = lanes_of(replace(EASTWARDS, connects_to=ways))
    assert found.signal_groups == {2, UNKNOWN_SIGNAL_GROUP}


@pytest.mark.parametrize(
    "left_out",
    [
        AWAY,
        replace(EASTWARDS, connects_to=None),
        replace(
            EASTWARDS,
            lane_attributes=replace(
                EASTWARDS.lane_attributes, lane_type=Chosen("crosswalk", OtherLane(0))
            ),
        ),
        lane(1, [(-8.0, 0.0), (-8.0, 0.0)], signal_group=2),
        replace(EASTWARDS, node_list=Chosen(0, b"\x00")),
        replace(
            EASTWARDS,
            node_list=Chosen(
                "computed", ComputedLane(77, Chosen("small", 0.0), Chosen("small", 0.0))
            ),
        ),
    ],
    ids=["leads away", "no signal", "crosswalk", "two nodes in one", "unknown kind", "of no lane"],
)
def test_other_lanes_are_left_out(left_out: GenericLane) -> None:
    assert lanes_of(left_out) == ()
