"""Kinds of message fields: how each is carried, printed and described.

The names are those of ASN.1 (ITU-T X.680) where it has the kind; the bits follow the unaligned
packed encoding rules (UPER, ITU-T X.691). `FixedPoint`, `Unsigned` and `OpenEnumerated` have a
declared width, as the fields of LCCA messages and of the MVS footer.
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from enum import Enum, IntFlag
from typing import Any

from typing_extensions import override

from onboard.errors import DecodeError
from onboard.messages.bit_io import BitReader, BitWriter


class Field(ABC):
    """One field of a message."""

    @abstractmethod
    def put(self, writer: BitWriter, value: Any) -> None:
        """Append `value`; `ValueError` if it cannot be carried."""

    @abstractmethod
    def take(self, reader: BitReader) -> Any:
        """Return the next value; `DecodeError` if the bits have no meaning."""

    def row(self) -> tuple[str, str, str]:
        """Return unit or type, range, and the code of "unavailable", for a documentation table."""
        return type(self).__name__, "", ""

    def printed(self, value: Any) -> Any:
        """Return `value` as it stands in a trace line: names for codes, hex for octets."""
        return value

    @property
    def fixed(self) -> "FixedField | None":
        """This field as one that always has the same size; `None` if its size varies."""
        return None


class FixedField(Field):
    """A field of always `bits` bits, which are one unsigned number."""

    bits: int

    @abstractmethod
    def to_raw(self, value: Any) -> int:
        """Return the number that stands for `value`; `ValueError` if there is none."""

    @abstractmethod
    def from_raw(self, raw: int) -> Any:
        """Return the value of `raw`; `DecodeError` if it has no meaning."""

    @override
    def put(self, writer: BitWriter, value: Any) -> None:
        writer.put(self.to_raw(value), self.bits)

    @override
    def take(self, reader: BitReader) -> Any:
        return self.from_raw(reader.take(self.bits))

    @property
    @override
    def fixed(self) -> "FixedField":
        return self


class Integer(FixedField):
    """INTEGER (lowest..highest), a count or a code: its offset from `lowest` (X.691, 11.5)."""

    def __init__(self, lowest: int, highest: int) -> None:
        self.lowest = lowest
        self.highest = highest
        self.bits = (highest - lowest).bit_length()

    @override
    def to_raw(self, value: int) -> int:
        if not self.lowest <= value <= self.highest:
            raise ValueError(f"{value} is not {self.lowest} to {self.highest}")
        return int(value) - self.lowest

    @override
    def from_raw(self, raw: int) -> int:
        value = raw + self.lowest
        if value > self.highest:
            raise DecodeError("out_of_range", f"{value} is above {self.highest}")
        return value

    @override
    def row(self) -> tuple[str, str, str]:
        return "count", f"{self.lowest} to {self.highest}", ""


class Unsigned(Integer):
    """INTEGER (0..2^bits - 1)."""

    def __init__(self, bits: int) -> None:
        super().__init__(0, (1 << bits) - 1)

    @override
    def from_raw(self, raw: int) -> int:
        return raw


class Boolean(FixedField):
    """BOOLEAN."""

    bits = 1

    @override
    def to_raw(self, value: bool) -> int:
        return int(value)

    @override
    def from_raw(self, raw: int) -> bool:
        return bool(raw)


class Quantity(FixedField):
    """A physical quantity in steps of `scale` `unit`, as its offset from the lowest code.

    Values beyond the range are sent as its end.
    """

    def __init__(
        self, lowest: int, highest: int, scale: float, unit: str, unavailable: int | None = None
    ) -> None:
        """Declare INTEGER (lowest..highest).

        Args:
            lowest: least number of steps.
            highest: greatest number of steps.
            scale: one step, in `unit`.
            unit: for the documentation.
            unavailable: code that stands for `None`, in steps, next to the range.
        """
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
    def to_raw(self, value: float | None) -> int:
        if value is not None:
            steps = round(min(max(value * self._per_unit, self.lowest), self.highest))
        else:
            steps = self._unavailable_code()
        return steps - self._first

    @override
    def from_raw(self, raw: int) -> float | None:
        steps = raw + self._first
        if steps == self.unavailable:
            return None
        if steps > self._last:
            raise DecodeError("out_of_range", f"{steps} steps are above {self._last}")
        # Dividing gives the float nearest to the decimal that the standard means.
        return steps / self._per_unit

    @override
    def row(self) -> tuple[str, str, str]:
        low, high = self.lowest * self.scale, self.highest * self.scale
        code = "" if self.unavailable is None else str(self.unavailable)
        return self.unit, f"{low:g} to {high:g} by {self.scale:g}", code

    def _unavailable_code(self) -> int:
        if self.unavailable is None:
            raise ValueError("is never unavailable")
        return self.unavailable


class Angle(Quantity):
    """A direction in rad, whole turns aside: -90 degrees are sent as 270."""

    def __init__(self, steps: int, unavailable: int | None = None) -> None:
        """Declare INTEGER (0..unavailable).

        Args:
            steps: of a full turn.
            unavailable: code that stands for `None`; `steps` if not given.
        """
        code = steps if unavailable is None else unavailable
        super().__init__(0, code - 1, math.tau / steps, "rad", unavailable=code)
        self._steps = steps

    @override
    def to_raw(self, value: float | None) -> int:
        if value is None:
            return self._unavailable_code()
        return round(value * self._per_unit) % self._steps


class ExtensibleQuantity(Field):
    """INTEGER (lowest..highest, ...), with scale and unit.

    What a later edition may send beyond the range is read as the end of the range.
    """

    def __init__(self, lowest: int, highest: int, scale: float, unit: str) -> None:
        """Declare the field, of 16 bits at most; see `Quantity`."""
        self.root = Quantity(lowest, highest, scale, unit)

    @override
    def put(self, writer: BitWriter, value: float) -> None:
        writer.put(0, 1)
        self.root.put(writer, value)

    @override
    def take(self, reader: BitReader) -> float | None:
        # Read at once: an extension, with its length, is longer than a value in the range.
        raw = reader.take(1 + self.root.bits)
        if not raw >> self.root.bits:
            return self.root.from_raw(raw)
        reader.left += self.root.bits
        steps = int.from_bytes(reader.octets(), signed=True)
        root = self.root
        return min(max(steps, root.lowest), root.highest) * root.scale

    @override
    def row(self) -> tuple[str, str, str]:
        return self.root.row()


class FixedPoint(Quantity):
    """A physical quantity in steps of `scale` `unit`, as a number of `bits` bits.

    It is in two's complement if `lowest` is negative. Values beyond the range are sent as its end.
    """

    def __init__(
        self,
        bits: int,
        scale: float,
        unit: str,
        *,
        highest: int,
        lowest: int = 0,
        unavailable: int | None = None,
    ) -> None:
        """Declare the field.

        Args:
            bits: width.
            scale: one step, in `unit`.
            unit: for the documentation.
            highest: greatest number of steps.
            lowest: least number of steps.
            unavailable: code that stands for `None`, in steps, outside the range.
        """
        super().__init__(lowest, highest, scale, unit, unavailable)
        self.bits = bits
        self._mask = (1 << bits) - 1
        self.negative_from = 1 << bits - (lowest < 0)
        """Raw numbers from this one on are negative."""

    @override
    def to_raw(self, value: float | None) -> int:
        if value is not None:
            steps = round(min(max(value / self.scale, self.lowest), self.highest))
        else:
            steps = self._unavailable_code()
        return steps & self._mask

    @override
    def from_raw(self, raw: int) -> float | None:
        steps = raw if raw < self.negative_from else raw - self._mask - 1
        if steps == self.unavailable:
            return None
        if not self.lowest <= steps <= self.highest:
            raise DecodeError("out_of_range", f"{steps} is not {self.lowest} to {self.highest}")
        return steps * self.scale


class OctetString(FixedField):
    """OCTET STRING (SIZE (size))."""

    def __init__(self, size: int) -> None:
        self.size = size
        self.bits = size * 8

    @override
    def to_raw(self, value: bytes) -> int:
        if len(value) != self.size:
            raise ValueError(f"{value!r} has not {self.size} bytes")
        return int.from_bytes(value)

    @override
    def from_raw(self, raw: int) -> bytes:
        return raw.to_bytes(self.size)

    @override
    def printed(self, value: bytes) -> str:
        return value.hex()

    @override
    def row(self) -> tuple[str, str, str]:
        return "bytes", f"{self.size} bytes", ""


class Enumerated(FixedField):
    """ENUMERATED without extensions: the values of the members are their positions."""

    def __init__(self, names: type[Enum], unavailable: int | None = None) -> None:
        self.names = names
        self.unavailable = unavailable
        self._members: dict[int, Enum | None] = {name.value: name for name in names}
        if unavailable is not None:
            self._members[unavailable] = None
        self._codes = {member: code for code, member in self._members.items()}
        self.bits = max(self._members).bit_length()

    @override
    def to_raw(self, value: Enum | None) -> int:
        if value not in self._codes:
            raise ValueError(f"{value!r} is not one of {[*self._codes]}")
        return self._codes[value]

    @override
    def from_raw(self, raw: int) -> Enum | None:
        try:
            return self._members[raw]
        except KeyError:
            raise DecodeError("out_of_range", f"no choice has number {raw}") from None

    @override
    def printed(self, value: Enum | None) -> str | None:
        return None if value is None else value.name.lower()

    @override
    def row(self) -> tuple[str, str, str]:
        return "code", _codes(self.names), "" if self.unavailable is None else str(self.unavailable)


class ExtensibleEnumerated(Field):
    """ENUMERATED with an extension marker: a member of `names`, or the number of a later one."""

    def __init__(self, names: type[Enum]) -> None:
        self.names = names
        self._root = Enumerated(names)
        self._additions_from = len(names)

    @override
    def put(self, writer: BitWriter, value: Enum | int) -> None:
        is_addition = not isinstance(value, Enum)
        writer.put(is_addition, 1)
        if isinstance(value, Enum):
            self._root.put(writer, value)
        else:
            writer.put_small_number(value - self._additions_from)

    @override
    def take(self, reader: BitReader) -> Enum | int | None:
        if reader.take(1):
            return self._additions_from + reader.small_number()
        return self._root.take(reader)  # type: ignore[no-any-return]

    @override
    def printed(self, value: Enum | int) -> str:
        return _printed_code(value)

    @override
    def row(self) -> tuple[str, str, str]:
        return self._root.row()


class OpenEnumerated(FixedField):
    """A code of `bits` bits: a member of `names`, or the number of a code that has no name yet."""

    def __init__(self, names: type[Enum], bits: int) -> None:
        self.names = names
        self.bits = bits
        self._members: dict[int, Enum] = {name.value: name for name in names}

    @override
    def to_raw(self, value: Enum | int) -> int:
        code: int = value.value if isinstance(value, Enum) else value
        if not 0 <= code < 1 << self.bits:
            raise ValueError(f"{code} does not fit {self.bits} bits")
        return code

    @override
    def from_raw(self, raw: int) -> Enum | int:
        return self._members.get(raw, raw)

    @override
    def printed(self, value: Enum | int) -> str:
        return _printed_code(value)

    @override
    def row(self) -> tuple[str, str, str]:
        return "code", _codes(self.names), ""


class BitString(FixedField):
    """BIT STRING (SIZE (bits)): bit i of the standard is `1 << i` in `names`."""

    def __init__(self, names: type[IntFlag], bits: int) -> None:
        self.names = names
        self.bits = bits

    @override
    def to_raw(self, value: IntFlag) -> int:
        if value >> self.bits:
            raise ValueError(f"{value!r} has more than {self.bits} bits")
        return _mirrored(value, self.bits)

    @override
    def from_raw(self, raw: int) -> IntFlag:
        return self.names(_mirrored(raw, self.bits))

    @override
    def printed(self, value: IntFlag) -> list[str]:
        return _flag_names(value)

    @override
    def row(self) -> tuple[str, str, str]:
        return "flags", _flags(self.names), ""


_KEPT_FLAGS = 16
"""Later ones are skipped: Python keeps each combination of flags for ever once it was received."""


class OpenBitString(Field):
    """BIT STRING (SIZE (bits, ...)): the next bits of later versions are flags without a name."""

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
        kept = min(bits, _KEPT_FLAGS)
        return self.names(_mirrored(reader.take(bits) >> bits - kept, kept))

    @override
    def printed(self, value: IntFlag) -> list[str]:
        return _flag_names(value)

    @override
    def row(self) -> tuple[str, str, str]:
        return "flags", _flags(self.names), ""


class OpenType(Field):
    """An open type or OCTET STRING of any length: a length, then the octets."""

    @override
    def put(self, writer: BitWriter, value: bytes) -> None:
        writer.put_octets(value)

    @override
    def take(self, reader: BitReader) -> bytes:
        return reader.octets()

    @override
    def printed(self, value: bytes) -> str:
        return value.hex()

    @override
    def row(self) -> tuple[str, str, str]:
        return "bytes", "any length", ""


class Ia5String(Field):
    """IA5String (SIZE (lowest..highest)): seven bits a character (X.691, 30.5)."""

    def __init__(self, lowest: int, highest: int) -> None:
        self.length = Integer(lowest, highest)

    @override
    def put(self, writer: BitWriter, value: str) -> None:
        if not value.isascii():
            raise ValueError(f"{value!r} is not ASCII")
        self.length.put(writer, len(value))
        for character in value:
            writer.put(ord(character), 7)

    @override
    def take(self, reader: BitReader) -> str:
        return "".join([chr(reader.take(7)) for _ in range(self.length.take(reader))])

    @override
    def row(self) -> tuple[str, str, str]:
        return "text", f"{self.length.row()[1]} characters", ""


@dataclass(frozen=True, slots=True)
class Chosen:
    """The chosen alternative of a `Choice`, with its value."""

    name: str | int
    """The alternative; the number of a later edition's, counted from 0, whose value is octets."""
    value: Any


