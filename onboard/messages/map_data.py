"""SAE J2735 MapData (MAP): lanes of intersections, sent by a road-side unit under PSID 0x204097.

Field names, ranges and steps are those of SAE J2735 (2016 and 2020 agree here); values are SI.
"""

from dataclasses import dataclass
from enum import Enum
from typing import Annotated, Any, ClassVar

from onboard.messages.bsm_core import ELEVATION, LATITUDE, LONGITUDE
from onboard.messages.fields import (
    Choice,
    Chosen,
    ExtensibleEnumerated,
    Ia5String,
    Integer,
    Optional,
    Quantity,
    SequenceOf,
)
from onboard.messages.lane_nodes import SPEED_LIMITS, RegulatorySpeedLimit
from onboard.messages.lanes import (
    DESCRIPTIVE_NAME,
    INTERSECTION_ID,
    LANES,
    GenericLane,
    IntersectionReferenceId,
)
from onboard.messages.message_frame import (
    FRAME,
    REGION,
    REGIONS,
    MessageFrame,
    RegionalExtension,
    content_of,
)
from onboard.messages.record import Record

MESSAGE_ID = 18
"""DSRCmsgID of mapData."""

MINUTE_OF_THE_YEAR = Optional(Quantity(0, 527_039, 60.0, "s", unavailable=527_040))
"""MinuteOfTheYear: since the beginning of the year in UTC."""


class LayerType(Enum):
    """Content of a MAP message."""

    NONE = 0
    MIXED_CONTENT = 1
    GENERAL_MAP_DATA = 2
    INTERSECTION_DATA = 3
    CURVE_DATA = 4
    ROADWAY_SECTION_DATA = 5
    PARKING_AREA_DATA = 6
    SHARED_LANE_DATA = 7


class RestrictionAppliesTo(Enum):
    """Users of a restriction class."""

    NONE = 0
    EQUIPPED_TRANSIT = 1
    EQUIPPED_TAXIS = 2
    EQUIPPED_OTHER = 3
    EMISSION_COMPLIANT = 4
    EQUIPPED_BICYCLE = 5
    WEIGHT_COMPLIANT = 6
    HEIGHT_COMPLIANT = 7
    PEDESTRIANS = 8
    SLOW_MOVING_PERSONS = 9
    WHEELCHAIR_USERS = 10
    VISUAL_DISABILITIES = 11
    AUDIO_DISABILITIES = 12
    OTHER_UNKNOWN_DISABILITIES = 13


@dataclass(frozen=True, slots=True)
class ReferencePoint:
    """Position3D: the point from which the nodes are measured."""

    latitude_deg: Annotated[float | None, LATITUDE]
    longitude_deg: Annotated[float | None, LONGITUDE]
    elevation_m: Annotated[float | None, Optional(ELEVATION)] = None
    """Above the WGS 84 ellipsoid."""
    regions: Annotated[tuple[RegionalExtension, ...] | None, Optional(REGIONS)] = None


POSITION_3D = Record(ReferencePoint, extensible=True)
_LANE_WIDTH = Optional(Quantity(0, 32767, 0.01, "m"))
_REVISION = Integer(0, 127)


@dataclass(frozen=True, slots=True)
class SignalControlZone:
    """A zone in which signal priority may be asked for."""

    zone: Annotated[RegionalExtension, REGION]


@dataclass(frozen=True, slots=True)
class IntersectionGeometry:
    """One intersection."""

    name: Annotated[str | None, Optional(DESCRIPTIVE_NAME)]
    id: Annotated[IntersectionReferenceId, INTERSECTION_ID]
    revision: Annotated[int, _REVISION]
    """Changes with the content; the SPAT message refers to it."""
    ref_point: Annotated[ReferencePoint, POSITION_3D]
    lane_width_m: Annotated[float | None, _LANE_WIDTH]
    speed_limits: Annotated[tuple[RegulatorySpeedLimit, ...] | None, Optional(SPEED_LIMITS)]
    lanes: Annotated[tuple[GenericLane, ...], LANES]
    preempt_priority_data: Annotated[
        tuple[SignalControlZone, ...] | None,
        Optional(SequenceOf(Record(SignalControlZone, extensible=True), 1, 32)),
    ] = None
    regions: Annotated[tuple[RegionalExtension, ...] | None, Optional(REGIONS)] = None


