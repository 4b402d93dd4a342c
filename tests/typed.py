"""Values of which a test knows more than their types say: what is not so fails the test."""

from collections.abc import Iterable
from typing import TypeVar, cast

import pytest

T = TypeVar("T")


def a(kind: type[T], value: object) -> T:
    """The value, which must be of this kind."""
    assert isinstance(value, kind), f"no {kind.__name__}: {value}"
    return value


def every(kind: type[T], values: Iterable[object]) -> list[T]:
    """The values, each of which must be of this kind."""
    return [a(kind, value) for value in values]


def about(value: float, tolerance: float | None = None) -> float:
    """A number in an expected record, to which the found one is to be roughly equal."""
    return cast("float", pytest.approx(value, abs=tolerance))
