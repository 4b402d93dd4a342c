"""Frames of several senders, who take turns, without I/O."""

from collections import OrderedDict, deque


class SenderTurns:
    """Frames by sender: the senders take turns, each with its oldest frame."""

    def __init__(self, most_senders: int) -> None:
        """Keep the frames of so many senders, those that came last."""
        self._most_senders = most_senders
        self._frames: OrderedDict[bytes, deque[bytes]] = OrderedDict()

    def __bool__(self) -> bool:
        return bool(self._frames)

    def put(self, sender: bytes, frame: bytes, most: int) -> int:
        """Append a frame, of which the sender has at most `most`, the newest.

        Returns:
            how many frames were dropped for it.
        """
        frames = self._frames.setdefault(sender, deque())
        frames.append(frame)
        if len(frames) > most:
            frames.popleft()
            return 1
        if len(self._frames) > self._most_senders:
            return len(self._frames.popitem(last=False)[1])
        return 0

    def take(self) -> bytes | None:
        """Remove and return the next frame; `None` if there is none."""
        if not self._frames:
            return None
        sender, frames = self._frames.popitem(last=False)
        frame = frames.popleft()
        if frames:
            self._frames[sender] = frames
        return frame
