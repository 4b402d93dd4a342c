"""One JSON line per observation, transition, message and warning.

A line has `stamp_s`, `kind`, and then the fields of the event under their own names. A trace leaves
out fields declared with the metadata `{"traced": False}`; a recording has them. The metadata
`traced_as` is a function that is applied to the field's value.
"""

import json
import math
from collections.abc import Sequence
from dataclasses import fields, is_dataclass
from enum import Enum
from functools import cache, singledispatch
from typing import Any, ClassVar, Protocol


class Event(Protocol):
    """What a trace line is written from: a dataclass with a time stamp and a kind."""

    kind: ClassVar[str]

    @property
    def stamp_s(self) -> float:
        """When it happened, on the clock of the cores, in s."""


def as_trace_record(event: Event) -> dict[str, Any]:
    """Return the event as in a trace: `as_record` without the fields that are not traced.

    Raises:
        TypeError: as in `as_record`.
    """
    record = as_record(event)
    for name in _untraced(type(event)):
        del record[name]
    return record


def traced_fields(event_type: type) -> tuple[str, ...]:
    """Return the names of the fields that a trace has of an event, beside its kind."""
    untraced = _untraced(event_type)
    return tuple(each.name for each in fields(event_type) if each.name not in untraced)


@cache
def _untraced(event_type: type) -> tuple[str, ...]:
    return tuple(each.name for each in fields(event_type) if not each.metadata.get("traced", True))


def as_line(event: Event) -> str:
    """Return the event as one line of JSON.

    Raises:
        TypeError: as in `as_record`.
    """
    return as_json(as_record(event))


def as_json(record: Any) -> str:
    """Return the record as one line; numbers that are not finite become strings."""
    try:
        return json.dumps(record, separators=(",", ":"), allow_nan=False)
    except ValueError:
        return json.dumps(_finite(record), separators=(",", ":"))


def _finite(value: Any) -> Any:
    match value:
        case float() if not math.isfinite(value):
            return str(value)
        case dict():
            return {key: _finite(item) for key, item in value.items()}
        case list():
            return [_finite(item) for item in value]
    return value


def as_record(event: Event) -> dict[str, Any]:
    """Return the event in the types of JSON.

    Raises:
        TypeError: a field has a type that cannot be converted.
    """
    record = {"stamp_s": event.stamp_s, "kind": event.kind}
    record.update(_plain_fields(event))
    return record


def _plain_fields(value: Any) -> dict[str, Any]:
    return {
        field.name: _plain(field.metadata.get("traced_as", _unchanged)(getattr(value, field.name)))
        for field in fields(value)
    }


def _unchanged(value: Any) -> Any:
    return value


@singledispatch
def _plain(value: object) -> Any:  # a dataclass becomes an object
    if is_dataclass(value):
        return _plain_fields(value)
    raise TypeError(f"{type(value).__name__} cannot be written to a trace")


@_plain.register(str | int | float | None)
def _(value: float | str | None) -> float | str | None:
    return value


@_plain.register
def _(value: bytes) -> str:
    return value.hex()


@_plain.register
def _(value: Enum) -> Any:
    return value.value


@_plain.register(tuple | list)
def _(value: Sequence[object]) -> list[Any]:
    return [_plain(item) for item in value]


@_plain.register
def _(value: frozenset) -> list[Any]:  # type: ignore[type-arg]  # of any sortable type
    return [_plain(item) for item in sorted(value)]


@_plain.register
def _(value: dict) -> dict[str, Any]:  # type: ignore[type-arg]  # of any convertible type
    return {str(_plain(key)): _plain(item) for key, item in value.items()}
