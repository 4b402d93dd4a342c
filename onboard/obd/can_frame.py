"""One data frame of a CAN bus, free of any driver's types."""

from dataclasses import dataclass
from typing import ClassVar


@dataclass(frozen=True, slots=True)
class CanFrame:
    """A classical or FD data frame; remote and error frames never get this far."""

    kind: ClassVar[str] = "can"
    stamp_s: float
    """When the bus carried it, or, for a frame to send, when it was decided."""
    arbitration_id: int
    """11 or 29 bits."""
    is_extended_id: bool
    """29-bit identifier."""
    data: bytes
