"""Collective perception message: what its sender perceives (TS 103 324 V2.1.1).

Of its containers, those of the sender and of the objects are read. What the sensors are and see is
skipped. What MVS adds stands behind the objects, as an addition that others skip.
"""

from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

from onboard.errors import DecodeError
from onboard.messages.bit_io import BitReader, BitWriter
from onboard.messages.cpm_evidence import EVIDENCE, VERSION, CpmEvidence
from onboard.messages.cpm_object import MAX_OBJECTS, CpmObject
from onboard.messages.fields import (
    Addition,
    Integer,
    OctetString,
    OpenType,
    Optional,
    SequenceOf,
    Unsigned,
)
from onboard.messages.its_common import (
    ANGLE_CONFIDENCE,
    HEADING,
    POSITION,
    PROTOCOL_VERSION,
    ReferencePosition,
    check_header,
)
from onboard.messages.record import Record

MESSAGE_ID = 14
"""Of CPMs in the ItsPduHeader."""
EVIDENCE_PLACE = 15
"""Of what MVS adds among the additions of the object container: behind those that the next editions
of the standard may define."""
_VEHICLE, _ROAD_SIDE_UNIT, _OBJECTS = 1, 2, 5
"""Numbers of the containers that are read."""


@dataclass(frozen=True, slots=True)
class Orientation:
    """Direction of the sender's front, clockwise from true north."""

    heading_rad: Annotated[float | None, HEADING] = None
    confidence_rad: Annotated[float | None, ANGLE_CONFIDENCE] = None


@dataclass(frozen=True, slots=True)
class PerceivedObjectContainer:
    """The objects."""

    number_of_objects: Annotated[int, Unsigned(8)]
    """That the sender perceives, here or in other messages."""
    objects: Annotated[
        tuple[CpmObject, ...],
        SequenceOf(Record(CpmObject, extensible=True), 0, MAX_OBJECTS, extensible=True),
    ]
    evidence: Annotated[CpmEvidence | None, Addition(EVIDENCE, EVIDENCE_PLACE)] = None


@dataclass(frozen=True, slots=True)
class _Segment:
    messages: Annotated[int, Integer(1, 8)]
    this: Annotated[int, Integer(1, 8)]


@dataclass(frozen=True, slots=True)
class _Rate:
    mantissa: Annotated[int, Integer(1, 100)]
    exponent: Annotated[int, Integer(-5, 2)]


@dataclass(frozen=True, slots=True)
class _RateRange:
    lowest: Annotated[_Rate, Record(_Rate)]
    highest: Annotated[_Rate, Record(_Rate)]


@dataclass(frozen=True, slots=True)
class ManagementContainer:
    """When and where."""

    reference_time_ms: Annotated[int, Unsigned(42)]
    """TimestampIts: TAI since 2004."""
    position: Annotated[ReferencePosition, POSITION]
    """To which those of the objects are relative."""
    segment: Annotated[_Segment | None, Optional(Record(_Segment))] = None
    rate_range: Annotated[_RateRange | None, Optional(Record(_RateRange))] = None


@dataclass(frozen=True, slots=True)
class WrappedContainer:
    """A container, still encoded."""

    number: Annotated[int, Integer(1, 16)]
    content: Annotated[bytes, OpenType()]


@dataclass(frozen=True, slots=True)
class _Payload:
    management: Annotated[ManagementContainer, Record(ManagementContainer, extensible=True)]
    containers: Annotated[
        tuple[WrappedContainer, ...], SequenceOf(Record(WrappedContainer), 1, 8, extensible=True)
    ]


@dataclass(frozen=True, slots=True)
class _Cpm:
    station_id: Annotated[bytes, OctetString(4)]
    payload: Annotated[_Payload, Record(_Payload, extensible=True)]


@dataclass(frozen=True, slots=True)
class CollectivePerceptionMessage:
    """A collective perception message."""

    kind: ClassVar[str] = "cpm"
    user_priority: ClassVar[int] = 3
    """DCC profile DP2, as that of CAMs."""

    station_id: bytes
    """The temporary ID of the sender's CAMs."""
    management: ManagementContainer
    orientation: Orientation | None
    """Of a vehicle; `None` for other senders."""
    is_road_side_unit: bool
    perceived: PerceivedObjectContainer


