"""SAE J2735 PersonalSafetyMessage in a MessageFrame: a pedestrian or cyclist with a radio.

Position and motion are read. What follows (path, propulsion, cluster, activity) is kept encoded.
"""

from dataclasses import dataclass
from enum import Enum
from typing import Annotated, Any, ClassVar

from onboard.messages.bsm_core import HEADING, POSITIONAL_ACCURACY, SPEED, PositionalAccuracy
from onboard.messages.fields import (
    Boolean,
    ExtensibleEnumerated,
    Integer,
    OctetString,
    Quantity,
    RestOfMessage,
    Unsigned,
)
from onboard.messages.map_data import POSITION_3D, ReferencePoint
from onboard.messages.message_frame import FRAME, MessageFrame, content_of
from onboard.messages.record import Record

MESSAGE_ID = 32
"""DSRCmsgID of personalSafetyMessage."""


class PersonalDeviceUser(Enum):
    """Who carries the device."""

    UNAVAILABLE = 0
    PEDESTRIAN = 1
    PEDAL_CYCLIST = 2
    PUBLIC_SAFETY_WORKER = 3
    ANIMAL = 4


@dataclass(frozen=True, slots=True)
class PersonalSafetyMessage:
    """A personal safety message."""

    kind: ClassVar[str] = "psm"

    has_additions: Annotated[bool, Boolean()]
    present: Annotated[int, Unsigned(18)]
    """Which of the optional fields follow."""
    basic_type: Annotated[PersonalDeviceUser | int, ExtensibleEnumerated(PersonalDeviceUser)]
    sec_mark_s: Annotated[float | None, Quantity(0, 65534, 0.001, "s", unavailable=65535)]
    """Time of the position, within the minute of UTC."""
    msg_cnt: Annotated[int, Integer(0, 127)]
    temporary_id: Annotated[bytes, OctetString(4)]
    position: Annotated[ReferencePoint, POSITION_3D]
    accuracy: Annotated[PositionalAccuracy, POSITIONAL_ACCURACY]
    speed_m_s: Annotated[float | None, SPEED]
    heading_rad: Annotated[float | None, HEADING]
    """Clockwise from true north."""
    rest: Annotated[tuple[int, int], RestOfMessage()] = 0, 0


PSM = Record(PersonalSafetyMessage)


def encode(message: PersonalSafetyMessage) -> bytes:
    """Return the MessageFrame. Raises `ValueError`, naming the field."""
    return FRAME.encode(MessageFrame(MESSAGE_ID, PSM.encode(message)))


def decode(frame: bytes) -> PersonalSafetyMessage:
    """Read a MessageFrame.

    Raises:
        DecodeError: `not_a_psm`, `too_short`, `out_of_range` or `too_long`.
    """
    return PSM.decode(content_of(frame, MESSAGE_ID, "psm"))


def as_dict(message: PersonalSafetyMessage) -> dict[str, Any]:
    """Return the message as it stands in a trace line."""
    return PSM.as_dict(message)
