"""The messages of a warning group (LCCA, section 3), each declared once.

Every message says who sends it and where the sender stands in its group, so that each car learns
from whatever it hears how far behind in the group its own radio reaches. Join, Reply and Leave go
one hop, to the car they name. Update and Warn go to everybody behind in the group, over several
hops; `sender_*` is then the car that repeats, and `event` tells copies of one event from another.

On the wire: one byte version, one byte type, then the fields.
"""

from dataclasses import dataclass, replace
from enum import Enum
from typing import Annotated, Any, ClassVar, Self

from onboard.errors import DecodeError
from onboard.messages.fields import FixedPoint, OctetString, OpenEnumerated, Unsigned
from onboard.messages.record import Record

VERSION = 1

CarId = bytes
"""Eight bytes: the digest of a plate, see `onboard/security/plate_digest.py`."""

_CarId = Annotated[CarId, OctetString(8)]
_GroupNumber = Annotated[int, FixedPoint(16, 1, "", lowest=1, highest=65535)]
_Sequence = Annotated[int, Unsigned(16)]
_Speed = Annotated[float | None, FixedPoint(16, 0.01, "m/s", highest=65534, unavailable=65535)]


class LeaveReason(Enum):
    """Why a car leaves the group of the car ahead."""

    GAP = 1
    """The gap has grown to the safety distance."""
    NOT_AHEAD = 2
    """The camera no longer shows that car ahead."""
    FOLLOWS_ANOTHER = 3
    """Another car ahead has been joined."""
    NO_ANSWER = 4
    """The car ahead no longer answers."""
    LEADER_SILENT = 5
    """The car ahead answers, but has no news from its leader."""
    SPEED_UNKNOWN = 6
    """The car behind does not know its own speed, and so no safety distance."""


@dataclass(frozen=True, slots=True)
class Join:
    """`M_join`: let me follow you, or: I still do. Repeated until a `Reply` answers it."""

    kind: ClassVar[str] = "join"
    code: ClassVar[int] = 1
    user_priority: ClassVar[int] = 4
    sender_id: _CarId
    leader_id: _CarId
    number: _GroupNumber
    to_id: _CarId
    sequence: _Sequence
    """Returned by the reply."""
    acknowledged_origin_id: _CarId
    """With `acknowledged_sequence`: a warning that the sender has; all zero for none."""
    acknowledged_sequence: _Sequence

    def without_acknowledgement(self) -> Self:
        """The same, as if the sender had no warning."""
        return replace(self, acknowledged_origin_id=bytes(8), acknowledged_sequence=0)


@dataclass(frozen=True, slots=True)
class Reply:
    """`M_reply`: you follow me; my leader and number are these."""

    kind: ClassVar[str] = "reply"
    code: ClassVar[int] = 2
    user_priority: ClassVar[int] = 4
    sender_id: _CarId
    leader_id: _CarId
    number: _GroupNumber
    to_id: _CarId
    sequence: _Sequence
    """Of the join that this answers."""
    leader_sequence: Annotated[int, Unsigned(16)]
    """The leader's count of its replies, as far as it has come down to the sender."""
    speed_m_s: _Speed
    """The sender's own, to be compared with what the camera behind it sees."""


@dataclass(frozen=True, slots=True)
class Leave:
    """`M_leave`: I no longer follow you."""

    kind: ClassVar[str] = "leave"
    code: ClassVar[int] = 3
    user_priority: ClassVar[int] = 4
    sender_id: _CarId
    leader_id: _CarId
    number: _GroupNumber
    to_id: _CarId
    reason: Annotated[LeaveReason | int, OpenEnumerated(LeaveReason, 8)]


@dataclass(frozen=True, slots=True)
class Update:
    """`M_update`: whoever was in that group behind me is now in this one, renumbered."""

    kind: ClassVar[str] = "update"
    code: ClassVar[int] = 4
    user_priority: ClassVar[int] = 6
    sender_id: _CarId
    leader_id: _CarId
    number: _GroupNumber
    event_origin_id: _CarId
    event_sequence: _Sequence
    reach: Annotated[int, Unsigned(16)]
    """How many cars behind the sender the car drives that is to repeat this; 0: unknown."""
    previous_leader_id: _CarId
    shift: Annotated[int, FixedPoint(16, 1, "cars", lowest=-32767, highest=32767)]
    """Previous number less present number, the same for everybody."""
    leader_sequence: Annotated[int, Unsigned(16)]


@dataclass(frozen=True, slots=True)
class Warn:
    """`M_warn`: a car ahead of you in your group brakes hard."""

    kind: ClassVar[str] = "warn"
    code: ClassVar[int] = 5
    user_priority: ClassVar[int] = 7
    sender_id: _CarId
    leader_id: _CarId
    number: _GroupNumber
    event_origin_id: _CarId
    event_sequence: _Sequence
    reach: Annotated[int, Unsigned(16)]
    """As in `Update`."""
    origin_number: _GroupNumber
    """Of the braking car, as the sender of this copy would count it now."""
    deceleration_m_s2: Annotated[float, FixedPoint(8, 0.1, "m/s^2", highest=255)]
    age_s: Annotated[float, FixedPoint(16, 0.001, "s", highest=65535)]
    """From the sample that showed the braking to the sending of this copy."""
    hops: Annotated[int, Unsigned(8)]
    """1 in the copy that the braking car sends."""


LccaMessage = Join | Reply | Leave | Update | Warn

MESSAGES: dict[int, Record[Any]] = {
    message.code: Record(message) for message in (Join, Reply, Leave, Update, Warn)
}
"""By type byte."""


def encode(message: LccaMessage) -> bytes:
    """Return the message as it is sent.

    Raises:
        ValueError: a field holds what it cannot carry.
    """
    return bytes((VERSION, message.code)) + MESSAGES[message.code].encode(message)


def decode(data: bytes) -> LccaMessage:
    """Read a message from the air.

    Raises:
        DecodeError: `too_short`, `trailing_bytes`, `out_of_range`, `unknown_version` or
            `unknown_type`.
    """
    if len(data) < 2:
        raise DecodeError("too_short", f"{len(data)} bytes are no message")
    version, code = data[0], data[1]
    if version != VERSION:
        raise DecodeError("unknown_version", f"{version} instead of {VERSION}")
    if code not in MESSAGES:
        raise DecodeError("unknown_type", f"{code}")
    message: LccaMessage = MESSAGES[code].decode(data[2:])
    return message


def as_dict(message: LccaMessage) -> dict[str, Any]:
    """Return the message as it stands in a trace line."""
    return MESSAGES[message.code].as_dict(message)
