"""Lanes of a MAP message (SAE J2735 GenericLane): use, course, connections.

Field names, ranges and steps are those of SAE J2735 (2016 and 2020 agree here); values are SI.
"""

from dataclasses import dataclass
from enum import IntFlag
from typing import Annotated

from onboard.messages.fields import (
    BitString,
    Choice,
    Chosen,
    Ia5String,
    Integer,
    OpenBitString,
    Optional,
    SequenceOf,
)
from onboard.messages.lane_nodes import LANE_ID, NODE_LIST
from onboard.messages.message_frame import REGION, REGIONS, RegionalExtension
from onboard.messages.record import Record

DESCRIPTIVE_NAME = Ia5String(1, 63)
SIGNAL_GROUP = Integer(0, 255)
UNKNOWN_SIGNAL_GROUP = 0
PERMANENTLY_GREEN = 255
"""SignalGroupIDs of ways whose signal no SPAT message shows."""


class LaneDirection(IntFlag):
    """Directions in which a lane is used; both for a reversible lane or a crosswalk."""

    INGRESS_PATH = 1 << 0
    EGRESS_PATH = 1 << 1


class LaneSharing(IntFlag):
    """Users with an equal right to the lane."""

    OVERLAPPING_LANE_DESCRIPTION_PROVIDED = 1 << 0
    MULTIPLE_LANES_TREATED_AS_ONE_LANE = 1 << 1
    OTHER_NON_MOTORIZED_TRAFFIC_TYPES = 1 << 2
    INDIVIDUAL_MOTORIZED_VEHICLE_TRAFFIC = 1 << 3
    BUS_VEHICLE_TRAFFIC = 1 << 4
    TAXI_VEHICLE_TRAFFIC = 1 << 5
    PEDESTRIANS_TRAFFIC = 1 << 6
    CYCLIST_VEHICLE_TRAFFIC = 1 << 7
    TRACKED_VEHICLE_TRAFFIC = 1 << 8
    PEDESTRIAN_TRAFFIC = 1 << 9


class VehicleLane(IntFlag):
    """LaneAttributes-Vehicle."""

    IS_VEHICLE_REVOCABLE_LANE = 1 << 0
    IS_VEHICLE_FLY_OVER_LANE = 1 << 1
    HOV_LANE_USE_ONLY = 1 << 2
    RESTRICTED_TO_BUS_USE = 1 << 3
    RESTRICTED_TO_TAXI_USE = 1 << 4
    RESTRICTED_FROM_PUBLIC_USE = 1 << 5
    HAS_IR_BEACON_COVERAGE = 1 << 6
    PERMISSION_ON_REQUEST = 1 << 7


class OtherLane(IntFlag):
    """Attributes of a lane that is not for vehicles; the others have no name here."""

    REVOCABLE_LANE = 1 << 0


class AllowedManeuvers(IntFlag):
    """What a lane permits beyond its stop line."""

    STRAIGHT = 1 << 0
    LEFT = 1 << 1
    RIGHT = 1 << 2
    U_TURN = 1 << 3
    LEFT_TURN_ON_RED = 1 << 4
    RIGHT_TURN_ON_RED = 1 << 5
    LANE_CHANGE = 1 << 6
    NO_STOPPING = 1 << 7
    YIELD_ALLWAYS_REQUIRED = 1 << 8
    GO_WITH_HALT = 1 << 9
    CAUTION = 1 << 10
    RESERVED = 1 << 11


_OTHER_LANE = BitString(OtherLane, 16)


@dataclass(frozen=True, slots=True)
class LaneAttributes:
    """Who uses the lane, and in which direction."""

    directional_use: Annotated[LaneDirection, BitString(LaneDirection, 2)]
    shared_with: Annotated[LaneSharing, BitString(LaneSharing, 10)]
    lane_type: Annotated[
        Chosen,
        Choice(
            {
                "vehicle": OpenBitString(VehicleLane, 8),
                "crosswalk": _OTHER_LANE,
                "bike_lane": _OTHER_LANE,
                "sidewalk": _OTHER_LANE,
                "median": _OTHER_LANE,
                "striping": _OTHER_LANE,
                "tracked_vehicle": _OTHER_LANE,
                "parking": _OTHER_LANE,
            },
            extensible=True,
        ),
    ]
    region: Annotated[RegionalExtension | None, Optional(REGION)] = None


@dataclass(frozen=True, slots=True)
class IntersectionReferenceId:
    """Name of an intersection: its road authority, and its number there."""

    region: Annotated[int | None, Optional(Integer(0, 65535))]
    id: Annotated[int, Integer(0, 65535)]


INTERSECTION_ID = Record(IntersectionReferenceId)
_MANEUVERS = Optional(BitString(AllowedManeuvers, 12))


@dataclass(frozen=True, slots=True)
class ConnectingLane:
    """The lane into which a connection leads."""

    lane: Annotated[int, LANE_ID]
    maneuver: Annotated[AllowedManeuvers | None, _MANEUVERS] = None


@dataclass(frozen=True, slots=True)
class Connection:
    """A way on from the stop line of a lane."""

    connecting_lane: Annotated[ConnectingLane, Record(ConnectingLane)]
    remote_intersection: Annotated[IntersectionReferenceId | None, Optional(INTERSECTION_ID)] = None
    signal_group: Annotated[int | None, Optional(SIGNAL_GROUP)] = None
    """The movement in the SPAT message that controls it."""
    user_class: Annotated[int | None, Optional(Integer(0, 255))] = None
    connection_id: Annotated[int | None, Optional(Integer(0, 255))] = None


@dataclass(frozen=True, slots=True)
class GenericLane:
    """A lane; its nodes begin at the stop line, whichever its direction."""

    lane_id: Annotated[int, LANE_ID]
    name: Annotated[str | None, Optional(DESCRIPTIVE_NAME)]
    ingress_approach: Annotated[int | None, Optional(Integer(0, 15))]
    egress_approach: Annotated[int | None, Optional(Integer(0, 15))]
    lane_attributes: Annotated[LaneAttributes, Record(LaneAttributes)]
    maneuvers: Annotated[AllowedManeuvers | None, _MANEUVERS]
    node_list: Annotated[Chosen, NODE_LIST]
    """`nodes`, or `computed` from another lane."""
    connects_to: Annotated[
        tuple[Connection, ...] | None, Optional(SequenceOf(Record(Connection), 1, 16))
    ] = None
    overlays: Annotated[tuple[int, ...] | None, Optional(SequenceOf(LANE_ID, 1, 5))] = None
    regions: Annotated[tuple[RegionalExtension, ...] | None, Optional(REGIONS)] = None


LANES = SequenceOf(Record(GenericLane, extensible=True), 1, 255)
