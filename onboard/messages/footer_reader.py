"""Fast reading of MVS footers: a footer of every neighbour arrives ten times a second.

The observer and count of a run have together as many bits as an age, so a provenance is a series of
words of `AGE_BITS`, which are cut out of one number.
"""

from onboard.errors import DecodeError

AGE_BITS = 12
COUNT_BITS = 4
"""Width of the number of measurements in a run, less one."""
OBSERVER_BITS = AGE_BITS - COUNT_BITS

_AGE_MASK = (1 << AGE_BITS) - 1
_COUNT_MASK = (1 << COUNT_BITS) - 1
_MAX_WORDS = 1 + (1 << COUNT_BITS)
"""Words of the longest run."""


class FooterReader:
    """Takes bytes, and runs of a provenance, off the front of `data`."""

    def __init__(self, data: bytes) -> None:
        self._data = data
        self._at = 0

    def take(self, size: int) -> bytes:
        """Return the next `size` bytes. Raises `DecodeError`: `too_short`."""
        start = self._at
        self._at += size
        if self._at > len(self._data):
            raise self._too_short()
        return self._data[start : self._at]

    def take_runs(self, count: int) -> tuple[list[int], list[int]]:
        """Return the words of the next `count` runs, and the index of the word after each run.

        Raises:
            DecodeError: `too_short`, or `out_of_range` if the padding of the last byte is not zero.
        """
        ahead = self._data[self._at : self._at + count * _MAX_WORDS * 2]
        number, bits = int.from_bytes(ahead), len(ahead) * 8
        left, ends = bits, []
        for _ in range(count):
            left -= AGE_BITS
            if left >= 0:
                left -= AGE_BITS * ((number >> left & _COUNT_MASK) + 1)
            if left < 0:
                raise self._too_short()
            ends.append((bits - left) // AGE_BITS)
        self._at += (bits - left + 7) // 8
        if number >> left // 8 * 8 & (1 << left % 8) - 1:
            raise DecodeError("out_of_range", "the padding bits are not zero")
        shifts = range(bits - AGE_BITS, left - 1, -AGE_BITS)
        return [number >> shift & _AGE_MASK for shift in shifts], ends

    def finish(self) -> None:
        """Check that nothing is left. Raises `DecodeError`: `trailing_bytes`."""
        rest = len(self._data) - self._at
        if rest:
            raise DecodeError("trailing_bytes", f"{rest} bytes behind the last entry")

    def _too_short(self) -> DecodeError:
        return DecodeError("too_short", f"{len(self._data)} bytes are not all of it")
