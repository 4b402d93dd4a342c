"""Distributes the latest item to any number of readers. There is no queue: slow readers miss items.

The buffers of the operating system would still queue, for minutes if a telephone has lost its
network. So a reader confirms the items, and at most `MOST_UNCONFIRMED` are sent without.
"""

import asyncio
from typing import Generic, TypeVar

ItemT = TypeVar("ItemT")

MOST_UNCONFIRMED = 2
"""One item on its way to the reader, and one whose confirmation is on its way back."""


class Feed(Generic[ItemT]):
    """Holds the latest item."""

    def __init__(self) -> None:
        """Start without an item."""
        self._items: list[ItemT] = []
        self._number = 0
        self._published = asyncio.Event()

    @property
    def number(self) -> int:
        """Number of items published so far."""
        return self._number

    def publish(self, item: ItemT) -> None:
        """Replace the item and wake waiting readers."""
        self._items = [item]
        self._number += 1
        published, self._published = self._published, asyncio.Event()
        published.set()

    async def after(self, number: int) -> tuple[int, ItemT]:
        """Wait for another item than `number`; return the latest item and its number."""
        while self._number == number or not self._items:
            await self._published.wait()
        return self._number, self._items[0]


class FeedReader(Generic[ItemT]):
    """One reader of a feed."""

    def __init__(self, feed: Feed[ItemT]) -> None:
        """Start with the next item, since the present one may be old."""
        self._feed = feed
        self._taken = self._confirmed = feed.number
        self._unconfirmed = 0
        self._may_send = asyncio.Event()
        self._may_send.set()

    async def next(self) -> tuple[int, ItemT]:
        """Wait until an item may be sent; return its number and the item."""
        await self._may_send.wait()
        self._taken, item = await self._feed.after(self._taken)
        self._unconfirmed += 1
        if self._unconfirmed >= MOST_UNCONFIRMED:
            self._may_send.clear()
        return self._taken, item

    def confirm(self, number: int) -> None:
        """Confirm the item with this number, and all before it."""
        if self._confirmed < number <= self._taken:
            self._confirmed = number
            self._unconfirmed = 0 if number == self._taken else MOST_UNCONFIRMED - 1
            self._may_send.set()
