"""Content of IEEE 802.11 frames as sniffers capture them, with or without radiotap header.

Stations outside the context of a BSS send data frames with EtherType protocol discrimination, or
with LLC and SNAP (IEEE 802.11-2020, 9.2.4 and 9.3.2; IEEE 802, 5.2; radiotap.org).
"""

import struct
from typing import Final

_DATA_TYPE: Final = 2
_NO_DATA = 0x4
"""Bits of the subtype."""
_QOS = 0x8
_BOTH_DS, _PROTECTED, _HT_CONTROL = 0x03, 0x40, 0x80
"""Flags: to and from the distribution system (four addresses), encrypted, HT control field."""

_LLC_SNAP = bytes.fromhex("aaaa03000000")

_TSFT, _FLAGS, _EXTENDED = 1 << 0, 1 << 1, 1 << 31
"""Fields present in a radiotap header."""
_DATA_PAD = 0x20
"""Radiotap flag: the MAC header is padded to four octets."""


def content_of_radiotap(captured: bytes) -> tuple[int, bytes] | None:
    """Return what `content_of_frame` does, for a frame behind a radiotap header.

    Raises:
        struct.error: the packet ends within the header.
    """
    size, present = struct.unpack_from("<xxHI", captured)
    position, more = struct.calcsize("<xxHI"), present
    while more & _EXTENDED:
        (more,) = struct.unpack_from("<I", captured, position)
        position += 4
    if present & _TSFT:
        position = (position + 7) // 8 * 8 + 8
    flags = int.from_bytes(captured[position : position + 1]) if present & _FLAGS else 0
    return content_of_frame(captured[size:], is_padded=bool(flags & _DATA_PAD))


def content_of_frame(frame: bytes, *, is_padded: bool = False) -> tuple[int, bytes] | None:
    """Return EtherType and content of a frame; `None` if it is no data frame or is encrypted.

    Args:
        frame: from the frame control field on; a check sequence at its end is kept.
        is_padded: whether the MAC header is padded to four octets.

    Raises:
        struct.error: the frame ends within its header.
    """
    control, flags = struct.unpack_from("BB", frame)
    subtype = control >> 4
    if control >> 2 & 3 != _DATA_TYPE or subtype & _NO_DATA or flags & _PROTECTED:
        return None
    size = 24
    if flags & _BOTH_DS == _BOTH_DS:
        size += 6
    if subtype & _QOS:
        size += 6 if flags & _HT_CONTROL else 2
    if is_padded:
        size = (size + 3) // 4 * 4
    content = frame[size:].removeprefix(_LLC_SNAP)
    (ethertype,) = struct.unpack_from(">H", content)
    return ethertype, content[2:]
