"""Reading and writing of bits in unaligned PER (ITU-T X.691)."""

from onboard.errors import DecodeError

_FRAGMENTED = 1 << 14
"""Length from which X.691 (11.9.3.8) uses fragments; no frame is as long."""
_MAX_NUMBER_OCTETS = 8
"""Of a number without upper bound. Python refuses to print one that has 4,300 digits."""


class BitReader:
    """Reads bits from the front of `data`."""

    __slots__ = ("left", "number")

    def __init__(self, data: bytes) -> None:
        self.number = int.from_bytes(data)
        self.left = len(data) * 8

    def take(self, bits: int) -> int:
        """Return the next `bits` bits as an unsigned number."""
        self.left -= bits
        if self.left < 0:
            raise DecodeError("too_short", f"{-self.left} bits are missing")
        return self.number >> self.left & (1 << bits) - 1

    def length(self) -> int:
        """Return a length determinant without upper bound (X.691, 11.9.3.6 and 7)."""
        if not self.take(1):
            return self.take(7)
        if self.take(1):
            raise DecodeError("too_long", "a length in fragments")
        return self.take(14)

    def small_number(self) -> int:
        """Return a normally small non-negative whole number (X.691, 11.6)."""
        if not self.take(1):
            return self.take(6)
        octets = self.octets()
        if len(octets) > _MAX_NUMBER_OCTETS:
            raise DecodeError("too_long", f"a number of {len(octets)} octets")
        return int.from_bytes(octets)

    def octets(self) -> bytes:
        """Return an open type or OCTET STRING of any length."""
        size = self.length()
        return self.take(size * 8).to_bytes(size)


class BitWriter:
    """Appends bits."""

    __slots__ = ("bits", "number")

    def __init__(self) -> None:
        self.number = 0
        self.bits = 0

    def put(self, value: int, bits: int) -> None:
        """Append `value`, which must fit `bits` bits."""
        self.number = self.number << bits | value
        self.bits += bits

    def put_length(self, length: int) -> None:
        """Append a length determinant without upper bound."""
        if length >= _FRAGMENTED:
            raise ValueError(f"{length} is too long for one message")
        if length < 0x80:
            self.put(length, 8)
        else:
            self.put(0b10 << 14 | length, 16)

    def put_small_number(self, value: int) -> None:
        """Append a normally small non-negative whole number (X.691, 11.6)."""
        if value < 0:
            raise ValueError(f"{value} is below 0")
        if value < 0x40:
            self.put(value, 7)
        else:
            self.put(1, 1)
            self.put_octets(value.to_bytes((value.bit_length() + 7) // 8))

    def put_octets(self, data: bytes) -> None:
        """Append an open type or OCTET STRING of any length."""
        self.put_length(len(data))
        self.put(int.from_bytes(data), len(data) * 8)

    def finish(self) -> bytes:
        """Return all bits padded with zeros to whole bytes, at least one (X.691, 11.1)."""
        size = max(1, (self.bits + 7) // 8)
        return (self.number << size * 8 - self.bits).to_bytes(size)
