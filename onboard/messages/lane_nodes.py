"""Course of a lane of a MAP message (SAE J2735 NodeListXY), and what is along it.

Field names, ranges and steps are those of SAE J2735 (2016 and 2020 agree here); values are SI.
"""

import math
from dataclasses import dataclass
from enum import Enum
from typing import Annotated

from onboard.messages.bsm_core import HEADING, LATITUDE, LONGITUDE, SPEED
from onboard.messages.fields import (
    Choice,
    Chosen,
    ExtensibleEnumerated,
    Integer,
    Optional,
    Quantity,
    SequenceOf,
)
from onboard.messages.message_frame import REGION, REGIONS, RegionalExtension
from onboard.messages.record import Record

LANE_ID = Integer(0, 255)
"""LaneID; 0 is unknown, 255 reserved."""


class SpeedLimitType(Enum):
    """To whom and when a speed limit applies."""

    UNKNOWN = 0
    MAX_SPEED_IN_SCHOOL_ZONE = 1
    MAX_SPEED_IN_SCHOOL_ZONE_WHEN_CHILDREN_ARE_PRESENT = 2
    MAX_SPEED_IN_CONSTRUCTION_ZONE = 3
    VEHICLE_MIN_SPEED = 4
    VEHICLE_MAX_SPEED = 5
    VEHICLE_NIGHT_MAX_SPEED = 6
    TRUCK_MIN_SPEED = 7
    TRUCK_MAX_SPEED = 8
    TRUCK_NIGHT_MAX_SPEED = 9
    VEHICLES_WITH_TRAILERS_MIN_SPEED = 10
    VEHICLES_WITH_TRAILERS_MAX_SPEED = 11
    VEHICLES_WITH_TRAILERS_NIGHT_MAX_SPEED = 12


class NodeAttribute(Enum):
    """What is at a node of a lane."""

    RESERVED = 0
    STOP_LINE = 1
    ROUNDED_CAP_STYLE_A = 2
    ROUNDED_CAP_STYLE_B = 3
    MERGE_POINT = 4
    DIVERGE_POINT = 5
    DOWNSTREAM_STOP_LINE = 6
    DOWNSTREAM_START_NODE = 7
    CLOSED_TO_TRAFFIC = 8
    SAFE_ISLAND = 9
    CURB_PRESENT_AT_STEP_OFF = 10
    HYDRANT_PRESENT = 11


class SegmentAttribute(Enum):
    """What holds from a node on."""

    RESERVED = 0
    DO_NOT_BLOCK = 1
    WHITE_LINE = 2
    MERGING_LANE_LEFT = 3
    MERGING_LANE_RIGHT = 4
    CURB_ON_LEFT = 5
    CURB_ON_RIGHT = 6
    LOADINGZONE_ON_LEFT = 7
    LOADINGZONE_ON_RIGHT = 8
    TURN_OUT_POINT_ON_LEFT = 9
    TURN_OUT_POINT_ON_RIGHT = 10
    ADJACENT_PARKING_ON_LEFT = 11
    ADJACENT_PARKING_ON_RIGHT = 12
    ADJACENT_BIKE_LANE_ON_LEFT = 13
    ADJACENT_BIKE_LANE_ON_RIGHT = 14
    SHARED_BIKE_LANE = 15
    BIKE_BOX_IN_FRONT = 16
    TRANSIT_STOP_ON_LEFT = 17
    TRANSIT_STOP_ON_RIGHT = 18
    TRANSIT_STOP_IN_LANE = 19
    SHARED_WITH_TRACKED_VEHICLE = 20
    SAFE_ISLAND = 21
    LOW_CURBS_PRESENT = 22
    RUMBLE_STRIP_PRESENT = 23
    AUDIBLE_SIGNALING_PRESENT = 24
    ADAPTIVE_TIMING_PRESENT = 25
    RF_SIGNAL_REQUEST_PRESENT = 26
    PARTIAL_CURB_INTRUSION = 27
    TAPER_TO_LEFT = 28
    TAPER_TO_RIGHT = 29
    TAPER_TO_CENTER_LINE = 30
    PARALLEL_PARKING = 31
    HEAD_IN_PARKING = 32
    FREE_PARKING = 33
    TIME_RESTRICTIONS_ON_PARKING = 34
    COST_TO_PARK = 35
    MID_BLOCK_CURB_PRESENT = 36
    UN_EVEN_PAVEMENT_PRESENT = 37


@dataclass(frozen=True, slots=True)
class RegulatorySpeedLimit:
    """A speed limit."""

    type: Annotated[SpeedLimitType | int, ExtensibleEnumerated(SpeedLimitType)]
    speed_m_s: Annotated[float | None, SPEED]


SPEED_LIMITS = SequenceOf(Record(RegulatorySpeedLimit), 1, 9)


