"""Size and completeness of a JPEG (ITU-T T.81, annex B), without decoding it.

A decoder allocates what the header claims, however few bytes follow. A truncated image would be
decoded half grey. Telephones append further data, such as a short film or a second image. The end
of the image is then not the end of the file, and has to be searched.
"""

import re

_START_OF_IMAGE, _END_OF_IMAGE = b"\xff\xd8", b"\xff\xd9"
_START_OF_SCAN = 0xDA
_FRAME_HEADERS = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}
_WITHOUT_LENGTH = frozenset({0x01, *range(0xD0, 0xD8)})
_AFTER_SCAN = re.compile(rb"\xff[^\x00\xff\xd0-\xd7]")
"""Any marker that ends the coded data of a scan."""


def is_jpeg(data: bytes) -> bool:
    """Whether `data` begins as a JPEG does."""
    return data.startswith(_START_OF_IMAGE)


def pixels(jpeg: bytes) -> int:
    """Return the number of pixels that the frame header claims; 0 if none is found."""
    at = len(_START_OF_IMAGE)
    while at + 9 <= len(jpeg) and jpeg[at] == 0xFF:
        marker = jpeg[at + 1]
        if marker in _FRAME_HEADERS:
            height, width = jpeg[at + 5 : at + 7], jpeg[at + 7 : at + 9]
            return int.from_bytes(height, "big") * int.from_bytes(width, "big")
        if marker == 0xFF:  # a fill byte
            at += 1
        elif marker in _WITHOUT_LENGTH:
            at += 2
        elif (length := int.from_bytes(jpeg[at + 2 : at + 4], "big")) < 2 or marker == 0:
            return 0
        else:
            at += 2 + length
    return 0


def is_whole(jpeg: bytes) -> bool:
    """Whether the end of the image is there, whatever follows it."""
    if jpeg.rstrip(b"\r\n\0").endswith(_END_OF_IMAGE):
        return True
    at = len(_START_OF_IMAGE)
    while at + 4 <= len(jpeg) and jpeg[at] == 0xFF:
        marker = jpeg[at + 1]
        if marker == _END_OF_IMAGE[1]:
            return True
        if marker == 0xFF:  # a fill byte
            at += 1
            continue
        # A segment states its length; a preview within one has an end of its own.
        at += 2 + int.from_bytes(jpeg[at + 2 : at + 4], "big")
        if marker == _START_OF_SCAN:
            next_marker = _AFTER_SCAN.search(jpeg, at)
            if next_marker is None:
                return False
            at = next_marker.start()
    return False
