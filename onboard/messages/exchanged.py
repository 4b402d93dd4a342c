"""Messages of the own radio and of others, as events of the trace."""

from dataclasses import dataclass
from typing import ClassVar


@dataclass(frozen=True, slots=True)
class MessageSent:
    """A message queued for the radio."""

    kind: ClassVar[str] = "sent"
    stamp_s: float
    message: str
    """Type: `join`, `warn`, `bsm`, ..."""
    user_priority: int
    size_bytes: int
    """Size of the whole WSM."""
    content: dict[str, object]


@dataclass(frozen=True, slots=True)
class MessageReceived:
    """An accepted message of a remote vehicle."""

    kind: ClassVar[str] = "received"
    stamp_s: float
    message: str
    signer_id: bytes | None
    content: dict[str, object]
