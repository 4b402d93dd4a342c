"""The latest of something for any number of readers. Nobody queues: who is slow misses some.

Buffers of the operating system would queue all the same, for minutes where a telephone has lost its
network. So a reader confirms what it has taken, and has no more than `MOST_UNCONFIRMED` on the way.
"""

import asyncio
from typing import Generic, TypeVar

ItemT = TypeVar("ItemT")

MOST_UNCONFIRMED = 2
"""One on its way to the reader while the other's confirmation is on its way back."""


class Feed(Generic[ItemT]):
    """Holds the latest item."""

    def __init__(self) -> None:
        self._items: list[ItemT] = []
        self._number = 0
        self._news = asyncio.Event()

    @property
    def number(self) -> int:
        """How many items there have been."""
        return self._number

    def publish(self, item: ItemT) -> None:
        """Replace the item; whoever waits is told."""
        self._items = [item]
        self._number += 1
        news, self._news = self._news, asyncio.Event()
        news.set()

    async def after(self, number: int) -> tuple[int, ItemT]:
        """The latest item and its number, as soon as it is another than `number`."""
        while self._number == number or not self._items:
            await self._news.wait()
        return self._number, self._items[0]


class FeedReader(Generic[ItemT]):
    """One reader of a feed."""

    def __init__(self, feed: Feed[ItemT]) -> None:
        """Begin with the next item: the present one may be old."""
        self._feed = feed
        self._taken = self._confirmed = feed.number
        self._unconfirmed = 0
        self._room = asyncio.Event()
        self._room.set()

    async def next(self) -> tuple[int, ItemT]:
        """The latest item not yet taken, once there is room for it."""
        await self._room.wait()
        self._taken, item = await self._feed.after(self._taken)
        self._unconfirmed += 1
        if self._unconfirmed >= MOST_UNCONFIRMED:
            self._room.clear()
        return self._taken, item

    def confirm(self, number: int) -> None:
        """The reader has got the item with this number, and all before it."""
        if self._confirmed < number <= self._taken:
            self._confirmed = number
            self._unconfirmed = 0 if number == self._taken else MOST_UNCONFIRMED - 1
            self._room.set()
