"""Types of settings: shares, positive numbers, several values, intervals, and profiles."""

from collections.abc import Mapping
from typing import Annotated, TypeVar

from pydantic import AfterValidator, BeforeValidator, Field

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


def by_name(kind: str, profiles: Mapping[str, object]) -> BeforeValidator:
    """Let a setting be given by the name of a profile too."""

    def named(given: object) -> object:
        if not isinstance(given, str):
            return given
        if given not in profiles:
            raise ValueError(f"no such {kind} (given {given!r}): {', '.join(profiles)}")
        return profiles[given]

    return BeforeValidator(named)
