"""Types of settings: shares, positive numbers, lists of different values, and intervals."""

from typing import Annotated, TypeVar

from pydantic import AfterValidator, Field

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
