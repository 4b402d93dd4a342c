"""Types of settings: shares, positive numbers, several values, intervals, and profiles."""

from collections.abc import Mapping
from typing import Annotated, TypeVar, get_args, get_origin

from pydantic import AfterValidator, BaseModel, BeforeValidator, Field
from pydantic.fields import FieldInfo

ValueT = TypeVar("ValueT")

Share = Annotated[float, Field(ge=0.0, le=1.0)]
Positive = Annotated[float, Field(gt=0.0)]
NotNegative = Annotated[float, Field(ge=0.0)]


def _each_once(values: tuple[ValueT, ...]) -> tuple[ValueT, ...]:
    """Reject repeated values, which would be run and counted twice."""
    if not values:
        raise ValueError("must have at least one value")
    if len(set(values)) < len(values):
        raise ValueError("must not repeat a value")
    return values


def _in_order(span: tuple[float, float]) -> tuple[float, float]:
    if span[0] > span[1]:
        raise ValueError("must be in ascending order")
    return span


Several = Annotated[tuple[ValueT, ...], AfterValidator(_each_once)]
"""Different values that a study varies."""
Span = Annotated[tuple[ValueT, ValueT], AfterValidator(_in_order)]
"""Interval: lower and upper bound."""


def with_lists_of_one(tree: object, schema: type[BaseModel]) -> object:
    """Return settings in which a single value is a list of one where several are allowed.

    A validator cannot do it: what follows one reads no JSON, in which a list may be a tuple.

    Args:
        tree: as it is given, right or not.
        schema: what it is to become.
    """
    if not isinstance(tree, Mapping):
        return tree
    return {name: _listed(value, schema.model_fields.get(name)) for name, value in tree.items()}


def _listed(given: object, field: FieldInfo | None) -> object:
    if field is None:
        return given
    inner = field.annotation
    if get_origin(inner) is tuple and get_args(inner)[-1] is Ellipsis:
        return given if isinstance(given, list | tuple) else [given]
    is_section = isinstance(inner, type) and issubclass(inner, BaseModel)
    return with_lists_of_one(given, inner) if is_section else given


def by_name(kind: str, profiles: Mapping[str, object]) -> BeforeValidator:
    """Let a setting be given by the name of a profile too."""

    def named(given: object) -> object:
        if not isinstance(given, str):
            return given
        if given not in profiles:
            raise ValueError(f"no such {kind} (given {given!r}): {', '.join(profiles)}")
        return profiles[given]

    return BeforeValidator(named)
