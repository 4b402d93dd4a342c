"""MAPEM and SPATEM: the MAP and SPAT of J2735 behind an ItsPduHeader (TS 103 301 V1.3.1).

Their module, of ISO/TS 19091, repeats J2735's, but its longitudes begin one step lower: each is one
step greater in the same bits. A longitude that is not known is refused, as `out_of_range`.
"""

from dataclasses import replace
from typing import TypeVar

from onboard.errors import DecodeError
from onboard.messages.its_common import PROTOCOL_VERSION
from onboard.messages.lane_nodes import LatLon, Node
from onboard.messages.lanes import GenericLane
from onboard.messages.map_data import (
    MAP_DATA,
    IntersectionGeometry,
    MapData,
    ReferencePoint,
    RoadSegment,
)
from onboard.messages.spat import SPAT, Spat

SPATEM_ID, MAPEM_ID = 4, 5
"""In the ItsPduHeader."""
VERSIONS_READ = (1, PROTOCOL_VERSION)
"""Versions of the header under which these messages are in use, with the same bits."""
STEP_DEG = 1e-7
_HEADER_BYTES = 6

PartT = TypeVar("PartT", IntersectionGeometry, RoadSegment)
PlaceT = TypeVar("PlaceT", ReferencePoint, LatLon)


def encode_map(message: MapData, station_id: bytes) -> bytes:
    """Return a MAPEM. Raises `ValueError`, naming the field that cannot carry its value."""
    return _header(MAPEM_ID, station_id) + MAP_DATA.encode(_moved(message, STEP_DEG))


def encode_spat(message: Spat, station_id: bytes) -> bytes:
    """Return a SPATEM. Raises `ValueError`, as `encode_map`."""
    return _header(SPATEM_ID, station_id) + SPAT.encode(message)


def decode_map(data: bytes) -> MapData:
    """Read a MAPEM.

    Raises:
        DecodeError: `too_short`, `unknown_version`, `not_a_mapem`, `trailing_bytes`,
            `out_of_range` or `too_long`.
    """
    return _moved(MAP_DATA.decode(_content(data, MAPEM_ID, "mapem")), -STEP_DEG)


def decode_spat(data: bytes) -> Spat:
    """Read a SPATEM. Raises `DecodeError`: `not_a_spatem`, or as `decode_map`."""
    return SPAT.decode(_content(data, SPATEM_ID, "spatem"))


def _header(message_id: int, station_id: bytes) -> bytes:
    return bytes((PROTOCOL_VERSION, message_id)) + station_id


def _content(data: bytes, message_id: int, name: str) -> bytes:
    if len(data) < _HEADER_BYTES:
        raise DecodeError("too_short", "ends within the header")
    if data[1] != message_id:
        raise DecodeError(f"not_a_{name}", f"message {data[1]}")
    if data[0] not in VERSIONS_READ:
        raise DecodeError("unknown_version", f"{data[0]} instead of {PROTOCOL_VERSION}")
    return data[_HEADER_BYTES:]


def _moved(message: MapData, by_deg: float) -> MapData:
    """Return a MAP with all its longitudes moved."""
    return replace(
        message,
        intersections=_moved_parts(message.intersections, by_deg),
        road_segments=_moved_parts(message.road_segments, by_deg),
    )


def _moved_parts(parts: tuple[PartT, ...] | None, by_deg: float) -> tuple[PartT, ...] | None:
    if parts is None:
        return None
    return tuple(
        replace(
            each,
            ref_point=_moved_longitude(each.ref_point, by_deg),
            lanes=tuple(_moved_lane(lane, by_deg) for lane in each.lanes),
        )
        for each in parts
    )


def _moved_lane(lane: GenericLane, by_deg: float) -> GenericLane:
    nodes = lane.node_list
    if nodes.name != "nodes":
        return lane
    moved = tuple(_moved_node(each, by_deg) for each in nodes.value)
    return replace(lane, node_list=replace(nodes, value=moved))


def _moved_node(node: Node, by_deg: float) -> Node:
    if not isinstance(node.delta.value, LatLon):
        return node
    delta = replace(node.delta, value=_moved_longitude(node.delta.value, by_deg))
    return replace(node, delta=delta)


def _moved_longitude(place: PlaceT, by_deg: float) -> PlaceT:
    longitude_deg = place.longitude_deg
    return place if longitude_deg is None else replace(place, longitude_deg=longitude_deg + by_deg)
