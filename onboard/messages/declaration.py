"""Fixed-width messages, declared once.

A message is a frozen dataclass whose annotations say what each field is on the wire:

    speed_m_s: Annotated[float | None, Number(13, 0.02, "m/s", highest=8190, unavailable=8191)]

`Layout` reads that declaration; encoding, decoding, printing, documentation and the property tests
all go through it. Fields follow one another without padding, most significant bit first.
"""

from collections.abc import Callable
from dataclasses import dataclass, fields
from enum import Enum
from typing import Any, Generic, TypeVar, get_type_hints

from typing_extensions import override

from onboard.errors import DecodeError


@dataclass(frozen=True, slots=True)
class Wire:
    """How one field is carried, in `bits` bits. This one is a whole number from 0."""

    bits: int

    def to_raw(self, value: Any) -> int:
        """Return the unsigned number to send; `ValueError` if there is none for `value`."""
        if not 0 <= value < 1 << self.bits:
            raise ValueError(f"{value} does not fit {self.bits} bits")
        return int(value)

    def from_raw(self, raw: int) -> Any:
        """Return what `raw` says; `DecodeError` if the declaration gives it no meaning."""
        return raw

    def printed(self, value: Any) -> Any:
        """Return `value` as it stands in a trace line."""
        return value

    def row(self) -> tuple[str, str, str]:
        """Return unit or type, range, and the code of "unavailable", for the documentation."""
        return "count", f"0 to {(1 << self.bits) - 1}", ""


@dataclass(frozen=True, slots=True)
class Number(Wire):
    """Steps of `scale`, `lowest` to `highest` of them; what lies beyond is sent as the end."""

    scale: float
    unit: str
    highest: int
    lowest: int = 0
    """Two's complement if negative."""
    unavailable: int | None = None
    """The code of `None`, in the same steps, outside the range."""

    @override
    def to_raw(self, value: float | None) -> int:
        if value is not None:
            steps = round(min(max(value / self.scale, self.lowest), self.highest))
        elif self.unavailable is not None:
            steps = self.unavailable
        else:
            raise ValueError("is never unavailable")
        return steps & (1 << self.bits) - 1

    @override
    def from_raw(self, raw: int) -> float | None:
        steps = raw - (1 << self.bits) if self.lowest < 0 and raw >> self.bits - 1 else raw
        if steps == self.unavailable:
            return None
        if not self.lowest <= steps <= self.highest:
            raise DecodeError("out_of_range", f"{steps} is not {self.lowest} to {self.highest}")
        return steps * self.scale

    @override
    def row(self) -> tuple[str, str, str]:
        low, high = self.lowest * self.scale, self.highest * self.scale
        code = "" if self.unavailable is None else str(self.unavailable)
        return self.unit, f"{low:g} to {high:g} by {self.scale:g}", code


@dataclass(frozen=True, slots=True)
class Octets(Wire):
    """Exactly `bits / 8` bytes."""

    @override
    def to_raw(self, value: bytes) -> int:
        if len(value) * 8 != self.bits:
            raise ValueError(f"{value!r} has not {self.bits // 8} bytes")
        return int.from_bytes(value)

    @override
    def from_raw(self, raw: int) -> bytes:
        return raw.to_bytes(self.bits // 8)

    @override
    def printed(self, value: bytes) -> str:
        return value.hex()

    @override
    def row(self) -> tuple[str, str, str]:
        return "bytes", f"{self.bits // 8} bytes", ""


@dataclass(frozen=True, slots=True)
class Code(Wire):
    """A member of `names`; a code that a later version added survives as its number."""

    names: type[Enum]

    @override
    def to_raw(self, value: Enum | int) -> int:
        return Wire.to_raw(self, value.value if isinstance(value, Enum) else value)

    @override
    def from_raw(self, raw: int) -> Enum | int:
        return next((name for name in self.names if name.value == raw), raw)

    @override
    def printed(self, value: Enum | int) -> str:
        return value.name.lower() if isinstance(value, Enum) else f"unknown_{value}"

    @override
    def row(self) -> tuple[str, str, str]:
        return "code", ", ".join(f"{name.value} {name.name.lower()}" for name in self.names), ""


MessageT = TypeVar("MessageT")


class Layout(Generic[MessageT]):
    """The wire form of one message class, read from its annotations."""

    def __init__(self, message: type[MessageT]) -> None:
        hints = get_type_hints(message, include_extras=True)
        self.message = message
        self.wires: dict[str, Wire] = {
            field.name: next(
                part for part in hints[field.name].__metadata__ if isinstance(part, Wire)
            )
            for field in fields(message)  # type: ignore[arg-type]
        }
        bits = sum(wire.bits for wire in self.wires.values())
        if bits % 8:
            raise TypeError(f"{message.__name__} is {bits} bits long, not whole bytes")
        self.size_bytes = bits // 8
        self._readers: list[tuple[Callable[[int], Any], int, int]] = []
        """What reads each field, its shift and its mask."""
        for wire in self.wires.values():
            bits -= wire.bits
            self._readers.append((wire.from_raw, bits, (1 << wire.bits) - 1))

    def encode(self, message: MessageT) -> bytes:
        """Return `size_bytes` bytes. Raises `ValueError` naming a field that cannot be carried."""
        number = 0
        for name, wire in self.wires.items():
            try:
                number = number << wire.bits | wire.to_raw(getattr(message, name))
            except ValueError as error:
                raise ValueError(f"{self.message.__name__}.{name}: {error}") from error
        return number.to_bytes(self.size_bytes)

    def decode(self, data: bytes) -> MessageT:
        """Read back. Raises `DecodeError`: `too_short`, `trailing_bytes` or `out_of_range`."""
        if len(data) != self.size_bytes:
            reason = "too_short" if len(data) < self.size_bytes else "trailing_bytes"
            raise DecodeError(reason, f"{len(data)} bytes instead of {self.size_bytes}")
        number = int.from_bytes(data)
        return self.message(*[read(number >> shift & mask) for read, shift, mask in self._readers])

    def as_dict(self, message: MessageT) -> dict[str, Any]:
        """Return the message as it stands in a trace line, whatever its codes."""
        return {name: wire.printed(getattr(message, name)) for name, wire in self.wires.items()}

    def table(self) -> str:
        """Return the declaration as a Markdown table for the documentation."""
        rows = [("field", "bits", "unit or type", "range", "unavailable"), ("---",) * 5]
        rows += [(name, str(wire.bits), *wire.row()) for name, wire in self.wires.items()]
        return "\n".join(f"| {' | '.join(row)} |" for row in rows)
