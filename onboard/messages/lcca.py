"""The messages of a warning group (LCCA, section 3), each declared once.

Inquiry and Answer precede the group: they find out which car is the lead. Every other message has
its sender, leader and group number: each car computes from all received messages how far behind in
the group its radio reaches. Join, Reply and Leave go one hop, to the car they name, and Update to
those that follow its sender. Warn goes to all cars behind in the group, over several hops;
`sender_id` is then the car that forwards, and `event_*` identifies the event of which it is a copy.

On the wire: one byte version, one byte type, the proof of the sender's ID, then the fields; after
those of a repeated Warn, what the braking car signed.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from enum import Enum
from typing import Annotated, Any, ClassVar, Self, get_args

from onboard.errors import DecodeError
from onboard.messages.fields import FixedPoint, OctetString, OpenEnumerated, SequenceOf, Unsigned
from onboard.messages.record import Record

VERSION = 4

SIBLING_BYTES, MAX_PROOF = 12, 16
"""Size and greatest number of the siblings in a proof (`onboard/security/id_commitment.py`)."""

CarId = bytes
"""Communication ID, eight bytes: see `onboard/security/plate_digest.py`."""

NO_ID: CarId = bytes(8)
"""In place of a communication ID: none."""

NAME_BYTES = 4
"""Size of a name in an inquiry. Of 200 cars in range, none bears one of 16 random names in more
than one of a million inquiries."""
MAX_NAMES = 16
"""Names in an inquiry."""

_CarId = Annotated[CarId, OctetString(8)]
_GroupNumber = Annotated[int, FixedPoint(16, 1, "", lowest=1, highest=65535)]
_Sequence = Annotated[int, Unsigned(16)]
_Speed = Annotated[float | None, FixedPoint(16, 0.01, "m/s", highest=65534, unavailable=65535)]


class LeaveReason(Enum):
    """Why a car leaves its predecessor's group."""

    GAP = 1
    """The gap is larger than the safety distance."""
    NOT_AHEAD = 2
    """The camera no longer shows the predecessor as the lead."""
    FOLLOWS_ANOTHER = 3
    """Another lead has been joined."""
    NO_ANSWER = 4
    """The predecessor no longer answers."""
    LEADER_SILENT = 5
    """The predecessor answers, but no longer receives its leader's sequence numbers."""
    SPEED_UNKNOWN = 6
    """The follower has no speed, and so no safety distance."""


@dataclass(frozen=True, slots=True)
class Join:
    """`M_join`: request to follow, or refresh of it; repeated until a `Reply` answers."""

    kind: ClassVar[str] = "join"
    code: ClassVar[int] = 1
    user_priority: ClassVar[int] = 4
    sender_id: _CarId
    leader_id: _CarId
    number: _GroupNumber
    to_id: _CarId
    sequence: _Sequence
    """Repeated in the reply."""
    acknowledged_origin_id: _CarId
    """With `acknowledged_sequence`: the warning that the sender acknowledges; zero if none."""
    acknowledged_sequence: _Sequence

    def without_acknowledgement(self) -> Self:
        """Return the same join without acknowledging a warning."""
        return replace(self, acknowledged_origin_id=NO_ID, acknowledged_sequence=0)


@dataclass(frozen=True, slots=True)
class Reply:
    """`M_reply`: confirms a join, with the leader and number of its sender, now the predecessor."""

    kind: ClassVar[str] = "reply"
    code: ClassVar[int] = 2
    user_priority: ClassVar[int] = 4
    sender_id: _CarId
    leader_id: _CarId
    number: _GroupNumber
    to_id: _CarId
    sequence: _Sequence
    """`sequence` of the join that this answers."""
    leader_sequence: Annotated[int, Unsigned(16)]
    """The leader's count of its replies, as far as it has come down to the sender."""
    speed_m_s: _Speed
    """Speed of the sender, for comparison with the follower's camera."""
    next_leader_id: _CarId
    """The leader's ID of the next epoch, masked (`onboard/lcca/epoch_ids.py`); `NO_ID` if it is
    not known."""


@dataclass(frozen=True, slots=True)
class Leave:
    """`M_leave`: the sender no longer follows."""

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
    """`M_update`: the sender has another leader or number; its followers change theirs."""

    kind: ClassVar[str] = "update"
    code: ClassVar[int] = 4
    user_priority: ClassVar[int] = 6
    sender_id: _CarId
    leader_id: _CarId
    number: _GroupNumber
    leader_sequence: Annotated[int, Unsigned(16)]
    """As in `Reply`."""


class WarnCause(Enum):
    """What shows the hard braking: the names of `BrakeCause`, or that it is over."""

    OVER = 0
    TEST = 1
    DECELERATION = 2
    BRAKE_PRESSURE = 3
    HAZARD_LIGHTS = 4
    STABILITY_CONTROL = 5
    ABS = 6
    COLLISION = 7
    AIRBAG = 8