@dataclass(frozen=True, slots=True)
class RoadSegment:
    """Lanes between intersections."""

    name: Annotated[str | None, Optional(DESCRIPTIVE_NAME)]
    id: Annotated[IntersectionReferenceId, INTERSECTION_ID]
    revision: Annotated[int, _REVISION]
    ref_point: Annotated[ReferencePoint, POSITION_3D]
    lane_width_m: Annotated[float | None, _LANE_WIDTH]
    speed_limits: Annotated[tuple[RegulatorySpeedLimit, ...] | None, Optional(SPEED_LIMITS)]
    lanes: Annotated[tuple[GenericLane, ...], LANES]
    regions: Annotated[tuple[RegionalExtension, ...] | None, Optional(REGIONS)] = None


_TEXT = Optional(Ia5String(1, 255))


@dataclass(frozen=True, slots=True)
class DataParameters:
    """Where the data come from."""

    process_method: Annotated[str | None, _TEXT] = None
    process_agency: Annotated[str | None, _TEXT] = None
    last_checked_date: Annotated[str | None, _TEXT] = None
    geoid_used: Annotated[str | None, _TEXT] = None


_USER = Choice(
    {"basic_type": ExtensibleEnumerated(RestrictionAppliesTo), "regional": REGIONS},
    extensible=True,
)


@dataclass(frozen=True, slots=True)
class RestrictionClassAssignment:
    """Users to whom a restriction class applies."""

    id: Annotated[int, Integer(0, 255)]
    users: Annotated[tuple[Chosen, ...], SequenceOf(_USER, 1, 16)]


@dataclass(frozen=True, slots=True)
class MapData:
    """A MAP message."""

    kind: ClassVar[str] = "map"
    time_stamp_s: Annotated[float | None, MINUTE_OF_THE_YEAR] = None
    msg_issue_revision: Annotated[int, _REVISION] = 0
    layer_type: Annotated[LayerType | int | None, Optional(ExtensibleEnumerated(LayerType))] = None
    layer_id: Annotated[int | None, Optional(Integer(0, 100))] = None
    intersections: Annotated[
        tuple[IntersectionGeometry, ...] | None,
        Optional(SequenceOf(Record(IntersectionGeometry, extensible=True), 1, 32)),
    ] = None
    road_segments: Annotated[
        tuple[RoadSegment, ...] | None,
        Optional(SequenceOf(Record(RoadSegment, extensible=True), 1, 32)),
    ] = None
    data_parameters: Annotated[
        DataParameters | None, Optional(Record(DataParameters, extensible=True))
    ] = None
    restrictions: Annotated[
        tuple[RestrictionClassAssignment, ...] | None,
        Optional(SequenceOf(Record(RestrictionClassAssignment), 1, 254)),
    ] = None
    regions: Annotated[tuple[RegionalExtension, ...] | None, Optional(REGIONS)] = None


MAP_DATA = Record(MapData, extensible=True)


def encode(message: MapData) -> bytes:
    """Return the MessageFrame. Raises `ValueError`, naming the field."""
    return FRAME.encode(MessageFrame(MESSAGE_ID, MAP_DATA.encode(message)))


def decode(frame: bytes) -> MapData:
    """Read a MessageFrame.

    Raises:
        DecodeError: `not_a_map`, `too_short`, `trailing_bytes`, `out_of_range` or `too_long`.
    """
    return MAP_DATA.decode(content_of(frame, MESSAGE_ID, "map"))


def as_dict(message: MapData) -> dict[str, Any]:
    """Return the message as it stands in a trace line."""
    return MAP_DATA.as_dict(message)
