"""Unaligned packed encoding rules (ITU-T X.691), as far as J2735 needs them.

A SEQUENCE is a frozen dataclass whose annotations say what each field is on the wire:

    speed_m_s: Annotated[float | None, Number(0, 8190, 0.02, "m/s", unavailable=8191)]

`Record` reads that declaration once; encoding, decoding and printing all go through it. `None` is
sent as the field's "unavailable" code, or, in a field that the standard calls OPTIONAL, left out.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass, fields, is_dataclass
from enum import Enum, IntFlag
from typing import Any, Generic, TypeVar, get_type_hints

from typing_extensions import override

from onboard.errors import DecodeError
from onboard.messages.bit_io import BitReader, BitWriter


class Wire(ABC):
    """How one field is carried."""

    @abstractmethod
    def put(self, writer: BitWriter, value: Any) -> None:
        """Append `value`; `ValueError` if it cannot be carried."""

    @abstractmethod
    def take(self, reader: BitReader) -> Any:
        """Return the next value; `DecodeError` if the bits have no meaning."""


class Fixed(Wire):
    """A field of always `bits` bits: it says what they mean as one unsigned number."""

    bits: int

    @abstractmethod
    def to_bits(self, value: Any) -> int:
        """Return the number for `value`; `ValueError` if there is none."""

    @abstractmethod
    def from_bits(self, number: int) -> Any:
        """Return what `number` says; `DecodeError` if it has no meaning."""

    @override
    def put(self, writer: BitWriter, value: Any) -> None:
        writer.put(self.to_bits(value), self.bits)

    @override
    def take(self, reader: BitReader) -> Any:
        return self.from_bits(reader.take(self.bits))


class Whole(Fixed):
    """INTEGER (lowest..highest), a count or a code."""

    def __init__(self, lowest: int, highest: int) -> None:
        self.lowest = lowest
        self.highest = highest
        self.bits = (highest - lowest).bit_length()

    @override
    def to_bits(self, value: int) -> int:
        if not self.lowest <= value <= self.highest:
            raise ValueError(f"{value} is not {self.lowest} to {self.highest}")
        return value - self.lowest

    @override
    def from_bits(self, number: int) -> int:
        value = number + self.lowest
        if value > self.highest:
            raise DecodeError("out_of_range", f"{value} is above {self.highest}")
        return value


class Number(Fixed):
    """A quantity in steps of `scale` `unit`, `lowest` to `highest` of them.

    What lies beyond is sent as the end. `unavailable` is the code of `None`, in the same steps,
    next to the range.
    """

    def __init__(
        self, lowest: int, highest: int, scale: float, unit: str, unavailable: int | None = None
    ) -> None:
        self.lowest = lowest
        self.highest = highest
        self.scale = scale
        self.unit = unit
        self.unavailable = unavailable
        ends = (lowest, highest) if unavailable is None else (lowest, highest, unavailable)
        self._first, self._last = min(ends), max(ends)
        self.bits = (self._last - self._first).bit_length()
        self._per_unit = 1 / scale

    @override
    def to_bits(self, value: float | None) -> int:
        if value is not None:
            steps = round(min(max(value * self._per_unit, self.lowest), self.highest))
        elif self.unavailable is not None:
            steps = self.unavailable
        else:
            raise ValueError("is never unavailable")
        return steps - self._first

    @override
    def from_bits(self, number: int) -> float | None:
        steps = number + self._first
        if steps == self.unavailable:
            return None
        if steps > self._last:
            raise DecodeError("out_of_range", f"{steps} steps are above {self._last}")
        # Dividing gives the float nearest to the decimal that the standard means.
        return steps / self._per_unit


class Octets(Fixed):
    """OCTET STRING of exactly `size` bytes."""

    def __init__(self, size: int) -> None:
        self.size = size
        self.bits = size * 8

    @override
    def to_bits(self, value: bytes) -> int:
        if len(value) != self.size:
            raise ValueError(f"{value!r} has not {self.size} bytes")
        return int.from_bytes(value)

    @override
    def from_bits(self, number: int) -> bytes:
        return number.to_bytes(self.size)


class Enumerated(Fixed):
    """ENUMERATED without extensions: the members' values are their positions."""

    def __init__(self, names: type[Enum], unavailable: int | None = None) -> None:
        self._names: dict[int, Enum | None] = {name.value: name for name in names}
        if unavailable is not None:
            self._names[unavailable] = None
        self._numbers = {name: number for number, name in self._names.items()}
        self.bits = max(self._names).bit_length()

    @override
    def to_bits(self, value: Enum | None) -> int:
        if value not in self._numbers:
            raise ValueError(f"{value!r} is not one of {[*self._numbers]}")
        return self._numbers[value]

    @override
    def from_bits(self, number: int) -> Enum | None:
        try:
            return self._names[number]
        except KeyError:
            raise DecodeError("out_of_range", f"no choice has number {number}") from None