class Choice(Field):
    """CHOICE of one of the named `alternatives`."""

    def __init__(self, alternatives: Mapping[str, Field], *, extensible: bool = False) -> None:
        self.alternatives = dict(alternatives)
        self.extensible = extensible
        self._names = tuple(self.alternatives)
        self._index = Integer(0, len(self._names) - 1)

    @override
    def put(self, writer: BitWriter, value: Chosen) -> None:
        if self.extensible:
            writer.put(isinstance(value.name, int), 1)
        if isinstance(value.name, int):
            writer.put_small_number(value.name)
            writer.put_octets(value.value)
        elif value.name in self.alternatives:
            self._index.put(writer, self._names.index(value.name))
            self.alternatives[value.name].put(writer, value.value)
        else:
            raise ValueError(f"{value.name!r} is not one of {[*self._names]}")

    @override
    def take(self, reader: BitReader) -> Chosen:
        if self.extensible and reader.take(1):
            return Chosen(reader.small_number(), reader.octets())
        name = self._names[self._index.take(reader)]
        return Chosen(name, self.alternatives[name].take(reader))

    @override
    def printed(self, value: Chosen) -> dict[str, Any]:
        if isinstance(value.name, int):
            return {f"unknown_{value.name}": value.value.hex()}
        return {value.name: self.alternatives[value.name].printed(value.value)}


