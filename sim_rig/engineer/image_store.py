"""Stores camera images by car and time."""

from bisect import bisect_right
from collections import deque


class ImageStore:
    """Keeps the newest images of all cars within a number of bytes."""

    def __init__(self, max_bytes: int) -> None:
        self._max_bytes = max_bytes
        self._bytes = 0
        self._stamps: dict[str, deque[float]] = {}
        self._images: dict[str, deque[bytes]] = {}
        self._order: deque[str] = deque()

    def add(self, car: str, stamp_s: float, jpeg: bytes) -> None:
        """Add an image; images of one car come in order of time.

        Args:
            car: name of the car.
            stamp_s: monotonic time of the image, s.
            jpeg: the image.
        """
        self._stamps.setdefault(car, deque()).append(stamp_s)
        self._images.setdefault(car, deque()).append(jpeg)
        self._order.append(car)
        self._bytes += len(jpeg)
        while self._bytes > self._max_bytes:
            oldest = self._order.popleft()
            self._stamps[oldest].popleft()
            self._bytes -= len(self._images[oldest].popleft())

    def at(self, car: str, stamp_s: float) -> tuple[float, bytes] | None:
        """Return stamp and image of a car's last image at `stamp_s`; `None` if there is none."""
        stamps = self._stamps.get(car, ())
        index = bisect_right(stamps, stamp_s) - 1
        return None if index < 0 else (stamps[index], self._images[car][index])