class Flags(Fixed):
    """BIT STRING (SIZE (bits)); bit i of the standard is `1 << i` here."""

    def __init__(self, names: type[IntFlag], bits: int) -> None:
        self.names = names
        self.bits = bits

    @override
    def to_bits(self, value: IntFlag) -> int:
        if value >> self.bits:
            raise ValueError(f"{value!r} has more than {self.bits} bits")
        return _mirrored(value, self.bits)

    @override
    def from_bits(self, number: int) -> IntFlag:
        return self.names(_mirrored(number, self.bits))


class OpenFlags(Wire):
    """BIT STRING (SIZE (bits, ...)): what a later version added is kept, as flags without name."""

    def __init__(self, names: type[IntFlag], bits: int) -> None:
        self.names = names
        self.bits = bits

    @override
    def put(self, writer: BitWriter, value: IntFlag) -> None:
        bits = max(self.bits, value.bit_length())
        writer.put(bits > self.bits, 1)
        if bits > self.bits:
            writer.put_length(bits)
        writer.put(_mirrored(value, bits), bits)

    @override
    def take(self, reader: BitReader) -> IntFlag:
        bits = reader.length() if reader.take(1) else self.bits
        return self.names(_mirrored(reader.take(bits), bits))


def _mirrored(value: int, bits: int) -> int:
    return int(f"{value:0{bits}b}"[::-1], 2)


class Opaque(Wire):
    """An open type, kept as the bytes of its own encoding."""

    @override
    def put(self, writer: BitWriter, value: bytes) -> None:
        writer.put_octets(value)

    @override
    def take(self, reader: BitReader) -> bytes:
        return reader.octets()


class Several(Wire):
    """SEQUENCE (SIZE (lowest..highest)) OF `item`, as a tuple."""

    def __init__(self, item: Wire, lowest: int, highest: int) -> None:
        self.item = item
        self._count = Whole(lowest, highest)

    @override
    def put(self, writer: BitWriter, value: tuple[Any, ...]) -> None:
        self._count.put(writer, len(value))
        for item in value:
            self.item.put(writer, item)

    @override
    def take(self, reader: BitReader) -> tuple[Any, ...]:
        take = self.item.take
        return tuple([take(reader) for _ in range(self._count.take(reader))])


@dataclass(frozen=True)
class Optional:
    """The field may be left out; a bit in front of the record says so."""

    wire: Wire


class _Run:
    """Fields of a record that follow one another and are always there, read in one piece."""

    def __init__(self, wires: dict[str, Fixed]) -> None:
        self.bits = left = sum(wire.bits for wire in wires.values())
        self._fields: list[tuple[str, Fixed, int, int]] = []
        """Name, wire, bits that follow it in the run, mask."""
        for name, wire in wires.items():
            left -= wire.bits
            self._fields.append((name, wire, left, (1 << wire.bits) - 1))

    def to_bits(self, record: object) -> int:
        number = 0
        for name, wire, _, _ in self._fields:
            try:
                number = number << wire.bits | wire.to_bits(getattr(record, name))
            except ValueError as error:
                raise ValueError(f"{type(record).__name__}.{name}: {error}") from error
        return number

    def from_bits(self, number: int) -> list[Any]:
        return [wire.from_bits(number >> left & mask) for _, wire, left, mask in self._fields]


class Row(Fixed):
    """SEQUENCE whose fields are all fixed and always there, as a frozen dataclass."""

    def __init__(self, record: type[Any]) -> None:
        self.record = record
        wires = _wires_of(record)
        flexible = [name for name, wire in wires.items() if not isinstance(wire, Fixed)]
        if flexible:
            raise TypeError(f"{record.__name__} is no Row: {', '.join(flexible)}")
        self._run = _Run({name: wire for name, wire in wires.items() if isinstance(wire, Fixed)})
        self.bits = self._run.bits

    @override
    def to_bits(self, value: Any) -> int:
        return self._run.to_bits(value)

    @override
    def from_bits(self, number: int) -> Any:
        return self.record(*self._run.from_bits(number))


