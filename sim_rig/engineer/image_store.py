"""The pictures that the cameras took, so that any moment can be looked at again."""

from bisect import bisect_right
from collections import deque


class ImageStore:
    """Keeps the newest pictures of all cars within so many bytes."""

    def __init__(self, most_bytes: int) -> None:
        self._most_bytes = most_bytes
        self._bytes = 0
        self._stamps: dict[str, deque[float]] = {}
        self._pictures: dict[str, deque[bytes]] = {}
        self._order: deque[str] = deque()

    def add(self, car: str, stamp_s: float, jpeg: bytes) -> None:
        """A picture; those of one car come in order."""
        self._stamps.setdefault(car, deque()).append(stamp_s)
        self._pictures.setdefault(car, deque()).append(jpeg)
        self._order.append(car)
        self._bytes += len(jpeg)
        while self._bytes > self._most_bytes:
            oldest = self._order.popleft()
            self._stamps[oldest].popleft()
            self._bytes -= len(self._pictures[oldest].popleft())

    def at(self, car: str, stamp_s: float) -> tuple[float, bytes] | None:
        """The last picture of a car at that time, with its own; `None` if there is none."""
        stamps = self._stamps.get(car, ())
        index = bisect_right(stamps, stamp_s) - 1
        return None if index < 0 else (stamps[index], self._pictures[car][index])
