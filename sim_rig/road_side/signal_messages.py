"""MAP and SPAT messages (SAE J2735) of a scenario's crossing."""

from datetime import UTC, datetime
from itertools import pairwise

from onboard.messages.fields import Chosen
from onboard.messages.lane_nodes import (
    LatLon,
    Node,
    NodeAttribute,
    NodeAttributeSet,
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
    HOUR_S,
    IntersectionState,
    IntersectionStatus,
    MovementEvent,
    MovementState,
    Spat,
    TimeChangeDetails,
)
from sim_rig.road_side.signal_controller import shown
from sim_rig.roads.earth import ORIGIN_HEIGHT_M, to_degrees
from sim_rig.roads.path import Path
from sim_rig.scenario.schema import Scenario
from sim_rig.scenario.signal_settings import SignalApproach, SignalSettings

_ID = IntersectionReferenceId(None, 1)
_REVISION = 1
_NODE_INTERVAL_M = 20.0
_MINUTE_S = 60.0
_CERTAIN = 15
"""Class of confidence: 100 %."""


def map_message(scenario: Scenario, settings: SignalSettings) -> MapData:
    """Return lane 1 of each approach, as lane and signal group 1, 2, ... in their order.

    The lanes that lead away have the numbers after these, and no course worth sending.
    """
    lanes = [
        _lane(scenario, settings, number, road, approach)
        for number, (road, approach) in enumerate(settings.approaches.items(), start=1)
    ]
    reference = ReferencePoint(*to_degrees(*settings.place_m), ORIGIN_HEIGHT_M)
    geometry = IntersectionGeometry(
        None, _ID, _REVISION, reference, scenario.lane_width_m, None, tuple(lanes)
    )
    return MapData(None, _REVISION, LayerType.INTERSECTION_DATA, None, (geometry,))


def _lane(
    scenario: Scenario,
    settings: SignalSettings,
    number: int,
    road: str,
    approach: SignalApproach,
) -> GenericLane:
    path = Path(scenario.roads[road].points_m)
    steps = round(settings.lane_length_m / _NODE_INTERVAL_M)
    points_m = [
        path.place(approach.stop_line_m - step * _NODE_INTERVAL_M, 0.0) for step in range(steps + 1)
    ]
    latitude_deg, longitude_deg = to_degrees(*points_m[0])
    nodes = [
        Node(
            Chosen("node_lat_lon", LatLon(longitude_deg, latitude_deg)),
            NodeAttributeSet(local_node=(NodeAttribute.STOP_LINE,)),
        ),
        *(
            Node(node_offset(there[0] - here[0], there[1] - here[1]))
            for here, there in pairwise(points_m)
        ),
    ]
    straight_on = ConnectingLane(number + len(settings.approaches), AllowedManeuvers.STRAIGHT)
    attributes = LaneAttributes(
        LaneDirection.INGRESS_PATH, LaneSharing(0), Chosen("vehicle", VehicleLane(0))
    )
    return GenericLane(
        number,
        None,
        number if number < 16 else None,  # ApproachID ends there
        None,
        attributes,
        AllowedManeuvers.STRAIGHT,
        Chosen("nodes", tuple(nodes)),
        (Connection(straight_on, None, number),),
    )


def spat_message(settings: SignalSettings, at_s: float, utc_s: float) -> Spat:
    """Return what the signals show.

    Args:
        settings: the controller's.
        at_s: time since the start of the scenario.
        utc_s: the same instant in seconds since 1970.
    """
    year = datetime.fromtimestamp(utc_s, UTC).year
    in_year_s = utc_s - datetime(year, 1, 1, tzinfo=UTC).timestamp()
    states = []
    for group, each in enumerate(shown(settings, at_s), start=1):
        end_s = (utc_s + each.left_s) % HOUR_S
        timing = TimeChangeDetails(None, end_s, end_s, end_s, _CERTAIN)
        states.append(MovementState(None, group, (MovementEvent(each.state, timing),)))
    in_minute_s = in_year_s % _MINUTE_S
    state = IntersectionState(
        None,
        _ID,
        _REVISION,
        IntersectionStatus.FIXED_TIME_OPERATION,
        in_year_s - in_minute_s,
        in_minute_s,
        None,
        tuple(states),
    )
    return Spat(None, None, (state,))
