"""VRU awareness message: a pedestrian or cyclist with a radio (TS 103 300-3 V2.1.1).

Position and motion are read. What follows the motion (lane, profile, cluster, predicted path) is
kept encoded. A VAM without motion, such as that of a cluster's member, is refused.
"""

from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

from onboard.errors import DecodeError
from onboard.messages.cam import Acceleration, BasicContainer
from onboard.messages.fields import Boolean, OctetString, Quantity, RestOfMessage, Unsigned
from onboard.messages.its_common import (
    PROTOCOL_VERSION,
    ReportedHeading,
    ReportedSpeed,
    check_header,
)
from onboard.messages.record import Record

MESSAGE_ID = 16
"""Of VAMs in the ItsPduHeader."""


@dataclass(frozen=True, slots=True)
class VruMotion:
    """The high frequency container, up to its first optional field."""

    has_additions: Annotated[bool, Boolean()]
    present: Annotated[int, Unsigned(11)]
    """Which of its optional fields follow."""
    heading: Annotated[ReportedHeading, Record(ReportedHeading)]
    speed: Annotated[ReportedSpeed, Record(ReportedSpeed)]
    acceleration: Annotated[Acceleration, Record(Acceleration)]
    """Forward."""


@dataclass(frozen=True, slots=True)
class VruParameters:
    """The containers."""

    has_additions: Annotated[bool, Boolean()]
    present: Annotated[int, Unsigned(5)]
    """Which of the containers follow the first; the motion's is the highest bit."""
    basic: Annotated[BasicContainer, Record(BasicContainer, extensible=True)]
    """Its position is that of the person."""
    motion: Annotated[VruMotion, Record(VruMotion)]
    rest: Annotated[tuple[int, int], RestOfMessage()] = 0, 0


MOTION_PRESENT = 0x10


@dataclass(frozen=True, slots=True)
class Vam:
    """A VRU awareness message."""

    kind: ClassVar[str] = "vam"

    station_id: Annotated[bytes, OctetString(4)]
    generation_delta_time_s: Annotated[float, Quantity(0, 65_535, 0.001, "s")]
    """As of a CAM."""
    parameters: Annotated[VruParameters, Record(VruParameters)]


VAM = Record(Vam)
_HEAD = bytes((PROTOCOL_VERSION, MESSAGE_ID))
_PRESENT_AT, _PRESENT_BIT = 8, 0x40
"""Octet and bit that say whether there is the motion."""


def encode(message: Vam) -> bytes:
    """Return the message. Raises `ValueError`, naming the field that cannot carry its value."""
    return _HEAD + VAM.encode(message)


def decode(data: bytes) -> Vam:
    """Read a VAM.

    Raises:
        DecodeError: `too_short`, `unknown_version`, `not_a_vam`, `no_motion` or `out_of_range`.
    """
    check_header(data, MESSAGE_ID, "vam")
    if len(data) > _PRESENT_AT and not data[_PRESENT_AT] & _PRESENT_BIT:
        raise DecodeError("no_motion", "without the high frequency container")
    return VAM.decode(data[len(_HEAD) :])


def as_dict(message: Vam) -> dict[str, Any]:
    """Return the message as it stands in a trace line."""
    return VAM.as_dict(message)
