"""The four protocol data units of ISO 15765-2 (N_PDU) on a classical CAN frame, both ways.

Normal addressing: the identifier names both ends, and all data bytes belong to the unit. The first
nibble is the unit's type (ISO 15765-2:2016, 9.6).
"""

from dataclasses import dataclass
from enum import IntEnum

PADDING = 0xCC
"""Padding of a frame to 8 bytes, with least bit stuffing (ISO 15765-2:2016)."""

MAX_FRAME_BYTES = 8
MAX_SINGLE_FRAME_BYTES = 7
MAX_FIRST_FRAME_12_BIT = 0xFFF


class NPduError(Exception):
    """The bytes are no N_PDU; `reason` is an identifier, the text is for the user."""

    def __init__(self, reason: str, detail: str) -> None:
        super().__init__(detail)
        self.reason = reason


class FlowStatus(IntEnum):
    """Flow status of the receiver (9.6.5)."""

    CONTINUE_TO_SEND = 0
    WAIT = 1
    OVERFLOW = 2


@dataclass(frozen=True, slots=True)
class SingleFrame:
    """A complete message of 1 to 7 bytes."""

    data: bytes


@dataclass(frozen=True, slots=True)
class FirstFrame:
    """The beginning of a message of `length` bytes, with the first of them."""

    length: int
    data: bytes


@dataclass(frozen=True, slots=True)
class ConsecutiveFrame:
    """The next 7 bytes of a message; the last one may have padding."""

    sequence_number: int
    """1, 2 ... 15, 0, 1 ..."""
    data: bytes


@dataclass(frozen=True, slots=True)
class FlowControl:
    """The receiver's permission for the next `block_size` frames, `st_min` apart."""

    flow_status: FlowStatus
    block_size: int
    """0: all that are left."""
    st_min: int
    """Minimum separation time: 0x00 to 0x7F ms; 0xF1 to 0xF9 are 100 to 900 us."""


NPdu = SingleFrame | FirstFrame | ConsecutiveFrame | FlowControl


def encode(pdu: NPdu) -> bytes:
    """The 8 data bytes of the frame with `pdu`."""
    return _unpadded(pdu).ljust(MAX_FRAME_BYTES, bytes([PADDING]))


def decode(frame: bytes) -> NPdu:
    """Decode the data bytes of one frame.

    Frames that are not padded to 8 bytes are accepted if they have the announced length.

    Raises:
        NPduError: with reason `frame_length` (no bytes, or more than 8), `single_frame_length`,
            `first_frame_length`, `consecutive_frame_length`, `flow_control` or `n_pci_type`.
    """
    if not 0 < len(frame) <= MAX_FRAME_BYTES:
        raise NPduError("frame_length", f"{len(frame)} bytes")
    match frame[0] >> 4:
        case 0:
            return _decode_single_frame(frame)
        case 1:
            return _decode_first_frame(frame)
        case 2:
            if len(frame) == 1:
                raise NPduError("consecutive_frame_length", "no data")
            return ConsecutiveFrame(frame[0] & 0xF, frame[1:])
        case 3:
            return _decode_flow_control(frame)
        case other:
            raise NPduError("n_pci_type", f"N_PCI type {other}")


def _unpadded(pdu: NPdu) -> bytes:
    match pdu:
        case SingleFrame(data):
            return bytes([len(data)]) + data
        case FirstFrame(length, data) if length <= MAX_FIRST_FRAME_12_BIT:
            return (0x1000 | length).to_bytes(2, "big") + data
        case FirstFrame(length, data):
            return b"\x10\x00" + length.to_bytes(4, "big") + data
        case ConsecutiveFrame(sequence_number, data):
            return bytes([0x20 | sequence_number]) + data
        case FlowControl(flow_status, block_size, st_min):
            return bytes([0x30 | flow_status, block_size, st_min])


def _decode_single_frame(frame: bytes) -> SingleFrame:
    length = frame[0]
    if not 0 < length < len(frame):
        raise NPduError("single_frame_length", f"SF_DL {length} in {len(frame)} bytes")
    return SingleFrame(frame[1 : 1 + length])


def _decode_first_frame(frame: bytes) -> FirstFrame:
    length, start = int.from_bytes(frame[:2], "big") & 0xFFF, 2
    if length == 0:  # escape: 32 bits follow
        length, start = int.from_bytes(frame[2:6], "big"), 6
    shortest = MAX_SINGLE_FRAME_BYTES + 1 if start == 2 else MAX_FIRST_FRAME_12_BIT + 1
    if len(frame) < MAX_FRAME_BYTES or length < shortest:
        raise NPduError("first_frame_length", f"FF_DL {length} in {len(frame)} bytes")
    return FirstFrame(length, frame[start:])


def _decode_flow_control(frame: bytes) -> FlowControl:
    status = frame[0] & 0xF
    if len(frame) < 3 or status > FlowStatus.OVERFLOW:
        raise NPduError("flow_control", f"flow status {status} in {len(frame)} bytes")
    return FlowControl(FlowStatus(status), frame[1], frame[2])
