"""Canonical octet encoding rules (COER, ITU-T X.696): the primitives that IEEE 1609.2 uses."""

from collections.abc import Callable, Collection
from typing import TypeVar

ItemT = TypeVar("ItemT")

MAX_NUMBER_BYTES = 8
"""Of an INTEGER without bounds: PSIDs, counts and lengths of chains are smaller. Python refuses to
print one that has 4,300 digits."""


class Malformed(ValueError):  # noqa: N818 (names the state of the bytes)
    """The bytes are not a valid encoding."""


class Unsupported(ValueError):  # noqa: N818 (names the state of the bytes)
    """The bytes may be valid, but are of a kind that is not supported."""


def length_of(size: int) -> bytes:
    """Encode a length determinant (X.696, 8.6)."""
    if size < 0x80:
        return bytes((size,))
    width = (size.bit_length() + 7) // 8
    return bytes((0x80 | width,)) + size.to_bytes(width, "big")


def octets(data: bytes) -> bytes:
    """Encode an OCTET STRING of open size: length, then content."""
    return length_of(len(data)) + data


def unsigned(value: int) -> bytes:
    """Encode a non-negative INTEGER without upper bound (X.696, 10.3)."""
    return octets(value.to_bytes((value.bit_length() + 7) // 8 or 1, "big"))


def signed(value: int) -> bytes:
    """Encode an INTEGER without bounds in two's complement (X.696, 10.4)."""
    bits = (value if value >= 0 else ~value).bit_length() + 1
    return octets(value.to_bytes((bits + 7) // 8, "big", signed=True))


def sequence(items: Collection[bytes]) -> bytes:
    """Encode a SEQUENCE OF: the count, then the items (X.696, 17)."""
    return unsigned(len(items)) + b"".join(items)


def choice(number: int) -> bytes:
    """Encode the tag of a CHOICE's alternative (X.696, 8.7)."""
    return bytes((0x80 | number,))


class OerReader:
    """Reads `data` from the front; raises `Malformed` where it is too short.

    Numbers of more than `MAX_NUMBER_BYTES` are `Unsupported`.
    """

    __slots__ = ("data", "position")

    def __init__(self, data: bytes, position: int = 0) -> None:
        self.data = data
        self.position = position

    def take(self, size: int) -> bytes:
        """Return the next `size` bytes."""
        end = self.position + size
        taken = self.data[self.position : end]
        if len(taken) != size:
            raise Malformed(f"ends after {len(self.data)} bytes, {end} needed")
        self.position = end
        return taken

    def byte(self) -> int:
        """Return the next byte."""
        position = self.position
        if position >= len(self.data):
            raise Malformed(f"ends after {position} bytes, one more needed")
        self.position = position + 1
        return self.data[position]

    def integer(self, size: int) -> int:
        """Return the next `size` bytes as an unsigned integer."""
        return int.from_bytes(self.take(size), "big")

    def length(self) -> int:
        """Return a length determinant; canonical encoding demands the shortest form."""
        first = self.byte()
        if first < 0x80:
            return first
        size = self.integer(first & 0x7F)
        if length_of(size)[0] != first or size < 0x80:
            raise Malformed(f"length {size} in {first & 0x7F} bytes is not canonical")
        return size

    def octets(self) -> bytes:
        """Return an OCTET STRING of open size."""
        return self.take(self.length())

    def unsigned(self) -> int:
        """Return an INTEGER without upper bound."""
        content = self._number()
        if not content or (content[0] == 0 and len(content) > 1):
            raise Malformed("an integer without bytes, or not in the shortest form")
        return int.from_bytes(content, "big")

    def signed(self) -> int:
        """Return an INTEGER without bounds."""
        content = self._number()
        if not content or signed(int.from_bytes(content, "big", signed=True))[1:] != content:
            raise Malformed("an integer without bytes, or not in the shortest form")
        return int.from_bytes(content, "big", signed=True)

    def _number(self) -> bytes:
        content = self.octets()
        if len(content) > MAX_NUMBER_BYTES:
            raise Unsupported(f"an integer of {len(content)} bytes")
        return content

    def choice(self) -> int:
        """Return the number of a CHOICE's alternative."""
        tag = self.byte()
        if tag & 0xC0 != 0x80 or tag == 0xBF:
            raise Malformed(f"tag 0x{tag:02x} is not a context tag of one byte")
        return tag & 0x3F

    def several(self, read: Callable[["OerReader"], ItemT]) -> tuple[ItemT, ...]:
        """Return a SEQUENCE OF whose items `read` reads."""
        count = self.unsigned()
        if count > len(self.data):
            raise Malformed(f"{count} items in {len(self.data)} bytes")
        return tuple(read(self) for _ in range(count))

    def skip_additions(self) -> None:
        """Skip the extension additions of a SEQUENCE: a bitmap, then open types (X.696, 16.4)."""
        bitmap = self.octets()
        if len(bitmap) < 2 or bitmap[0] > 7:
            raise Malformed("an extension bitmap without bits")
        for _ in range((int.from_bytes(bitmap[1:], "big") >> bitmap[0]).bit_count()):
            self.octets()

    def finish(self) -> None:
        """Check that nothing is left. Raises `Malformed`."""
        left = len(self.data) - self.position
        if left:
            raise Malformed(f"{left} bytes left over")
