"""Work in slices: a generator that yields where something more urgent may be done."""

from collections.abc import Generator, Iterator, Sequence
from typing import TypeVar

ItemT = TypeVar("ItemT")
ResultT = TypeVar("ResultT")


def result_of(slices: Generator[None, None, ResultT]) -> ResultT:
    """Do all slices at once, and return their result."""
    while True:
        try:
            next(slices)
        except StopIteration as end:
            result: ResultT = end.value
            return result


def batches(items: Sequence[ItemT], size: int) -> Iterator[Sequence[ItemT]]:
    """Yield the items, `size` at a time and the rest."""
    for first in range(0, len(items), size):
        yield items[first : first + size]