def _angle(lowest: int, highest: int, step_deg: float, unavailable: int | None = None) -> Quantity:
    return Quantity(lowest, highest, math.radians(step_deg), "rad", unavailable)


def _length(bits: int) -> Quantity:
    return Quantity(-(1 << bits - 1), (1 << bits - 1) - 1, 0.01, "m")


LANE_DATA = Choice(
    {
        "path_end_point_angle": _angle(-150, 150, 1.0),
        "lane_crown_point_center": _angle(-127, 127, 0.3, unavailable=-128),
        "lane_crown_point_left": _angle(-127, 127, 0.3, unavailable=-128),
        "lane_crown_point_right": _angle(-127, 127, 0.3, unavailable=-128),
        "lane_angle": _angle(-180, 180, 1.5),
        "speed_limits": SPEED_LIMITS,
        "regional": REGIONS,
    },
    extensible=True,
)


@dataclass(frozen=True, slots=True)
class NodeAttributeSet:
    """What holds at a node, or from it on."""

    local_node: Annotated[
        tuple[NodeAttribute | int, ...] | None,
        Optional(SequenceOf(ExtensibleEnumerated(NodeAttribute), 1, 8)),
    ] = None
    disabled: Annotated[
        tuple[SegmentAttribute | int, ...] | None,
        Optional(SequenceOf(ExtensibleEnumerated(SegmentAttribute), 1, 8)),
    ] = None
    enabled: Annotated[
        tuple[SegmentAttribute | int, ...] | None,
        Optional(SequenceOf(ExtensibleEnumerated(SegmentAttribute), 1, 8)),
    ] = None
    data: Annotated[tuple[Chosen, ...] | None, Optional(SequenceOf(LANE_DATA, 1, 8))] = None
    width_change_m: Annotated[float | None, Optional(_length(10))] = None
    elevation_change_m: Annotated[float | None, Optional(Quantity(-512, 511, 0.1, "m"))] = None
    regions: Annotated[tuple[RegionalExtension, ...] | None, Optional(REGIONS)] = None


def _pair(quantity: Quantity) -> SequenceOf:
    """East and north, or longitude and latitude: two fields without a count."""
    return SequenceOf(quantity, 2, 2)


@dataclass(frozen=True, slots=True)
class LatLon:
    """Node-LLmD-64b: a node's position instead of an offset."""

    longitude_deg: Annotated[float | None, LONGITUDE]
    latitude_deg: Annotated[float | None, LATITUDE]


_OFFSET_BITS = {
    "node_xy1": 10,
    "node_xy2": 11,
    "node_xy3": 12,
    "node_xy4": 13,
    "node_xy5": 14,
    "node_xy6": 16,
}
NODE_OFFSET = Choice(
    {name: _pair(_length(bits)) for name, bits in _OFFSET_BITS.items()}
    | {"node_lat_lon": Record(LatLon), "regional": REGION}
)
"""NodeOffsetPointXY: east and north of the node before, of the reference point for the first."""


def node_offset(east_m: float, north_m: float) -> Chosen:
    """Return the offset in the smallest form that holds it.

    Raises:
        ValueError: it is larger than 327 m.
    """
    for name, bits in _OFFSET_BITS.items():
        reach_m = ((1 << bits - 1) - 1) * 0.01
        if max(abs(east_m), abs(north_m)) <= reach_m:
            return Chosen(name, (east_m, north_m))
    raise ValueError(f"({east_m:g}, {north_m:g}) m is too far for one node")


@dataclass(frozen=True, slots=True)
class Node:
    """NodeXY: a point of a lane's centre line."""

    delta: Annotated[Chosen, NODE_OFFSET]
    attributes: Annotated[
        NodeAttributeSet | None, Optional(Record(NodeAttributeSet, extensible=True))
    ] = None


_OFFSET_OF_LANE = Choice(
    {
        "small": Quantity(-2047, 2047, 0.01, "m"),
        "large": Quantity(-32767, 32767, 0.01, "m"),
    }
)
_SCALE = Optional(Quantity(-2048, 2047, 0.0005, ""))


@dataclass(frozen=True, slots=True)
class ComputedLane:
    """A lane with the course of another one, moved, turned and scaled."""

    reference_lane_id: Annotated[int, LANE_ID]
    offset_x_m: Annotated[Chosen, _OFFSET_OF_LANE]
    offset_y_m: Annotated[Chosen, _OFFSET_OF_LANE]
    rotate_xy_rad: Annotated[float | None, Optional(HEADING)] = None
    scale_x: Annotated[float | None, _SCALE] = None
    """Added to 1."""
    scale_y: Annotated[float | None, _SCALE] = None
    """Added to 1."""
    regions: Annotated[tuple[RegionalExtension, ...] | None, Optional(REGIONS)] = None


NODE_LIST = Choice(
    {
        "nodes": SequenceOf(Record(Node, extensible=True), 2, 63),
        "computed": Record(ComputedLane, extensible=True),
    },
    extensible=True,
)
