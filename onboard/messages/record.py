"""Messages, each declared once.

A message is a frozen dataclass whose annotations say what each field is on the wire:

    speed_m_s: Annotated[float | None, Quantity(0, 8190, 0.02, "m/s", unavailable=8191)]

`Record` reads that declaration; encoding, decoding, printing, documentation and the property tests
all go through it. What is not so declared, and has a default, is no part of it. Fields follow one
another without padding, most significant bit first. `None` is sent as the field's "unavailable"
code, or, in an `Optional` field, left out.
"""

from collections.abc import Callable
from dataclasses import fields
from typing import Annotated, Any, Generic, TypeVar, get_origin, get_type_hints

from typing_extensions import override

from onboard.errors import DecodeError
from onboard.messages.bit_io import BitReader, BitWriter
from onboard.messages.fields import Addition, Field, FixedField, Optional

RecordT = TypeVar("RecordT")


class Record(Field, Generic[RecordT]):
    """SEQUENCE, as a frozen dataclass. Extension additions that it does not declare are skipped."""

    def __init__(self, record: type[RecordT], *, extensible: bool = False) -> None:
        self.record = record
        self.extensible = extensible
        self.fields = _declared_fields(record)
        self._additions = {
            each.place: (name, each)
            for name, each in self.fields.items()
            if isinstance(each, Addition)
        }
        self._optional = [name for name, each in self.fields.items() if isinstance(each, Optional)]
        self._preamble_bits = extensible + len(self._optional)
        self._extended = extensible << len(self._optional)
        self._steps = self._group()
        self._fixed: _FixedRecord | None = None
        match self._steps:
            case [_Run() as run] if not self._preamble_bits:
                self._fixed = _FixedRecord(record, run)
        bits = 1 if self._fixed is None else self._fixed.bits
        self._size_bytes = None if bits % 8 else bits // 8

    @property
    @override
    def fixed(self) -> FixedField | None:
        return self._fixed

    @property
    def fixed_bits(self) -> int:
        """Size of every encoding. Raises `TypeError` if it varies."""
        if self._fixed is None:
            raise TypeError(f"{self.record.__name__} has no fixed size")
        return self._fixed.bits

    @property
    def size_bytes(self) -> int:
        """Size of every encoding. Raises `TypeError` if it varies or is not whole bytes."""
        if self._size_bytes is None:
            bits = "a varying number of" if self._fixed is None else self._fixed.bits
            raise TypeError(f"{self.record.__name__} is {bits} bits long, not whole bytes")
        return self._size_bytes

    def encode(self, value: RecordT) -> bytes:
        """Return `value` as a whole encoding. Raises `ValueError`, naming the field."""
        if self._fixed is not None and self._size_bytes is not None:
            return self._fixed.to_raw(value).to_bytes(self._size_bytes)
        writer = BitWriter()
        self.put(writer, value)
        return writer.finish()

    def decode(self, data: bytes) -> RecordT:
        """Read a whole encoding.

        Raises:
            DecodeError: `too_short`, `out_of_range`, `too_long` or `trailing_bytes`.
        """
        value: RecordT
        if self._fixed is not None and self._size_bytes is not None:
            if len(data) != self._size_bytes:
                reason = "too_short" if len(data) < self._size_bytes else "trailing_bytes"
                raise DecodeError(reason, f"{len(data)} bytes instead of {self._size_bytes}")
            value = self._fixed.from_raw(int.from_bytes(data))
            return value
        reader = BitReader(data)
        value = self.take(reader)
        if reader.left >= 8:
            raise DecodeError("trailing_bytes", f"{reader.left // 8} bytes left over")
        return value

    @override
    def put(self, writer: BitWriter, value: RecordT) -> None:
        added = self._added(value) if self._additions else []
        if self.extensible:
            writer.put(bool(added), 1)
        for name in self._optional:
            writer.put(getattr(value, name) is not None, 1)
        for step in self._steps:
            if isinstance(step, _Run):
                writer.put(step.to_raw(value), step.bits)
                continue
            name, field, presence = step
            content = getattr(value, name)
            if content is None and presence:
                continue
            try:
                field.put(writer, content)
            except ValueError as error:
                raise ValueError(f"{self.record.__name__}.{name}: {error}") from error
        if added:
            self._put_additions(writer, value, added)

    def _added(self, value: RecordT) -> list[int]:
        return [
            place
            for place, (name, _) in self._additions.items()
            if getattr(value, name) is not None
        ]

    def _put_additions(self, writer: BitWriter, value: RecordT, added: list[int]) -> None:
        """Append extension additions: their number, which there are, each (X.691, 19.7 to 19.9)."""
        writer.put_small_number(max(added))
        for place in range(max(added) + 1):
            writer.put(place in added, 1)
        for place in sorted(added):
            name, field = self._additions[place]
            field.put(writer, getattr(value, name))

    @override
    def take(self, reader: BitReader) -> RecordT:
        present = reader.take(self._preamble_bits)
        values: list[Any] = []
        for step in self._steps:
            if isinstance(step, _Run):
                values += step.from_raw(reader.take(step.bits))
                continue
            _, field, presence = step
            values.append(None if presence & ~present else field.take(reader))
        if present & self._extended:
            return self.record(*values, **self._take_additions(reader))
        return self.record(*values)

    def _take_additions(self, reader: BitReader) -> dict[str, Any]:
        """Return the declared extension additions that there are, by name, and skip the others."""
        count = reader.length() if reader.take(1) else reader.take(6) + 1
        present = reader.take(count)
        additions = {}
        for place in range(count):
            if not present >> (count - 1 - place) & 1:
                continue
            if place in self._additions:
                name, field = self._additions[place]
                additions[name] = field.take(reader)
            else:
                reader.octets()
        return additions

    def as_dict(self, value: RecordT) -> dict[str, Any]:
        """Return `value` as it stands in a trace line, whatever its codes."""
        return {name: field.printed(getattr(value, name)) for name, field in self.fields.items()}

    @override
    def printed(self, value: RecordT) -> dict[str, Any]:
        return self.as_dict(value)

    def table(self, first: int = 0, end: int | None = None) -> str:
        """Return the declaration in columns for the documentation, indented as Markdown's code is.

        Consecutive fields of the same declaration share a row.

        Args:
            first: index of the first field in the table.
            end: index of the first field after it.
        """
        rows: list[tuple[str, str, str]] = []
        for name, field in list(self.fields.items())[first:end]:
            bits = "varies" if field.fixed is None else str(field.fixed.bits)
            if rows and rows[-1][1:] == (bits, _content(field)):
                rows[-1] = (f"{rows[-1][0]}, {name}", *rows[-1][1:])
            else:
                rows.append((name, bits, _content(field)))
        lines = [("field", "bits each", "content"), *rows]
        return "\n".join(f"    {name:<26}  {bits:<9}  {content}" for name, bits, content in lines)

    @override
    def row(self) -> tuple[str, str, str]:
        return self.record.__name__, "", ""

    def _group(self) -> "list[_Run | tuple[str, Field, int]]":
        """Return the fields in their order, consecutive ones of fixed size as one `_Run`.

        A field of varying size stands with its name and its presence bit (0: always present).
        """
        steps: list[_Run | tuple[str, Field, int]] = []
        run: dict[str, FixedField] = {}
        for name, field in self.fields.items():
            if isinstance(field, Addition):
                continue
            if field.fixed is not None:
                run[name] = field.fixed
                continue
            if run:
                steps.append(_Run(run))
                run = {}
            if isinstance(field, Optional):
                presence = 1 << len(self._optional) - 1 - self._optional.index(name)
                steps.append((name, field.field, presence))
            else:
                steps.append((name, field, 0))
        return [*steps, _Run(run)] if run else steps


