"""MAP and SPAT messages by which each vehicle that crosses has red, and so is expected to stop."""

from collections.abc import Iterator
from datetime import UTC, datetime

from onboard.messages import map_data, spat
from onboard.messages.fields import Chosen
from onboard.messages.lane_nodes import LatLon, Node, NodeAttribute, NodeAttributeSet, node_offset
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
    MovementPhaseState,
    MovementState,
    Spat,
    TimeChangeDetails,
)
from onboard.wave_udp import psid
from sim_rig.roads.earth import ORIGIN_HEIGHT_M
from sim_rig.studies.attacks.attack_world import AttackedHost, Place, Signer, placed

LANE_M, LANE_WIDTH_M = 200.0, 3.5
STOP_LINE_M = 30.0
"""East of the host's path, on the lane of the vehicles that cross: until they have crossed it, they
could stop comfortably."""
RED_FOR_S = 30.0
_STRAIGHT = AllowedManeuvers.STRAIGHT


def red_for(place_m: Place, host: AttackedHost, signer: Signer, now: float) -> Iterator[bytes]:
    """Send that whoever comes to this place from the left has red.

    Args:
        place_m: where the host's path is crossed.
        host: the attacked one.
        signer: the insider's radio.
        now: the time.
    """
    intersection = IntersectionReferenceId(None, 1 + round(place_m[1]) % 60_000)
    utc_s = host.utc_s + now
    yield signer.signed(map_data.encode(_map(place_m, intersection)), psid.MAP, now)
    yield signer.signed(spat.encode(_red(intersection, utc_s)), psid.SPAT, now)


def _map(place_m: Place, intersection: IntersectionReferenceId) -> MapData:
    latitude_deg, longitude_deg = placed(place_m[0] + STOP_LINE_M, place_m[1])
    nodes = (
        Node(
            Chosen("node_lat_lon", LatLon(longitude_deg, latitude_deg)),
            NodeAttributeSet(local_node=(NodeAttribute.STOP_LINE,)),
        ),
        Node(node_offset(-LANE_M, 0.0)),
    )
    attributes = LaneAttributes(
        LaneDirection.INGRESS_PATH, LaneSharing(0), Chosen("vehicle", VehicleLane(0))
    )
    connection = Connection(ConnectingLane(2, _STRAIGHT), None, 1)
    lane = GenericLane(
        1, None, 1, None, attributes, _STRAIGHT, Chosen("nodes", nodes), (connection,)
    )
    reference = ReferencePoint(*placed(*place_m), ORIGIN_HEIGHT_M)
    geometry = IntersectionGeometry(None, intersection, 1, reference, LANE_WIDTH_M, None, (lane,))
    return MapData(None, 1, LayerType.INTERSECTION_DATA, None, (geometry,))


def _red(intersection: IntersectionReferenceId, utc_s: float) -> Spat:
    end_s = (utc_s + RED_FOR_S) % HOUR_S
    timing = TimeChangeDetails(None, end_s, end_s, end_s, 15)
    event = MovementEvent(MovementPhaseState.STOP_AND_REMAIN, timing)
    year = datetime.fromtimestamp(utc_s, UTC).year
    in_year_s = utc_s - datetime(year, 1, 1, tzinfo=UTC).timestamp()
    in_minute_s = in_year_s % 60.0
    return Spat(None, None, (IntersectionState(
        None, intersection, 1, IntersectionStatus.FIXED_TIME_OPERATION,
        in_year_s - in_minute_s, in_minute_s, None, (MovementState(None, 1, (event,)),),
    ),))  # fmt: skip
