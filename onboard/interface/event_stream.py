"""Hands each line to any number of readers, which may be slow: what waits for one is bounded."""

import asyncio
import json
from collections.abc import Collection, Mapping

MOST_WAITING_BYTES = 1 << 18
"""For one reader; above it, all that waits is dropped."""


def line_of(record: Mapping[str, object]) -> bytes:
    """Return a record as a line of the stream."""
    return json.dumps(record).encode() + b"\n"


class EventReader:
    """The lines for one reader, in order. It is told how many were dropped."""

    def __init__(self) -> None:
        """Start with all kinds of events."""
        self._kinds: frozenset[str] | None = None
        self._waiting: list[bytes] = []
        self._bytes = self._dropped = 0
        self._arrived = asyncio.Event()

    def subscribe(self, kinds: Collection[str]) -> None:
        """Take only events of these kinds from now on."""
        self._kinds = frozenset(kinds)

    def wants(self, kind: str) -> bool:
        """Whether it takes events of a kind."""
        return self._kinds is None or kind in self._kinds

    def put(self, line: bytes) -> None:
        """Add a line."""
        if self._bytes + len(line) > MOST_WAITING_BYTES:
            self._dropped += len(self._waiting)
            self._waiting.clear()
            self._bytes = 0
        self._waiting.append(line)
        self._bytes += len(line)
        self._arrived.set()

    async def next(self) -> bytes:
        """Wait for lines, and return all that wait."""
        await self._arrived.wait()
        self._arrived.clear()
        lines, self._waiting = self._waiting, []
        if self._dropped:
            lines.insert(0, line_of({"kind": "lines_dropped", "lines": self._dropped}))
        self._bytes = self._dropped = 0
        return b"".join(lines)


class EventStream:
    """All readers."""

    def __init__(self) -> None:
        """Start without readers."""
        self._readers: set[EventReader] = set()

    def open(self) -> EventReader:
        """Return a new reader, which gets all that is published from now on."""
        reader = EventReader()
        self._readers.add(reader)
        return reader

    def close(self, reader: EventReader) -> None:
        """Drop a reader."""
        self._readers.discard(reader)

    def wants(self, kind: str) -> bool:
        """Whether any reader takes events of a kind."""
        return any(reader.wants(kind) for reader in self._readers)

    def publish(self, kind: str, line: bytes) -> None:
        """Give the readers an event's line, which ends with a newline."""
        for reader in self._readers:
            if reader.wants(kind):
                reader.put(line)
