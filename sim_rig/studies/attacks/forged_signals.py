"""MAP and SPAT messages by which vehicles that cross have red.

Behind the crossing, such a red silences: they are expected to stop. Before it, it alarms: they are
expected to pass it.
"""

from collections.abc import Iterator
from datetime import UTC, datetime

from onboard.its_g5.infrastructure import encode_map, encode_spat
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
EARLY_LINE_M, HOST_LINE_M = -40.0, 10.0
"""The same where they are to pass it, and the host's line before the place."""
SHOWN_FOR_S = 30.0
_STRAIGHT = AllowedManeuvers.STRAIGHT


def red_for(place_m: Place, host: AttackedHost, signer: Signer, now: float) -> Iterator[bytes]:
    """Send that whoever comes to this place from the left has red behind it.

    Args:
        place_m: where the host's path is crossed.
        host: the attacked one.
        signer: the insider's radio.
        now: the time.
    """
    red = _lane(1, (place_m[0] + STOP_LINE_M, place_m[1]), (-LANE_M, 0.0))
    yield from _shown(place_m, (red,), host, signer, now)


def early_red_for(
    place_m: Place, host: AttackedHost, signer: Signer, now: float
) -> Iterator[bytes]:
    """Send that whoever comes from the left has red long before this place, and the host green."""
    red = _lane(1, (place_m[0] + EARLY_LINE_M, place_m[1]), (-LANE_M, 0.0))
    green = _lane(2, (place_m[0], place_m[1] - HOST_LINE_M), (0.0, -LANE_M))
    yield from _shown(place_m, (red, green), host, signer, now)


def _shown(
    place_m: Place,
    lanes: tuple[GenericLane, ...],
    host: AttackedHost,
    signer: Signer,
    now: float,
) -> Iterator[bytes]:
    """Send an intersection, and that the first of its lanes has red, and the others green."""
    intersection = IntersectionReferenceId(None, 1 + round(place_m[1]) % 60_000)
    reference = ReferencePoint(*placed(*place_m), ORIGIN_HEIGHT_M)
    geometry = IntersectionGeometry(None, intersection, 1, reference, LANE_WIDTH_M, None, lanes)
    lanes_sent = MapData(None, 1, LayerType.INTERSECTION_DATA, None, (geometry,))
    phases = _spat(intersection, len(lanes), host.utc_s + now)
    if signer.its_g5:
        yield signer.signed(encode_map(lanes_sent, signer.temporary_id), psid.MAPEM, now)
        yield signer.signed(encode_spat(phases, signer.temporary_id), psid.SPATEM, now)
        return
    yield signer.signed(map_data.encode(lanes_sent), psid.MAP, now)
    yield signer.signed(spat.encode(phases), psid.SPAT, now)


def _lane(number: int, line_m: Place, to_begin_m: Place) -> GenericLane:
    """Return a lane to a stop line, whose signal group has the number of the lane."""
    latitude_deg, longitude_deg = placed(*line_m)
    nodes = (
        Node(
            Chosen("node_lat_lon", LatLon(longitude_deg, latitude_deg)),
            NodeAttributeSet(local_node=(NodeAttribute.STOP_LINE,)),
        ),
        Node(node_offset(*to_begin_m)),
    )
    attributes = LaneAttributes(
        LaneDirection.INGRESS_PATH, LaneSharing(0), Chosen("vehicle", VehicleLane(0))
    )
    connection = Connection(ConnectingLane(9, _STRAIGHT), None, number)
    return GenericLane(
        number, None, number, None, attributes, _STRAIGHT, Chosen("nodes", nodes), (connection,)
    )


def _spat(intersection: IntersectionReferenceId, lanes: int, utc_s: float) -> Spat:
    end_s = (utc_s + SHOWN_FOR_S) % HOUR_S
    timing = TimeChangeDetails(None, end_s, end_s, end_s, 15)
    colours = [MovementPhaseState.STOP_AND_REMAIN]
    colours += [MovementPhaseState.PROTECTED_MOVEMENT_ALLOWED] * (lanes - 1)
    movements = tuple(
        MovementState(None, group, (MovementEvent(colour, timing),))
        for group, colour in enumerate(colours, 1)
    )
    year = datetime.fromtimestamp(utc_s, UTC).year
    in_year_s = utc_s - datetime(year, 1, 1, tzinfo=UTC).timestamp()
    in_minute_s = in_year_s % 60.0
    return Spat(None, None, (IntersectionState(
        None, intersection, 1, IntersectionStatus.FIXED_TIME_OPERATION,
        in_year_s - in_minute_s, in_minute_s, None, movements,
    ),))  # fmt: skip