RecordT = TypeVar("RecordT")


class Record(Wire, Generic[RecordT]):
    """SEQUENCE, as a frozen dataclass. Extension additions are read over and not kept."""

    def __init__(self, record: type[RecordT], *, extensible: bool = False) -> None:
        self.record = record
        self.extensible = extensible
        wires = _wires_of(record)
        self._optional = [name for name, wire in wires.items() if isinstance(wire, Optional)]
        self._head_bits = extensible + len(self._optional)
        self._extended = extensible << len(self._optional)
        self._steps: list[_Run | tuple[str, Wire, int]] = []
        """A run, or name, wire and the field's place among the presence bits (0: always there)."""
        run: dict[str, Fixed] = {}
        for name, wire in wires.items():
            if isinstance(wire, Fixed):
                run[name] = wire
                continue
            if run:
                self._steps.append(_Run(run))
                run = {}
            if isinstance(wire, Optional):
                presence = 1 << len(self._optional) - 1 - self._optional.index(name)
                self._steps.append((name, wire.wire, presence))
            else:
                self._steps.append((name, wire, 0))
        if run:
            self._steps.append(_Run(run))

    @override
    def put(self, writer: BitWriter, value: RecordT) -> None:
        if self.extensible:
            writer.put(0, 1)
        for name in self._optional:
            writer.put(getattr(value, name) is not None, 1)
        for step in self._steps:
            if isinstance(step, _Run):
                writer.put(step.to_bits(value), step.bits)
                continue
            name, wire, presence = step
            field = getattr(value, name)
            if field is None and presence:
                continue
            try:
                wire.put(writer, field)
            except ValueError as error:
                raise ValueError(f"{self.record.__name__}.{name}: {error}") from error

    @override
    def take(self, reader: BitReader) -> RecordT:
        present = reader.take(self._head_bits)
        values: list[Any] = []
        for step in self._steps:
            if isinstance(step, _Run):
                values += step.from_bits(reader.take(step.bits))
                continue
            _, wire, presence = step
            values.append(None if presence & ~present else wire.take(reader))
        if present & self._extended:
            _skip_additions(reader)
        return self.record(*values)

    def encode(self, value: RecordT) -> bytes:
        """Return `value` as a whole encoding. Raises `ValueError`, naming the field."""
        writer = BitWriter()
        self.put(writer, value)
        return writer.finish()

    def decode(self, data: bytes) -> RecordT:
        """Read a whole encoding.

        Raises:
            DecodeError: `too_short`, `out_of_range`, `too_long` or `trailing_bytes`.
        """
        reader = BitReader(data)
        value = self.take(reader)
        if reader.left >= 8:
            raise DecodeError("trailing_bytes", f"{reader.left // 8} bytes left over")
        return value


def _wires_of(record: type[Any]) -> dict[str, Wire | Optional]:
    hints = get_type_hints(record, include_extras=True)
    return {
        field.name: next(
            part for part in hints[field.name].__metadata__ if isinstance(part, Wire | Optional)
        )
        for field in fields(record)
    }


def _skip_additions(reader: BitReader) -> None:
    """X.691, 19.7 to 19.9: how many there may be, which ones there are, each as an open type."""
    count = reader.length() if reader.take(1) else reader.take(6) + 1
    present = reader.take(count)
    for _ in range(present.bit_count()):
        reader.octets()


def printed(value: Any) -> Any:
    """Return `value` as it stands in a trace line: names for codes, hex for bytes."""
    if is_dataclass(value):
        return {field.name: printed(getattr(value, field.name)) for field in fields(value)}
    if isinstance(value, tuple):
        return [printed(item) for item in value]
    if isinstance(value, IntFlag):
        known = [str(flag.name).lower() for flag in type(value) if flag in value]
        unknown = int(value) & ~sum(type(value))
        return known + [f"bit_{i}" for i in range(unknown.bit_length()) if unknown >> i & 1]
    if isinstance(value, Enum):
        return value.name.lower()
    return value.hex() if isinstance(value, bytes) else value
