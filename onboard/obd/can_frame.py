"""One data frame of a CAN bus, independent of drivers."""

from dataclasses import dataclass
from typing import ClassVar


@dataclass(frozen=True, slots=True)
class CanFrame:
    """A classical or FD data frame; remote and error frames are not passed on."""

    kind: ClassVar[str] = "can"
    stamp_s: float
    """Time of reception, or of the decision to send it."""
    arbitration_id: int
    """11 or 29 bits."""
    is_extended_id: bool
    """29-bit identifier."""
    data: bytes
