"""Readers of the latest text; nothing is queued for a slow reader."""

import asyncio
from collections.abc import Awaitable
from typing import TypeVar

import pytest

from onboard.hmi.feed import MOST_UNCONFIRMED, Feed, FeedReader

T = TypeVar("T")


async def soon(work: Awaitable[T]) -> T:
    return await asyncio.wait_for(work, 1.0)


async def is_blocked(work: Awaitable[object]) -> None:
    """Check that `work` waits."""
    with pytest.raises(TimeoutError):
        await asyncio.wait_for(work, 0.0)


def test_a_reader_that_confirms_gets_every_item() -> None:
    async def read() -> list[str]:
        feed: Feed[str] = Feed()
        reader = FeedReader(feed)
        texts = []
        for text in ("a", "b", "c", "d"):
            feed.publish(text)
            number, got = await soon(reader.next())
            reader.confirm(number)
            texts.append(got)
        return texts

    assert asyncio.run(read()) == ["a", "b", "c", "d"]


def test_a_slow_reader_misses_items_and_gets_the_latest() -> None:
    async def read() -> None:
        feed: Feed[str] = Feed()
        reader = FeedReader(feed)
        numbers = []
        for text in ("a", "b"):
            feed.publish(text)
            numbers.append((await soon(reader.next()))[0])
        assert len(numbers) == MOST_UNCONFIRMED
        for text in ("c", "d", "e"):
            feed.publish(text)
            await is_blocked(reader.next())

        reader.confirm(numbers[0])

        assert (await soon(reader.next()))[1] == "e"

    asyncio.run(read())


def test_a_new_reader_starts_with_the_next_item() -> None:
    async def read() -> None:
        feed: Feed[str] = Feed()
        feed.publish("long ago")
        reader = FeedReader(feed)

        await is_blocked(reader.next())
        feed.publish("now")

        assert (await soon(reader.next()))[1] == "now"

    asyncio.run(read())


@pytest.mark.parametrize("confirmed", [0, -1, 99])
def test_a_confirmation_of_an_item_that_was_not_sent_is_ignored(confirmed: int) -> None:
    async def read() -> None:
        feed: Feed[str] = Feed()
        reader = FeedReader(feed)
        for text in ("a", "b"):
            feed.publish(text)
            await soon(reader.next())
        feed.publish("c")

        reader.confirm(confirmed)

        await is_blocked(reader.next())

    asyncio.run(read())