def _content(field: Field) -> str:
    """Return unit, range and "unavailable" code of a field, for a documentation table."""
    unit, meaning, unavailable = field.row()
    content = meaning if unit in {"", "bytes", "code", "count", "flags"} else f"{unit}: {meaning}"
    return f"{content}; unavailable: {unavailable}" if unavailable else content


class _Run:
    """Consecutive fields of fixed size in a record, read and written as one number."""

    def __init__(self, fixed: dict[str, FixedField]) -> None:
        self.bits = left = sum(field.bits for field in fixed.values())
        self._writers = [(name, field.to_raw, field.bits) for name, field in fixed.items()]
        self.readers: list[tuple[Callable[[int], Any], int, int]] = []
        """Decoder, shift and mask of each field."""
        for field in fixed.values():
            left -= field.bits
            self.readers.append((field.from_raw, left, (1 << field.bits) - 1))

    def to_raw(self, record: object) -> int:
        number = 0
        for name, to_raw, bits in self._writers:
            try:
                number = number << bits | to_raw(getattr(record, name))
            except ValueError as error:
                raise ValueError(f"{type(record).__name__}.{name}: {error}") from error
        return number

    def from_raw(self, raw: int) -> list[Any]:
        return [read(raw >> shift & mask) for read, shift, mask in self.readers]


class _FixedRecord(FixedField):
    """A record all fields of which have a fixed size and are always present."""

    def __init__(self, record: type[Any], run: _Run) -> None:
        self.bits = run.bits
        self._record = record
        self._run = run
        self._readers = run.readers

    @override
    def to_raw(self, value: object) -> int:
        return self._run.to_raw(value)

    @override
    def from_raw(self, raw: int) -> Any:
        return self._record(*[read(raw >> shift & mask) for read, shift, mask in self._readers])


def _declared_fields(record: type[Any]) -> dict[str, Field]:
    hints = get_type_hints(record, include_extras=True)
    return {
        field.name: next(part for part in hints[field.name].__metadata__ if isinstance(part, Field))
        for field in fields(record)
        if get_origin(hints[field.name]) is Annotated
    }
