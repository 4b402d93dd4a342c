"""One JSON line per observation, transition, message and warning.

A line has `stamp_s`, `kind`, and then the fields of the event under their own names. A trace leaves
out fields declared with the metadata `{"traced": False}`; a recording has them. The metadata
`traced_as` is a function that is applied to the field's value.
"""

import json
import math
from collections.abc import Callable, Sequence
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
    return _head(event) | _plain_values(event, _traced_columns(type(event)))


def traced_fields(event_type: type) -> tuple[str, ...]:
    """Return the names of the fields that a trace has of an event, beside its kind."""
    return tuple(name for name, _ in _traced_columns(event_type))


def as_line(event: Event) -> str:
    """Return the event as one line of JSON.

    Raises:
        TypeError: as in `as_record`.
    """
    return as_json(as_record(event))


def as_json(record: Any) -> str:
    """Return the record as one line; numbers that are not finite become strings."""
    try:
        return _ENCODER.encode(record)
    except ValueError:
        return _ENCODER.encode(_finite(record))


_ENCODER = json.JSONEncoder(separators=(",", ":"), allow_nan=False)
"""Made once: `json.dumps` would make one for each line."""


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
    return _head(event) | _plain_values(event, _columns(type(event)))


def _head(event: Event) -> dict[str, Any]:
    return {"stamp_s": event.stamp_s, "kind": event.kind}


_Columns = tuple[tuple[str, Callable[[Any], Any] | None], ...]
"""Name of each field, and the function that is applied to its value, if there is one."""
_PLAIN_TYPES = frozenset({str, int, float, bool, type(None)})


@cache
def _columns(record_type: type) -> _Columns:
    return tuple((each.name, each.metadata.get("traced_as")) for each in fields(record_type))


@cache
def _traced_columns(event_type: type) -> _Columns:
    traced = {each.name for each in fields(event_type) if each.metadata.get("traced", True)}
    return tuple(each for each in _columns(event_type) if each[0] in traced)


def _plain_values(value: object, columns: _Columns) -> dict[str, Any]:
    """Return fields in the types of JSON; most have them, and need no look-up of a conversion."""
    record = {}
    for name, traced_as in columns:
        item = getattr(value, name)
        if traced_as is not None:
            item = traced_as(item)
        record[name] = item if type(item) in _PLAIN_TYPES else _plain(item)
    return record


@singledispatch
def _plain(value: object) -> Any:  # a dataclass becomes an object
    value_type: type = type(value)
    if is_dataclass(value):
        return _plain_values(value, _columns(value_type))
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
