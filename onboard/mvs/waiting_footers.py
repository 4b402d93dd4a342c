"""Footers that wait for the next update, in which they are read and assigned together."""

from collections import deque
from collections.abc import Generator
from dataclasses import dataclass, replace

from onboard.errors import DecodeError
from onboard.kinematics.arrays import Array
from onboard.mvs.footer_reading import read_in_slices
from onboard.mvs.footer_validation import MAX_ENTRIES
from onboard.mvs.received_footers import ReceivedFooter, SharedEntries
from onboard.observations import Discarded

MAX_WAITING_FOOTERS = 256
"""With more, they are processed at once."""
FOOTERS_TOGETHER = 10
"""Footers that are read and checked together, in three slices of an update."""


@dataclass(frozen=True, slots=True, eq=False)
class _Waiting:
    data: bytes | SharedEntries
    sender_id: bytes
    sender_m: Array
    """Position of the sender by its BSM (2), in the host vehicle's frame."""
    received_s: float


class WaitingFooters:
    """Footers, encoded or not, in the order of their arrival."""

    def __init__(self) -> None:
        """Start without any."""
        self._waiting: deque[_Waiting] = deque()

    def __len__(self) -> int:
        """Return how many wait."""
        return len(self._waiting)

    def put(
        self, data: bytes | SharedEntries, sender_id: bytes, sender_m: Array, received_s: float
    ) -> None:
        """Let a footer wait.

        Args:
            data: encoded, or already decoded.
            sender_id: temporary ID, 4 bytes.
            sender_m: position of the sender by its BSM (2), in the host vehicle's frame.
            received_s: time of receipt.
        """
        self._waiting.append(_Waiting(data, sender_id, sender_m, received_s))

    def change_frame(self, turn: Array, shift: Array) -> None:
        """Map the senders into another frame (`LocalFrame.mapping_from`)."""
        self._waiting = deque(
            replace(each, sender_m=turn @ each.sender_m + shift) for each in self._waiting
        )

    def take_in_slices(
        self, footers: int
    ) -> Generator[None, None, tuple[list[ReceivedFooter], list[Discarded]]]:
        """Take the first `footers`: those that have entries, and why others are refused."""
        taken = [self._waiting.popleft() for _ in range(footers)]
        encoded = [each.data for each in taken if isinstance(each.data, bytes)]
        read = iter((yield from read_in_slices(encoded)))
        received, refused = [], []
        for each in taken:
            entries = next(read) if isinstance(each.data, bytes) else each.data
            if isinstance(entries, DecodeError):
                refused.append(Discarded(each.received_s, "mvs", entries.reason, str(entries)))
            elif len(entries) > MAX_ENTRIES:
                detail = f"{len(entries)} from {each.sender_id.hex()}"
                refused.append(Discarded(each.received_s, "mvs", "too_many_entries", detail))
            elif len(entries):
                received.append(
                    ReceivedFooter(entries, each.sender_id, each.sender_m, each.received_s)
                )
        return received, refused