class SequenceOf(Field):
    """SEQUENCE (SIZE (lowest..highest)) OF `item`, as a tuple."""

    def __init__(self, item: Field, lowest: int, highest: int, *, extensible: bool = False) -> None:
        """Declare the field.

        Args:
            item: field of each item.
            lowest: least number of items.
            highest: greatest number of items.
            extensible: whether other numbers of them may be sent.
        """
        self.item = item
        self.count = Integer(lowest, highest)
        self.extensible = extensible

    @override
    def put(self, writer: BitWriter, value: tuple[Any, ...]) -> None:
        is_other = not self.count.lowest <= len(value) <= self.count.highest
        if self.extensible:
            writer.put(is_other, 1)
        if self.extensible and is_other:
            writer.put_length(len(value))
        else:
            self.count.put(writer, len(value))
        for item in value:
            self.item.put(writer, item)

    @override
    def take(self, reader: BitReader) -> tuple[Any, ...]:
        take = self.item.take
        is_other = self.extensible and reader.take(1)
        count = reader.length() if is_other else self.count.take(reader)
        return tuple([take(reader) for _ in range(count)])

    @override
    def printed(self, value: tuple[Any, ...]) -> list[Any]:
        return [self.item.printed(item) for item in value]

    @override
    def row(self) -> tuple[str, str, str]:
        unit, meaning, unavailable = self.item.row()
        return f"list of {unit}", f"{self.count.row()[1]} of {meaning}", unavailable


