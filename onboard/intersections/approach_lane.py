"""Lanes that lead to a stop line, from a MAP message, in metres around its reference point."""

import math
from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import NamedTuple

from onboard.errors import DecodeError
from onboard.kinematics.local_frame import LocalFrame
from onboard.messages.fields import Chosen
from onboard.messages.lane_nodes import ComputedLane, LatLon, Node
from onboard.messages.lanes import UNKNOWN_SIGNAL_GROUP, GenericLane, LaneDirection
from onboard.messages.map_data import IntersectionGeometry

DEFAULT_WIDTH_M = 3.5
"""Of a lane whose intersection states none."""
_LEAST_COSINE = math.cos(math.radians(45.0))
"""Of the angle between a vehicle on a lane and the lane."""
BEYOND_M = 10.0
"""Distance beyond the last node within which a vehicle is still on the lane."""
MAX_NODES = 512
"""Nodes of the lanes of a road-side unit that are kept: each costs time for each vehicle that
crosses. 1,400 octets have at most 448 nodes, of 25 bits each; computed lanes repeat them."""

Point = tuple[float, float]
"""East and north of the reference point, in m."""


class _Segment(NamedTuple):
    """Straight part of a lane, up to the point `near` the stop line."""

    near_east_m: float
    near_north_m: float
    along_east: float
    along_north: float
    """Direction of travel, as a vector of length 1."""
    length_m: float
    before_m: float
    """From `near` to the stop line along the lane."""


class ApproachLane:
    """A lane for vehicles that ends at a stop line."""

    def __init__(
        self,
        lane_id: int,
        signal_groups: frozenset[int],
        points_m: Sequence[Point],
        width_m: float,
    ) -> None:
        """Take the lane.

        Args:
            lane_id: its number.
            signal_groups: signals of its connections; a vehicle may take any of these ways.
            points_m: centre line, at least two points, no two in a row equal; the first one is the
                stop line.
            width_m: its width.
        """
        self.lane_id = lane_id
        self.signal_groups = signal_groups
        self.points_m = tuple(points_m)
        self.width_m = width_m
        self._segments = tuple(_segments(self.points_m))

    def place(self, position_m: Point, course: Point) -> tuple[float, float] | None:
        """Return where a vehicle is on the lane.

        Args:
            position_m: east and north of the reference point.
            course: the vehicle's direction, as a vector of length 1.

        Returns:
            distance to the stop line along the lane, and distance from the centre line, both in m;
            `None` where no part of the lane before the stop line leads the vehicle's way.
        """
        east_m, north_m = position_m
        course_east, course_north = course
        found, last = None, self._segments[-1]
        led, is_behind = False, False
        for each in self._segments:
            near_east_m, near_north_m, along_east, along_north, length_m, before_m = each
            leads = along_east * course_east + along_north * course_north >= _LEAST_COSINE
            to_east_m, to_north_m = near_east_m - east_m, near_north_m - north_m
            to_near_m = to_east_m * along_east + to_north_m * along_north
            place = None
            if to_near_m < 0.0:
                if is_behind and (led or leads):  # outside of a bend, where no part is beside it
                    place = before_m, math.hypot(to_east_m, to_north_m)
            elif leads and to_near_m <= (length_m + BEYOND_M if each is last else length_m):
                aside_m = abs(to_east_m * along_north - to_north_m * along_east)
                place = before_m + to_near_m, aside_m
            if place is not None and (found is None or place[1] < found[1]):
                found = place
            led, is_behind = leads, to_near_m > length_m
        return found


def _segments(points_m: Sequence[Point]) -> Iterator[_Segment]:
    before_m = 0.0
    for near, far in pairwise(points_m):
        length_m = math.dist(near, far)
        along_east, along_north = (near[0] - far[0]) / length_m, (near[1] - far[1]) / length_m
        yield _Segment(*near, along_east, along_north, length_m, before_m)
        before_m += length_m


