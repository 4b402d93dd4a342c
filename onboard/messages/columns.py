"""Many messages of one declaration decoded at once, a column for each field.

MVS receives hundreds of measurements and states a step; this is many times as fast as
`Record.decode` and gives the same numbers: every code of a field is decoded once, into a table.
"""

from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from onboard.errors import DecodeError
from onboard.messages.fields import FixedField, FixedPoint
from onboard.messages.record import Record

Array = NDArray[np.float64]

_WORD_BYTES = 4
"""A field is cut out of so many bytes, so it has at most 25 bits."""


class Columns:
    """Decodes messages of at least 4 bytes, all fields numbers that are always available."""

    def __init__(self, record: Record[Any]) -> None:
        fields = [field.fixed for field in record.fields.values() if field.fixed is not None]
        self._size = record.size_bytes
        bits = np.array([field.bits for field in fields])
        ends = np.cumsum(bits)
        words = np.minimum((ends - bits) // 8, self._size - _WORD_BYTES)
        self._bytes = words[:, None] + np.arange(_WORD_BYTES)
        """(fields, 4) the bytes that each field is cut out of."""
        self._shifts = ((words + _WORD_BYTES) * 8 - ends).astype(np.uint32)
        self._masks = ((1 << bits) - 1).astype(np.uint32)
        tables = {field: _table(field) for field in fields}
        self._values = np.concatenate(list(tables.values()))
        """Value of each code of each declaration."""
        starts = np.cumsum([0, *map(len, tables.values())])
        start_of = dict(zip(tables, starts.tolist(), strict=False))
        self._starts = np.array([start_of[field] for field in fields])

    def read(self, data: bytes) -> Array:
        """Decode the messages in `data`, one after the other.

        Returns:
            (messages, fields); NaN for a code that is declared to have no meaning.
        """
        messages = np.frombuffer(data, np.uint8).reshape(-1, self._size)
        words = messages.take(self._bytes, axis=1).view(">u4")[:, :, 0]
        values: Array = self._values[self._starts + (words >> self._shifts & self._masks)]
        return values


@cache
def _table(field: FixedField) -> Array:
    """Return the value of each code, (codes); NaN for one that has no meaning."""
    codes = np.arange(1 << field.bits)
    if isinstance(field, FixedPoint):
        steps = np.where(codes >= field.negative_from, codes - (1 << field.bits), codes)
        inside = (field.lowest <= steps) & (steps <= field.highest)
        return np.where(inside, steps * field.scale, np.nan)
    return np.array([_value(field, code) for code in codes.tolist()])


def _value(field: FixedField, code: int) -> float:
    try:
        return float(field.from_raw(code))
    except DecodeError:
        return np.nan
