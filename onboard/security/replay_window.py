"""Remembers what has been had, in bounded memory and without a gap."""

from collections import OrderedDict


class ReplayWindow:
    """The digests of messages made recently. Times are those of the messages, in microseconds."""

    def __init__(self, window_us: int, capacity: int) -> None:
        """Remember at most `capacity` messages, each until `window_us` after it was made."""
        self._window_us = window_us
        self._capacity = capacity
        self._made_at: OrderedDict[bytes, int] = OrderedDict()
        self._forgotten_us = 0

    @property
    def forgotten_us(self) -> int:
        """Nothing is known of messages made at this time or before: they must not be believed."""
        return self._forgotten_us

    def receive_time(self, now_us: int) -> None:
        """Begin anew if what is forgotten lies ahead: the clock was put back.

        Otherwise nothing would be believed until it is as late again.
        """
        if self._forgotten_us > now_us + self._window_us:
            self._forgotten_us = 0

    def __contains__(self, digest: bytes) -> bool:
        return digest in self._made_at

    def __len__(self) -> int:
        return len(self._made_at)

    def add(self, digest: bytes, made_us: int, now_us: int) -> None:
        """Remember a message that was believed."""
        self._made_at[digest] = made_us
        while self._made_at:
            oldest_us = next(iter(self._made_at.values()))
            if len(self._made_at) <= self._capacity and oldest_us >= now_us - self._window_us:
                break
            self._made_at.popitem(last=False)
            self._forgotten_us = max(self._forgotten_us, oldest_us)
