"""A MAP and a SPAT message of one crossing."""

from typing import Any

from onboard.messages.fields import Chosen
from onboard.messages.lane_nodes import (
    Node,
    NodeAttribute,
    NodeAttributeSet,
    RegulatorySpeedLimit,
    SpeedLimitType,
    node_offset,
)
from onboard.messages.lanes import (
    AllowedManeuvers,
    ConnectingLane,
    Connection,
    GenericLane,
    IntersectionReferenceId,
    LaneAttributes,
    LaneDirection,
    LaneSharing,
    VehicleLane,
)
from onboard.messages.map_data import IntersectionGeometry, LayerType, MapData, ReferencePoint
from onboard.messages.spat import (
    IntersectionState,
    IntersectionStatus,
    MovementEvent,
    MovementPhaseState,
    MovementState,
    Spat,
    TimeChangeDetails,
)

ID = IntersectionReferenceId(region=7, id=501)
MOY_S = 240_000 * 60.0
"""Beginning of an hour."""


def intersections_of(message: MapData) -> tuple[IntersectionGeometry, ...]:
    assert message.intersections is not None
    return message.intersections


def ways_of(lane: GenericLane) -> tuple[Connection, ...]:
    assert lane.connects_to is not None
    return lane.connects_to


def lane(
    lane_id: int,
    nodes_m: list[tuple[float, float]],
    *,
    signal_group: int | None = None,
    ingress: bool = True,
) -> GenericLane:
    """A vehicle lane; the first node is given from the reference point, the others from there."""
    stop_line = NodeAttributeSet(local_node=(NodeAttribute.STOP_LINE,))
    nodes: list[Node] = []
    east_m, north_m = 0.0, 0.0
    for node_east_m, node_north_m in nodes_m:
        delta = node_offset(node_east_m - east_m, node_north_m - north_m)
        nodes.append(Node(delta, stop_line if ingress and not nodes else None))
        east_m, north_m = node_east_m, node_north_m
    connects_to = (
        (Connection(ConnectingLane(lane_id + 10, AllowedManeuvers.STRAIGHT), None, signal_group),)
        if ingress
        else None
    )
    return GenericLane(
        lane_id,
        None,
        lane_id if ingress else None,
        None if ingress else lane_id,
        LaneAttributes(
            LaneDirection.INGRESS_PATH if ingress else LaneDirection.EGRESS_PATH,
            LaneSharing(0),
            Chosen("vehicle", VehicleLane(0)),
        ),
        AllowedManeuvers.STRAIGHT if ingress else None,
        Chosen("nodes", tuple(nodes)),
        connects_to,
    )


def crossing_map(revision: int = 3) -> MapData:
    """Lane 1 leads east (signal group 2), lane 2 north (signal group 4); stop lines at 8 m."""
    return MapData(
        None,
        revision,
        LayerType.INTERSECTION_DATA,
        None,
        (
            IntersectionGeometry(
                "Main and First",
                ID,
                revision,
                ReferencePoint(42.0, -83.0, 180.0),
                3.5,
                (RegulatorySpeedLimit(SpeedLimitType.VEHICLE_MAX_SPEED, 13.9),),
                (
                    lane(1, [(-8.0, 0.0), (-60.0, 0.0), (-200.0, 0.0)], signal_group=2),
                    lane(2, [(0.0, -8.0), (0.0, -60.0), (0.0, -200.0)], signal_group=4),
                    lane(11, [(8.0, 0.0), (60.0, 0.0)], ingress=False),
                ),
            ),
        ),
    )


def movement(
    signal_group: int, state: MovementPhaseState, min_end_s: float | None, **timing: Any
) -> MovementState:
    """A signal group that shows `state` until `min_end_s` of the hour."""
    details = TimeChangeDetails(None, min_end_s, **timing)
    return MovementState(None, signal_group, (MovementEvent(state, details),))


def crossing_spat(
    *movements: MovementState,
    intersection: IntersectionReferenceId = ID,
    revision: int = 3,
    status: IntersectionStatus = IntersectionStatus.FIXED_TIME_OPERATION,
    moy_s: float | None = MOY_S,
    time_stamp_s: float | None = 12.3,
) -> Spat:
    """Signal group 2 has green, 4 red, unless other movements are given."""
    states = movements or (
        movement(
            2,
            MovementPhaseState.PROTECTED_MOVEMENT_ALLOWED,
            20.0,
            max_end_s=25.0,
            likely_s=22.0,
            confidence=13,
        ),
        movement(4, MovementPhaseState.STOP_AND_REMAIN, 26.0),
    )
    state = IntersectionState(
        None, intersection, revision, status, moy_s, time_stamp_s, None, states
    )
    return Spat(None, None, (state,))
