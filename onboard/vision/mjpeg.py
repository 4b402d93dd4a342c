"""Images of an MJPEG stream: `multipart/x-mixed-replace` (RFC 2046, section 5.1) of JPEGs.

Cameras and telephone apps differ: some state each part's length, some do not, some state a wrong
one. The next delimiter often comes only with the next image, so an image is returned as soon as it
is complete: at its stated length, or where the received data end with its end-of-image marker.
"""

import re
from collections import deque
from enum import Enum, auto

LONGEST_PART = 16 * 1024 * 1024
"""Bytes after which a part without an end is dropped."""
_START_OF_IMAGE, _END_OF_IMAGE = b"\xff\xd8", b"\xff\xd9"
_LENGTH = re.compile(rb"(?im)^content-length[ \t]*:[ \t]*(\d{1,9})[ \t]*\r?$")


class _Reading(Enum):
    DELIMITER = auto()
    HEAD = auto()
    BODY = auto()


class MjpegParts:
    """Splits a byte stream into the bodies of its parts."""

    def __init__(self, boundary: bytes) -> None:
        """Start before the first part; `boundary` is the content type's, with or without `--`."""
        self._delimiter = b"--" + boundary.removeprefix(b"--")
        self._buffer = b""
        self._reading = _Reading.DELIMITER
        self._length: int | None = None
        self._bodies: deque[bytes] = deque()

    def receive_bytes(self, data: bytes) -> None:
        """Add the next bytes of the stream."""
        self._buffer += data
        steps = {
            _Reading.DELIMITER: self._take_delimiter,
            _Reading.HEAD: self._take_head,
            _Reading.BODY: self._take_body,
        }
        while steps[self._reading]():
            pass
        if len(self._buffer) > LONGEST_PART:
            self._advance(len(self._buffer), _Reading.DELIMITER)

    def next_body(self) -> bytes | None:
        """The oldest body not yet taken: a JPEG, unless the camera is faulty."""
        return self._bodies.popleft() if self._bodies else None

    def _advance(self, taken: int, reading: _Reading) -> bool:
        self._buffer = self._buffer[taken:]
        self._reading = reading
        return True

    def _take_delimiter(self) -> bool:
        at = self._buffer.find(self._delimiter)
        return at >= 0 and self._advance(at + len(self._delimiter), _Reading.HEAD)

    def _take_head(self) -> bool:
        at = self._buffer.find(b"\r\n\r\n")
        if at < 0:
            return False
        length = _LENGTH.search(self._buffer, 0, at)
        self._length = int(length[1]) if length else None
        return self._advance(at + 4, _Reading.BODY)

    def _take_body(self) -> bool:
        if self._length is not None:
            if len(self._buffer) < self._length <= LONGEST_PART:
                return False
            if _is_whole(self._buffer[: self._length]):
                return self._finish_body(self._length)
            self._length = None
        at = self._buffer.find(self._delimiter)
        if at >= 0:
            return self._finish_body(at)
        return _is_whole(self._buffer) and self._finish_body(len(self._buffer))

    def _finish_body(self, length: int) -> bool:
        self._bodies.append(self._buffer[:length].rstrip(b"\r\n"))
        return self._advance(length, _Reading.DELIMITER)


def _is_whole(body: bytes) -> bool:
    return body.startswith(_START_OF_IMAGE) and body.rstrip(b"\r\n\0").endswith(_END_OF_IMAGE)
