"""SAE J2735 MessageFrame, in which every J2735 message is sent."""

from dataclasses import dataclass
from typing import Annotated

from onboard.errors import DecodeError
from onboard.messages.bit_io import BitReader
from onboard.messages.fields import Integer, OpenType, SequenceOf
from onboard.messages.record import Record

MESSAGE_COUNTS = 128
"""Values of a MsgCount, which counts the messages of one type of a sender."""


@dataclass(frozen=True, slots=True)
class MessageFrame:
    """A message, still encoded, with its DSRCmsgID."""

    message_id: Annotated[int, Integer(0, 32767)]
    content: Annotated[bytes, OpenType()]


@dataclass(frozen=True, slots=True)
class RegionalExtension:
    """A regional extension, still encoded."""

    region_id: Annotated[int, Integer(0, 255)]
    content: Annotated[bytes, OpenType()]


NAMES = {
    21: "commonSafetyRequest",
    22: "emergencyVehicleAlert",
    23: "intersectionCollision",
    24: "nmeaCorrections",
    25: "probeDataManagement",
    26: "probeVehicleData",
    27: "roadSideAlert",
    28: "rtcmCorrections",
    29: "signalRequestMessage",
    30: "signalStatusMessage",
    31: "travelerInformation",
    33: "roadSafetyMessage",
}
"""Messages that have no codec here, by DSRCmsgID (SAE J2735, DSRCmsgID)."""

FRAME = Record(MessageFrame, extensible=True)
REGION = Record(RegionalExtension)
REGIONS = SequenceOf(REGION, 1, 4)


def read(frame: bytes) -> MessageFrame:
    """Read a MessageFrame, which says where it ends.

    Some units hand over more than they received: the check sequence of the link layer, and what
    their buffer had before. That is no part of the message.

    Raises:
        DecodeError: `too_short` or `too_long`.
    """
    return FRAME.take(BitReader(frame))


def content_of(frame: bytes, message_id: int, name: str) -> bytes:
    """Return the encoded message in a MessageFrame.

    Args:
        frame: the MessageFrame.
        message_id: the expected DSRCmsgID.
        name: short name of the expected message, for the reason.

    Raises:
        DecodeError: `not_a_<name>` for another message; `too_short` or `too_long`.
    """
    outer = read(frame)
    if outer.message_id != message_id:
        raise DecodeError(f"not_a_{name}", f"message {outer.message_id}")
    return outer.content
