"""Work in slices: a generator that yields where something more urgent may be done."""

from collections.abc import Generator
from typing import TypeVar

ResultT = TypeVar("ResultT")


def result_of(slices: Generator[None, None, ResultT]) -> ResultT:
    """Do all slices at once, and return their result."""
    while True:
        try:
            next(slices)
        except StopIteration as end:
            result: ResultT = end.value
            return result