class Optional(Field):
    """OPTIONAL: a field that may be left out (`None`); its record has a presence bit."""

    def __init__(self, field: Field) -> None:
        self.field = field

    @override
    def put(self, writer: BitWriter, value: Any) -> None:
        if value is not None:
            self.field.put(writer, value)

    @override
    def take(self, reader: BitReader) -> Any:
        return self.field.take(reader)

    @override
    def printed(self, value: Any) -> Any:
        return None if value is None else self.field.printed(value)

    @override
    def row(self) -> tuple[str, str, str]:
        unit, meaning, _ = self.field.row()
        return unit, meaning, "left out"


class Addition(Field):
    """A field behind the extension marker, as an open type; `None` leaves it out.

    Others skip it. It stands after all fields of its record that are none.
    """

    def __init__(self, field: Field, place: int) -> None:
        """Declare the field.

        Args:
            field: what the open type holds.
            place: among the additions, of which the first is 0.
        """
        self.field = field
        self.place = place

    @override
    def put(self, writer: BitWriter, value: Any) -> None:
        content = BitWriter()
        self.field.put(content, value)
        writer.put_octets(content.finish())

    @override
    def take(self, reader: BitReader) -> Any:
        content = BitReader(reader.octets())
        value = self.field.take(content)
        if content.left >= 8:
            raise DecodeError("trailing_bytes", f"{content.left // 8} bytes in an addition")
        return value

    @override
    def printed(self, value: Any) -> Any:
        return None if value is None else self.field.printed(value)


