"""Detection of replayed messages, in bounded memory and without a gap."""

from collections import OrderedDict


class ReplayWindow:
    """Digests of recent messages. Times are generation times in microseconds (Time64)."""

    def __init__(self, window_us: int, capacity: int) -> None:
        """Keep at most `capacity` digests, each for `window_us` after its generation."""
        self._window_us = window_us
        self._capacity = capacity
        self._made_at: OrderedDict[bytes, int] = OrderedDict()
        self._forgotten_us = 0

    @property
    def forgotten_us(self) -> int:
        """Latest generation time of a dropped digest: messages up to it are to be refused."""
        return self._forgotten_us

    def receive_time(self, now_us: int) -> None:
        """Reset `forgotten_us` if it is in the future: the clock was set back.

        Otherwise all messages would be refused until the clock reaches it again.
        """
        if self._forgotten_us > now_us + self._window_us:
            self._forgotten_us = 0

    def __contains__(self, digest: bytes) -> bool:
        return digest in self._made_at

    def __len__(self) -> int:
        return len(self._made_at)

    def add(self, digest: bytes, made_us: int, now_us: int) -> None:
        """Add an accepted message.

        Args:
            digest: its digest.
            made_us: its generation time.
            now_us: the present time.
        """
        self._made_at[digest] = made_us
        while self._made_at:
            oldest_us = next(iter(self._made_at.values()))
            if len(self._made_at) <= self._capacity and oldest_us >= now_us - self._window_us:
                break
            self._made_at.popitem(last=False)
            self._forgotten_us = max(self._forgotten_us, oldest_us)
