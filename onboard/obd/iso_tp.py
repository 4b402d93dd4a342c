"""Reassembly of ISO 15765-2 messages from frames: the receiving end.

Requests of a tester fit into one SingleFrame each, so it never segments; responses of ECUs may be
long. Names and timers are the standard's: N_Cr bounds the wait for the next ConsecutiveFrame.
"""

import math
from collections import deque
from dataclasses import dataclass

from onboard.obd.n_pdu import (
    MAX_FIRST_FRAME_12_BIT,
    ConsecutiveFrame,
    FirstFrame,
    NPdu,
    SingleFrame,
)

N_CR_S = 1.0
"""ISO 15765-2:2016, 9.8."""

CONSECUTIVE_FRAME_DATA_BYTES = 7


@dataclass(frozen=True, slots=True)
class Message:
    """A complete message."""

    payload: bytes


@dataclass(frozen=True, slots=True)
class Aborted:
    """A message that was not completed; `reason` is an identifier."""

    reason: str
    detail: str


class Reassembly:
    """The receiving end of one pair of addresses (ISO 15765-2:2016, 9.8.3: half duplex).

    It only listens. The sender of the request answers a FirstFrame with FlowControl; so messages
    that another tester requested are read as well.
    """

    def __init__(self, n_cr_s: float = N_CR_S) -> None:
        self._n_cr_s = n_cr_s
        self._length = 0
        self._received = bytearray()
        self._sequence_number = 0
        self._n_cr_at = math.inf
        self._events: deque[Message | Aborted] = deque()

    def receive_pdu(self, pdu: NPdu, now: float) -> None:
        """Receive the next unit; FlowControl belongs to the other direction and is ignored."""
        self.handle_timer(now)
        match pdu:
            case SingleFrame(data):
                self._interrupt()
                self._events.append(Message(data))
            case FirstFrame(length, data):
                self._interrupt()
                self._begin(length, data, now)
            case ConsecutiveFrame(sequence_number, data):
                self._continue(sequence_number, data, now)

    def get_timer(self) -> float:
        """Return when N_Cr runs out; `math.inf` while no message is being received."""
        return self._n_cr_at

    def handle_timer(self, now: float) -> None:
        """Abort a message whose next frame is overdue (N_TIMEOUT_Cr)."""
        if now >= self._n_cr_at:
            self._abort("n_timeout_cr")

    def next_event(self) -> Message | Aborted | None:
        """The oldest event not yet taken."""
        return self._events.popleft() if self._events else None

    def _begin(self, length: int, data: bytes, now: float) -> None:
        if length > MAX_FIRST_FRAME_12_BIT:
            self._events.append(Aborted("n_buffer_overflow", f"FF_DL {length}"))
            return
        self._length = length
        self._received = bytearray(data)
        self._sequence_number = 1
        self._n_cr_at = now + self._n_cr_s

    def _continue(self, sequence_number: int, data: bytes, now: float) -> None:
        if self._n_cr_at == math.inf:
            self._events.append(
                Aborted("unexpected_consecutive_frame", "no message is being received")
            )
            return
        if sequence_number != self._sequence_number:
            self._abort("n_wrong_sn", f"got {sequence_number}, expected {self._sequence_number}")
            return
        missing = self._length - len(self._received)
        if len(data) < min(missing, CONSECUTIVE_FRAME_DATA_BYTES):
            self._abort("consecutive_frame_length", f"{len(data)} bytes of {missing}")
            return
        self._received += data[:missing]
        self._sequence_number = (sequence_number + 1) & 0xF
        self._n_cr_at = now + self._n_cr_s
        if len(self._received) == self._length:
            self._n_cr_at = math.inf
            self._events.append(Message(bytes(self._received)))

    def _interrupt(self) -> None:
        """Abort the current message if a new one begins before its end (N_UNEXP_PDU)."""
        if self._n_cr_at < math.inf:
            self._abort("n_unexp_pdu")

    def _abort(self, reason: str, why: str = "") -> None:
        self._n_cr_at = math.inf
        progress = f"after {len(self._received)} of {self._length} bytes"
        self._events.append(Aborted(reason, f"{why}, {progress}" if why else progress))