class RestOfMessage(Field):
    """All that follows, still encoded, as (bits, their number): the last field of a message.

    The bits that fill the last octet are among them.
    """

    @override
    def put(self, writer: BitWriter, value: tuple[int, int]) -> None:
        writer.put(*value)

    @override
    def take(self, reader: BitReader) -> tuple[int, int]:
        bits = reader.left
        return reader.take(bits), bits

    @override
    def printed(self, value: tuple[int, int]) -> str:
        return f"{value[0]:#x}/{value[1]}"


class NotRead(Field):
    """A field whose presence has every message refused: where it ends is not known here."""

    def __init__(self, reason: str, detail: str) -> None:
        self.reason, self.detail = reason, detail

    @override
    def put(self, writer: BitWriter, value: Any) -> None:
        raise ValueError(f"{value!r}: is never sent")

    @override
    def take(self, reader: BitReader) -> Any:
        raise DecodeError(self.reason, self.detail)


def _printed_code(value: Enum | int) -> str:
    return value.name.lower() if isinstance(value, Enum) else f"unknown_{value}"


def _mirrored(value: int, bits: int) -> int:
    return int(f"{value:0{bits}b}"[::-1], 2)


def _codes(names: Iterable[Enum]) -> str:
    return ", ".join(f"{name.value} {name.name.lower()}" for name in names)


def _flags(names: type[IntFlag]) -> str:
    return ", ".join(f"{flag.bit_length() - 1} {str(flag.name).lower()}" for flag in names)


def _flag_names(value: IntFlag) -> list[str]:
    known = [str(flag.name).lower() for flag in type(value) if flag in value]
    unknown = int(value) & ~sum(type(value))
    return known + [f"bit_{i}" for i in range(unknown.bit_length()) if unknown >> i & 1]
