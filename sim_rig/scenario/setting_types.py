"""Settings that are more than one value: a share, several to go through, from one to another."""

from typing import Annotated, TypeVar

from pydantic import AfterValidator, Field

ValueT = TypeVar("ValueT")

Share = Annotated[float, Field(ge=0.0, le=1.0)]
Positive = Annotated[float, Field(gt=0.0)]
NotNegative = Annotated[float, Field(ge=0.0)]


def _each_once(values: tuple[ValueT, ...]) -> tuple[ValueT, ...]:
    """What stands twice would be run, and counted, twice."""
    if not values:
        raise ValueError("must be at least one")
    if len(set(values)) < len(values):
        raise ValueError("must each stand there once")
    return values


def _in_order(span: tuple[float, float]) -> tuple[float, float]:
    if span[0] > span[1]:
        raise ValueError("must be the lesser and the greater")
    return span


Several = Annotated[tuple[ValueT, ...], AfterValidator(_each_once)]
"""What a study goes through."""
Span = Annotated[tuple[ValueT, ValueT], AfterValidator(_in_order)]
"""From one to another."""
