"""Decodes the recorded inputs of the cores."""

from collections.abc import Callable
from dataclasses import MISSING, Field, fields, is_dataclass
from enum import Enum
from functools import cache
from types import UnionType
from typing import Any, get_args, get_origin, get_type_hints

from onboard.errors import UserError
from onboard.recorder.reader import Entry
from onboard.recorder.records import EntropyInput, Identity, RecordingGap, StepEnd
from onboard.step import Input

RecordedInput = Input | StepEnd | Identity | EntropyInput | RecordingGap
"""What a step receives, and what the recorder adds to it."""

_BY_KIND = {kind.kind: kind for kind in get_args(RecordedInput)}


def as_input(entry: Entry) -> RecordedInput:
    """Return the recorded value.

    Raises:
        UserError: the kind of input is unknown, or a field is missing or of another type.
    """
    value_type = _BY_KIND.get(entry.topic.rpartition("/")[2])
    if value_type is None:
        raise UserError(f"unknown input in the recording: {entry}")
    try:
        value: RecordedInput = _reader(value_type)(entry.record)
    except (KeyError, TypeError, ValueError) as error:
        raise UserError(f"invalid input in the recording: {entry}: {error}") from error
    return value


Reader = Callable[[Any], Any]


@cache
def _reader(value_type: type) -> Reader:
    hints = get_type_hints(value_type)
    readers = {field.name: _reader_of(hints[field.name]) for field in fields(value_type)}
    # An older recording lacks the fields that were added since, which have defaults.
    optional = {field.name for field in fields(value_type) if _has_default(field)}

    def read(record: dict[str, Any]) -> Any:
        names = (name for name in readers if name in record or name not in optional)
        return value_type(**{name: readers[name](record[name]) for name in names})

    return read


def _has_default(field: Field[Any]) -> bool:
    return field.default is not MISSING or field.default_factory is not MISSING


def _reader_of(hint: Any) -> Reader:
    if get_origin(hint) is UnionType:
        (inner,) = (each for each in get_args(hint) if each is not type(None))
        reader = _reader_of(inner)
        return lambda value: None if value is None else reader(value)
    if get_origin(hint) is tuple:
        inner, _ = get_args(hint)  # tuple[X, ...]
        reader = _reader_of(inner)
        return lambda value: tuple(map(reader, value))
    return _reader_of_one(hint)


def _reader_of_one(kind: type) -> Reader:
    if kind is bytes:
        return bytes.fromhex
    if kind is float:
        return float  # also reads the strings of infinite values and NaN
    if is_dataclass(kind):
        return _reader(kind)
    if issubclass(kind, Enum):
        return kind
    return lambda value: _checked(value, kind)


def _checked(value: Any, kind: type) -> Any:
    if type(value) is not kind:
        raise TypeError(f"{value!r} is not a {kind.__name__}")
    return value
