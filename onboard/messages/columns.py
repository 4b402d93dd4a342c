"""Many messages of one layout read at once, a column for each field: a tick brings hundreds."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from onboard.errors import DecodeError
from onboard.messages.declaration import Layout, Number, Wire

Array = NDArray[np.float64]

_TABLE_BITS = 12
"""Of fields so narrow, what each code says is looked up."""


class Columns:
    """Reads messages all fields of which are numbers and always available."""

    def __init__(self, layout: Layout[Any]) -> None:
        wires = list(layout.wires.values())
        self._bits = layout.size_bytes * 8
        # What each bit of a message counts in each of its fields.
        self._weights = np.zeros((self._bits, len(wires)))
        first = 0
        for column, wire in enumerate(wires):
            places = np.arange(first, first + wire.bits)
            self._weights[places, column] = 2.0 ** np.arange(wire.bits)[::-1]
            first += wire.bits
        self._narrow = [at for at, wire in enumerate(wires) if wire.bits <= _TABLE_BITS]
        tables = [_table(wires[at]) for at in self._narrow]
        self._said = np.concatenate(tables)
        self._starts = np.cumsum([0] + [len(table) for table in tables[:-1]])
        self._wide = [at for at, wire in enumerate(wires) if wire.bits > _TABLE_BITS]
        numbers = [wire for wire in wires if isinstance(wire, Number) and wire.bits > _TABLE_BITS]
        self._half = np.array([2.0 ** (n.bits - (n.lowest < 0)) for n in numbers])
        self._bounds = np.array([(n.lowest, n.highest) for n in numbers]).T
        self._scales = np.array([number.scale for number in numbers])

    def read(self, data: bytes) -> Array:
        """Return (messages, fields) of what stands in `data` one after the other.

        Raises:
            DecodeError: `out_of_range`.
        """
        bits = np.unpackbits(np.frombuffer(data, np.uint8)).reshape(-1, self._bits)
        codes = bits @ self._weights
        values = np.empty_like(codes)
        narrow = codes[:, self._narrow].astype(np.intp)
        values[:, self._narrow] = self._said[self._starts + narrow]
        steps = codes[:, self._wide]
        steps -= (steps >= self._half) * (2.0 * self._half)
        lowest, highest = self._bounds
        inside = (lowest <= steps) & (steps <= highest)
        values[:, self._wide] = np.where(inside, steps * self._scales, np.nan)
        if np.isnan(values).any():
            raise DecodeError("out_of_range", "a code that is declared to have no meaning")
        return values


def _table(wire: Wire) -> Array:
    said = np.full(1 << wire.bits, np.nan)
    for code in range(1 << wire.bits):
        try:
            said[code] = wire.from_raw(code)
        except DecodeError:
            continue
    return said
