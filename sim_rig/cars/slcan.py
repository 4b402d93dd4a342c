"""Serial CAN in the text protocol of LAWICEL's adapters, which slcand of can-utils speaks.

    tIIILDD...         data frame: identifier of 11 bits as three hex digits, length, data
    TIIIIIIIILDD...    the same with an identifier of 29 bits as eight hex digits

Each message ends in a carriage return (CAN232 manual, LAWICEL). The line itself is the bus here:
what opens an adapter or sets its bit rate, remote frames, and what is malformed, are ignored.
"""

import re
from collections.abc import Iterator

from onboard.obd.can_frame import CanFrame

LONGEST = 27
"""A frame with eight bytes and an identifier of 29 bits."""
_FRAME = re.compile(
    rb"(?:t([0-7][0-9A-F]{2})|T([01][0-9A-F]{7}))([0-8])((?:[0-9A-F]{2})*)", re.IGNORECASE
)


def encode(frame: CanFrame) -> bytes:
    """Return the message of a classical data frame."""
    kind, digits = ("T", 8) if frame.is_extended_id else ("t", 3)
    head = f"{kind}{frame.arbitration_id:0{digits}X}{len(frame.data)}"
    return f"{head}{frame.data.hex().upper()}\r".encode("ascii")


class SlcanReader:
    """Turns the bytes of the line into frames."""

    def __init__(self) -> None:
        """Begin within nothing."""
        self._rest = b""

    def receive_bytes(self, data: bytes, now: float) -> Iterator[CanFrame]:
        """Yield the frames that are complete with these bytes, received at `now`, s."""
        *messages, rest = (self._rest + data).split(b"\r")
        self._rest = rest[: LONGEST + 1]  # what is longer is no frame, whatever follows
        for message in messages:
            frame = _decode(message, now)
            if frame is not None:
                yield frame


def _decode(message: bytes, now: float) -> CanFrame | None:
    """Return a data frame; `None` if the message is none."""
    match = _FRAME.fullmatch(message)
    if match is None or len(match[4]) != 2 * int(match[3]):
        return None
    is_extended_id = match[2] is not None
    identifier = int(match[2] if is_extended_id else match[1], 16)
    return CanFrame(now, identifier, is_extended_id, bytes.fromhex(match[4].decode("ascii")))