@dataclass(frozen=True, slots=True)
class Warn:
    """`M_warn`: a car ahead in the group brakes hard, or does so no longer.

    It tells a state. While that lasts it is sent again, under a new `event_sequence`; the newest
    one of a car is valid.
    """

    kind: ClassVar[str] = "warn"
    code: ClassVar[int] = 5
    user_priority: ClassVar[int] = 7
    sender_id: _CarId
    leader_id: _CarId
    number: _GroupNumber
    event_origin_id: _CarId
    event_sequence: _Sequence
    reach: Annotated[int, Unsigned(16)]
    """Position behind the sender of the car that is to forward this, in cars; 0: unknown."""
    origin_number: _GroupNumber
    """Group number of the braking car, as the sender of this copy counts it now."""
    first_sequence: _Sequence
    """`event_sequence` of the first warning of the same braking."""
    cause: Annotated[WarnCause | int, OpenEnumerated(WarnCause, 8)]
    deceleration_m_s2: Annotated[float, FixedPoint(8, 0.1, "m/s^2", highest=255)]
    """25.5 also for all above."""
    age_s: Annotated[float, FixedPoint(16, 0.001, "s", highest=65535)]
    """Time from when the braking car knew of this state to the sending of this copy: the sum of the
    times for which each car held it, each on its own clock."""
    hops: Annotated[int, Unsigned(8)]
    """1 in the copy that the braking car sends."""
    origin: bytes = field(default=b"", repr=False, compare=False)
    """What the braking car signed, which follows the fields of a copy; empty in its own."""
    stated_at_s: float | None = field(default=None, compare=False)
    """When the braking car knew of this state by its clock, as a time of the cores; `None` if it
    has not signed it."""

    @property
    def is_direct(self) -> bool:
        """Whether the braking car itself sends it."""
        return self.sender_id == self.event_origin_id

    @property
    def is_first(self) -> bool:
        """Whether it, or the warning that it is a copy of, begins the braking."""
        return self.event_sequence == self.first_sequence


@dataclass(frozen=True, slots=True)
class Inquiry:
    """Question which car bears one of several names; that car sends an `Answer`."""

    kind: ClassVar[str] = "inquiry"
    code: ClassVar[int] = 6
    user_priority: ClassVar[int] = 4
    sender_id: _CarId
    sequence: _Sequence
    """Repeated in the answer."""
    names: Annotated[tuple[bytes, ...], SequenceOf(OctetString(NAME_BYTES), 1, MAX_NAMES)]
    """First bytes of communication IDs of the texts that the lead's plate may bear, or temporary
    IDs of BSMs, sorted."""


@dataclass(frozen=True, slots=True)
class Answer:
    """Answer of the car that bears a name in an inquiry."""

    kind: ClassVar[str] = "answer"
    code: ClassVar[int] = 7
    user_priority: ClassVar[int] = 4
    sender_id: _CarId
    to_id: _CarId
    sequence: _Sequence
    """`sequence` of the inquiry that this answers."""
    temporary_id: Annotated[bytes, OctetString(4)]
    """Temporary ID of the sender's BSMs, which tell its speed from now on."""
    speed_m_s: _Speed


GroupMessage = Join | Reply | Leave | Update | Warn
LccaMessage = GroupMessage | Inquiry | Answer


@dataclass(frozen=True, slots=True)
class LccaPdu:
    """What is signed: a message, and the proof that its sender's ID is the signer's."""

    message: LccaMessage
    proof: tuple[bytes, ...] = ()
    """Siblings of the ID; none if the signer's certificate commits to no IDs."""
    origin: bytes = b""
    """Of a repeated `Warn`: the 1609.2 data that the braking car signed; else empty."""


MESSAGES: dict[int, Record[Any]] = {
    message.code: Record(message) for message in get_args(LccaMessage)
}
"""Records by type byte."""

_HEADER_BYTES = 3
"""Version, type, and number of siblings."""


def encode(message: LccaMessage, proof: Sequence[bytes] = (), origin: bytes = b"") -> bytes:
    """Return the message as it is sent.

    Args:
        message: the message.
        proof: that its sender owns `sender_id`: siblings of `SIBLING_BYTES` each.
        origin: of a repeated `Warn`, what the braking car signed.

    Raises:
        ValueError: a field cannot carry its value.
    """
    header = bytes((VERSION, message.code, len(proof)))
    return b"".join((header, *proof, MESSAGES[message.code].encode(message), origin))


def decode(data: bytes) -> LccaPdu:
    """Read a received message.

    Raises:
        DecodeError: `too_short`, `trailing_bytes`, `out_of_range`, `unknown_version` or
            `unknown_type`.
    """
    if len(data) < _HEADER_BYTES:
        raise DecodeError("too_short", f"{len(data)} bytes are no message")
    version, code, count = data[:_HEADER_BYTES]
    if version != VERSION:
        raise DecodeError("unknown_version", f"{version} instead of {VERSION}")
    if code not in MESSAGES:
        raise DecodeError("unknown_type", f"{code}")
    if count > MAX_PROOF:
        raise DecodeError("out_of_range", f"{count} siblings, of at most {MAX_PROOF}")
    fields_at = _HEADER_BYTES + count * SIBLING_BYTES
    proof = range(_HEADER_BYTES, fields_at, SIBLING_BYTES)
    origin_at = fields_at + MESSAGES[code].size_bytes if code == Warn.code else len(data)
    message: LccaMessage = MESSAGES[code].decode(data[fields_at:origin_at])
    siblings = tuple([data[at : at + SIBLING_BYTES] for at in proof])
    return LccaPdu(message, siblings, data[origin_at:])


def as_dict(message: LccaMessage) -> dict[str, Any]:
    """Return the message as it stands in a trace line."""
    return MESSAGES[message.code].as_dict(message)
