"""Lanes that lead to a stop line, from a MAP message, in metres around its reference point."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

from onboard.kinematics.local_frame import LocalFrame
from onboard.messages.fields import Chosen
from onboard.messages.lane_nodes import ComputedLane, LatLon, Node
from onboard.messages.lanes import GenericLane, LaneDirection
from onboard.messages.map_data import IntersectionGeometry

DEFAULT_WIDTH_M = 3.5
"""Of a lane whose intersection states none."""
_LEAST_COSINE = math.cos(math.radians(45.0))
"""Of the angle between a vehicle on a lane and the lane."""
BEYOND_M = 10.0
"""Distance beyond the last node within which a vehicle is still on the lane."""

Point = tuple[float, float]
"""East and north of the reference point, in m."""


@dataclass(frozen=True, slots=True)
class ApproachLane:
    """A lane for vehicles that ends at a stop line."""

    lane_id: int
    signal_groups: frozenset[int]
    """Signals of its connections; a vehicle may take any of these ways."""
    points_m: tuple[Point, ...]
    """Centre line; the first point is the stop line."""
    width_m: float

    def place(self, position_m: Point, course: Point) -> tuple[float, float] | None:
        """Return where a vehicle is on the lane.

        Args:
            position_m: east and north of the reference point.
            course: the vehicle's direction, as a vector of length 1.

        Returns:
            distance to the stop line along the lane, and distance from the centre line, both in m;
            `None` where no part of the lane before the stop line leads the vehicle's way.
        """
        found, before_m = None, 0.0
        last = len(self.points_m) - 2
        for number, (near, far) in enumerate(pairwise(self.points_m)):
            east_m, north_m = near[0] - far[0], near[1] - far[1]
            length_m = math.hypot(east_m, north_m)
            if east_m * course[0] + north_m * course[1] >= _LEAST_COSINE * length_m:
                from_east_m, from_north_m = near[0] - position_m[0], near[1] - position_m[1]
                to_near_m = (from_east_m * east_m + from_north_m * north_m) / length_m
                aside_m = abs(from_east_m * north_m - from_north_m * east_m) / length_m
                most_m = length_m + (BEYOND_M if number == last else 0.0)
                if 0.0 <= to_near_m <= most_m and (found is None or aside_m < found[1]):
                    found = before_m + to_near_m, aside_m
            before_m += length_m
        return found


def approach_lanes(geometry: IntersectionGeometry, frame: LocalFrame) -> tuple[ApproachLane, ...]:
    """Return the lanes of an intersection that lead vehicles to a signal.

    Lanes without a signal, with a node at the place of the one before, and with a course of a kind
    that is not known are left out.

    Args:
        geometry: the intersection.
        frame: around its reference point.
    """
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
            lanes.append(ApproachLane(lane.lane_id, signal_groups, tuple(points_m), width_m))
    return tuple(lanes)


def _signal_groups(lane: GenericLane) -> frozenset[int]:
    """Return the signals of a lane; none of a lane that is not for vehicles, or leads away."""
    attributes = lane.lane_attributes
    if attributes.lane_type.name != "vehicle":
        return frozenset()
    if LaneDirection.INGRESS_PATH not in attributes.directional_use:
        return frozenset()
    connections = lane.connects_to or ()
    return frozenset(each.signal_group for each in connections if each.signal_group is not None)


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
