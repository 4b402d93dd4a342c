"""One JSON line per observation, transition, message and warning.

A trace line is the event itself: its `stamp_s`, its `kind`, then its fields under their own names.
"""

import json
from dataclasses import fields, is_dataclass
from enum import Enum
from typing import Any, ClassVar, Protocol


class Event(Protocol):
    """Anything that can become a trace line: a dataclass with a stamp and a kind."""

    kind: ClassVar[str]

    @property
    def stamp_s(self) -> float:
        """When it happened, on the clock of the cores."""


def as_line(event: Event, **more: float) -> str:
    """The event as one line of JSON, with `more` fields of the edge that writes it.

    Raises:
        TypeError: a field has a type that has no form in JSON.
    """
    head = {"stamp_s": event.stamp_s, "kind": event.kind}
    return json.dumps(head | _fields_of(event) | more, default=_plain, separators=(",", ":"))


def as_record(event: Event) -> dict[str, Any]:
    """What a reader of the trace gets from `as_line`."""
    record: dict[str, Any] = json.loads(as_line(event))
    return record


def _fields_of(value: Any) -> dict[str, Any]:
    return {field.name: getattr(value, field.name) for field in fields(value)}


def _plain(value: object) -> object:
    """What JSON lacks: bytes as hex, enums as their value, dataclasses as objects, sets sorted."""
    if isinstance(value, bytes):
        return value.hex()
    if isinstance(value, Enum):
        return value.value
    if isinstance(value, frozenset):
        return sorted(value)
    if is_dataclass(value):
        return _fields_of(value)
    raise TypeError(f"{type(value).__name__} has no form in a trace")
