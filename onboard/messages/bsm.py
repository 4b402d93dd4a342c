"""SAE J2735 BasicSafetyMessage in a MessageFrame, the payload of WSMs under PSID 0x20.

The MVS footer is a regional extension with a RegionId for local use: other units decode the BSM and
skip it.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

from onboard.errors import DecodeError
from onboard.messages.bsm_core import CORE, CoreData
from onboard.messages.bsm_safety import SAFETY, VehicleSafetyExtensions
from onboard.messages.fields import Integer, OpenType, Optional, SequenceOf
from onboard.messages.message_frame import (
    FRAME,
    REGION,
    REGIONS,
    MessageFrame,
    RegionalExtension,
    content_of,
)
from onboard.messages.record import Record

MESSAGE_ID = 20
"""DSRCmsgID of basicSafetyMessage."""

FOOTER_REGION = 0x80 + 0x4D
"""RegionId of the MVS footer, an own choice (128 + "M") among those for local use (from 128)."""

MAX_FOOTER_BYTES = 800
"""Space in a WSM of 1,400 bytes beside a full path history and an attached certificate."""

_SAFETY_PART = 0


@dataclass(frozen=True, slots=True)
class OtherPart:
    """A Part II element other than the safety extensions, still encoded."""

    part_id: Annotated[int, Integer(0, 63)]
    """1: special vehicle extensions, 2: supplemental vehicle extensions."""
    content: Annotated[bytes, OpenType()]


_PART = Record(OtherPart)


@dataclass(frozen=True, slots=True)
class BasicSafetyMessage:
    """A basic safety message."""

    kind: ClassVar[str] = "bsm"
    core: CoreData
    safety: VehicleSafetyExtensions | None = None
    other_parts: tuple[OtherPart, ...] = ()
    footer: bytes | None = None
    """The MVS footer, encoded as in `onboard/messages/mvs_footer.py`."""
    other_regions: tuple[RegionalExtension, ...] = ()

    @property
    def user_priority(self) -> int:
        """User priority: 7 with an event flag, else 5 (SAE J2945/1)."""
        return 7 if self.safety is not None and self.safety.events else 5


@dataclass(frozen=True, slots=True)
class _Message:
    """BasicSafetyMessage as declared in the standard."""

    core: Annotated[CoreData, CORE]
    parts: Annotated[tuple[OtherPart, ...] | None, Optional(SequenceOf(_PART, 1, 8))]
    regions: Annotated[tuple[RegionalExtension, ...] | None, Optional(REGIONS)]


_MESSAGE = Record(_Message, extensible=True)

_PRESENCE_BITS, _COUNT_BITS, _PART_ID_BITS = 3, 3, 6
_PART_ID_ENDS = _PRESENCE_BITS + CORE.fixed_bits + _COUNT_BITS + _PART_ID_BITS
_HEAD_BYTES = -(-(_PART_ID_ENDS + 16 + 2) // 8)
"""Up to the presence of event flags, behind a length of two bytes."""
_HEAD_BITS = 8 * _HEAD_BYTES


def encode(bsm: BasicSafetyMessage) -> bytes:
    """Return the MessageFrame.

    Raises:
        ValueError: a field cannot carry its value (the text names it), or the footer is longer than
            `MAX_FOOTER_BYTES`.
    """
    if bsm.footer is not None and len(bsm.footer) > MAX_FOOTER_BYTES:
        raise ValueError(f"footer: {len(bsm.footer)} bytes, at most {MAX_FOOTER_BYTES} fit")
    parts, regions = bsm.other_parts, bsm.other_regions
    if bsm.safety is not None:
        parts = (OtherPart(_SAFETY_PART, SAFETY.encode(bsm.safety)), *parts)
    if bsm.footer is not None:
        regions = (RegionalExtension(FOOTER_REGION, bsm.footer), *regions)
    message = _Message(bsm.core, parts or None, regions or None)
    return FRAME.encode(MessageFrame(MESSAGE_ID, _MESSAGE.encode(message)))


def decode(frame: bytes) -> BasicSafetyMessage:
    """Read a MessageFrame.

    Raises:
        DecodeError: `not_a_bsm`, `too_short`, `trailing_bytes`, `out_of_range`, `too_long`, or
            `repeated` for a second element of a kind that a BSM has once.
    """
    message = _MESSAGE.decode(content_of(frame, MESSAGE_ID, "bsm"))
    parts, regions = message.parts or (), message.regions or ()
    safety = _only((part.content for part in parts if part.part_id == _SAFETY_PART), "safety")
    footer = _only((r.content for r in regions if r.region_id == FOOTER_REGION), "footer")
    if footer is not None and len(footer) > MAX_FOOTER_BYTES:
        raise DecodeError("too_long", f"a footer of {len(footer)} bytes")
    return BasicSafetyMessage(
        core=message.core,
        safety=None if safety is None else SAFETY.decode(safety),
        other_parts=tuple(part for part in parts if part.part_id != _SAFETY_PART),
        footer=footer,
        other_regions=tuple(r for r in regions if r.region_id != FOOTER_REGION),
    )


def temporary_id_in(frame: bytes) -> bytes | None:
    """Return the sender's temporary ID, at a tenth of the cost of `decode`; `None` if not a BSM.

    Nothing else is checked. The ID follows three presence bits and the seven bits of `msgCnt`.
    """
    octets_of_length = 2 if frame[2:3] >= b"\x80" else 1
    start = frame[2 + octets_of_length : 8 + octets_of_length]
    if frame[:2] != MESSAGE_ID.to_bytes(2) or len(start) < 6:
        return None
    return (int.from_bytes(start) >> 6 & 0xFFFF_FFFF).to_bytes(4)


def may_tell_event(frame: bytes) -> bool:
    """Return whether a BSM may carry event flags, at a tenth of the cost of `decode`.

    Part II follows the core, and the safety extensions come first in it. What does not look like
    that may carry flags anywhere.
    """
    start = 4 if frame[2:3] >= b"\x80" else 3
    head = int.from_bytes(frame[start : start + _HEAD_BYTES].ljust(_HEAD_BYTES, b"\xff"))
    if frame[:2] != MESSAGE_ID.to_bytes(2) or head >> _HEAD_BITS - 1:
        return True
    if not head >> _HEAD_BITS - 2 & 1:
        return False
    part_id = head >> _HEAD_BITS - _PART_ID_ENDS & 0x3F
    length_bits = 16 if head >> _HEAD_BITS - _PART_ID_ENDS - 1 & 1 else 8
    extension_and_events = head >> _HEAD_BITS - _PART_ID_ENDS - length_bits - 2 & 0b11
    return part_id != _SAFETY_PART or extension_and_events != 0


def as_dict(bsm: BasicSafetyMessage) -> dict[str, Any]:
    """Return the message as it stands in a trace line."""
    return {
        "core": CORE.as_dict(bsm.core),
        "safety": None if bsm.safety is None else SAFETY.as_dict(bsm.safety),
        "other_parts": [_PART.as_dict(part) for part in bsm.other_parts],
        "footer": None if bsm.footer is None else bsm.footer.hex(),
        "other_regions": [REGION.as_dict(region) for region in bsm.other_regions],
    }


def _only(found: Iterable[bytes], what: str) -> bytes | None:
    contents = list(found)
    if len(contents) > 1:
        raise DecodeError("repeated", f"{len(contents)} times {what}")
    return contents[0] if contents else None