CPM = Record(_Cpm)
OBJECTS = Record(PerceivedObjectContainer, extensible=True)
_ORIENTATION = Record(Orientation)
_PREAMBLE_BITS = 4
"""Before it in the container of a vehicle: of additions, pitch, roll and trailers, all optional."""
_HEAD = bytes((PROTOCOL_VERSION, MESSAGE_ID))
_UNIT_WITHOUT_MAP = bytes(1)
"""OriginatingRsuContainer that names no MAPEM."""


def encode(message: CollectivePerceptionMessage) -> bytes:
    """Return the message. Raises `ValueError`, naming the field that cannot carry its value."""
    containers = []
    if message.orientation is not None:
        containers.append(WrappedContainer(_VEHICLE, _encode_orientation(message.orientation)))
    if message.is_road_side_unit:
        containers.append(WrappedContainer(_ROAD_SIDE_UNIT, _UNIT_WITHOUT_MAP))
    containers.append(WrappedContainer(_OBJECTS, OBJECTS.encode(message.perceived)))
    payload = _Payload(message.management, tuple(containers))
    return _HEAD + CPM.encode(_Cpm(message.station_id, payload))


def decode(data: bytes) -> CollectivePerceptionMessage:
    """Read a CPM; one without objects has an empty container of them.

    Raises:
        DecodeError: `too_short`, `unknown_version`, `not_a_cpm`, `trailing_bytes`, `out_of_range`,
            `too_long`, `unknown_object_data`, or `contradictory_containers` for several of objects,
            those of a vehicle and of a road-side unit, more objects than there are, and evidence
            that is not of these objects.
    """
    check_header(data, MESSAGE_ID, "cpm")
    message = CPM.decode(data[len(_HEAD) :])
    contents = {each.number: each.content for each in message.payload.containers}
    numbers = [each.number for each in message.payload.containers]
    if len(contents) < len(numbers) or {_VEHICLE, _ROAD_SIDE_UNIT} <= set(numbers):
        raise DecodeError("contradictory_containers", f"numbers {numbers}")
    perceived = PerceivedObjectContainer(0, ())
    if _OBJECTS in contents:
        perceived = OBJECTS.decode(contents[_OBJECTS])
        _check(perceived)
    return CollectivePerceptionMessage(
        message.station_id,
        message.payload.management,
        _orientation_in(contents[_VEHICLE]) if _VEHICLE in contents else None,
        _ROAD_SIDE_UNIT in contents,
        perceived,
    )


def _encode_orientation(orientation: Orientation) -> bytes:
    writer = BitWriter()
    writer.put(0, _PREAMBLE_BITS)
    _ORIENTATION.put(writer, orientation)
    return writer.finish()


def _orientation_in(container: bytes) -> Orientation:
    """Return the orientation; what may follow it is not read."""
    reader = BitReader(container)
    reader.take(_PREAMBLE_BITS)
    return _ORIENTATION.take(reader)


def _check(perceived: PerceivedObjectContainer) -> None:
    listed, evidence = len(perceived.objects), perceived.evidence
    if perceived.number_of_objects < listed:
        count = perceived.number_of_objects
        raise DecodeError("contradictory_containers", f"{listed} of {count} objects")
    if evidence is None:
        return
    if evidence.version != VERSION:
        raise DecodeError("unknown_version", f"{evidence.version} of the evidence")
    if len(evidence.pieces) != listed:
        detail = f"{len(evidence.pieces)} pieces of evidence, {listed} objects"
        raise DecodeError("contradictory_containers", detail)


def as_dict(message: CollectivePerceptionMessage) -> dict[str, Any]:
    """Return the message as it stands in a trace line."""
    return {
        "station_id": message.station_id.hex(),
        "management": Record(ManagementContainer).as_dict(message.management),
        "orientation": None
        if message.orientation is None
        else _ORIENTATION.as_dict(message.orientation),
        "is_road_side_unit": message.is_road_side_unit,
        "perceived": OBJECTS.as_dict(message.perceived),
    }