def approach_lanes(geometry: IntersectionGeometry, frame: LocalFrame) -> tuple[ApproachLane, ...]:
    """Return the lanes of an intersection that lead vehicles to a signal.

    Lanes without a signal, with a node at the place of the one before, and with a course of a kind
    that is not known are left out.

    Args:
        geometry: the intersection.
        frame: around its reference point.

    Raises:
        DecodeError: `too_many_nodes`, of all lanes together.
    """
    nodes = _nodes(geometry)
    if nodes > MAX_NODES:
        raise DecodeError("too_many_nodes", f"{nodes} nodes")
    courses = {lane.lane_id: _points(lane.node_list, frame) for lane in geometry.lanes}
    lanes = []
    for lane in geometry.lanes:
        points_m = courses[lane.lane_id]
        if isinstance(lane.node_list.value, ComputedLane):
            points_m = _computed(lane.node_list.value, courses)
        signal_groups = _signal_groups(lane)
        is_course = all(math.dist(*pair) > 0.0 for pair in pairwise(points_m))
        if signal_groups and len(points_m) > 1 and is_course:
            width_m = geometry.lane_width_m or DEFAULT_WIDTH_M
            lanes.append(ApproachLane(lane.lane_id, signal_groups, points_m, width_m))
    return tuple(lanes)


def _nodes(geometry: IntersectionGeometry) -> int:
    """Return the number of nodes of all lanes, and of those that are computed from them."""
    listed = {
        lane.lane_id: len(lane.node_list.value)
        for lane in geometry.lanes
        if lane.node_list.name == "nodes"
    }
    computed = (
        listed.get(lane.node_list.value.reference_lane_id, 0)
        for lane in geometry.lanes
        if isinstance(lane.node_list.value, ComputedLane)
    )
    return sum(listed.values()) + sum(computed)


def _signal_groups(lane: GenericLane) -> frozenset[int]:
    """Return the signals of a lane; none of a lane that is not for vehicles, or leads away.

    A way without a signal beside others counts as one with an unknown signal: it may be free.
    """
    attributes = lane.lane_attributes
    if attributes.lane_type.name != "vehicle":
        return frozenset()
    if LaneDirection.INGRESS_PATH not in attributes.directional_use:
        return frozenset()
    ways = lane.connects_to or ()
    groups = frozenset(each.signal_group or UNKNOWN_SIGNAL_GROUP for each in ways)
    return groups if any(groups) else frozenset()


def _points(course: Chosen, frame: LocalFrame) -> Sequence[Point]:
    if course.name != "nodes":
        return ()
    points_m: list[Point] = []
    east_m = north_m = 0.0
    node: Node
    for node in course.value:
        match node.delta.value:
            case (float(east), float(north)):
                east_m, north_m = east_m + east, north_m + north
            case LatLon(longitude_deg=float(longitude_deg), latitude_deg=float(latitude_deg)):
                east_m, north_m = map(float, frame.position_m(latitude_deg, longitude_deg))
            case _:
                return ()
        points_m.append((east_m, north_m))
    return points_m


def _computed(lane: ComputedLane, courses: dict[int, Sequence[Point]]) -> Sequence[Point]:
    """Return another lane's course, scaled, turned about its first point, and moved."""
    course = courses.get(lane.reference_lane_id, ())
    if not course:
        return ()
    first_east_m, first_north_m = course[0]
    scale_east, scale_north = 1.0 + (lane.scale_x or 0.0), 1.0 + (lane.scale_y or 0.0)
    turn_rad = lane.rotate_xy_rad or 0.0
    cos, sin = math.cos(turn_rad), math.sin(turn_rad)
    points_m = []
    for east_m, north_m in course:
        x_m, y_m = scale_east * (east_m - first_east_m), scale_north * (north_m - first_north_m)
        points_m.append(
            (
                first_east_m + lane.offset_x_m.value + cos * x_m + sin * y_m,
                first_north_m + lane.offset_y_m.value - sin * x_m + cos * y_m,
            )
        )
    return points_m
