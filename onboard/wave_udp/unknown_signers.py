"""Frames of signers that are not known yet, among which anybody can put any number, without I/O.

Three kinds take turns: certificates that vehicles have asked each other for, frames with a
certificate that was there before, and all others. So who makes up a certificate for each frame
delays neither the answer to a request nor a vehicle, which attaches its certificate twice a second.
"""

from collections import OrderedDict, deque

from onboard.wave_udp.sender_turns import SenderTurns

MAX_WAITING = 256
"""Frames of each other kind waiting, the newest."""
MAX_IN_TURN = 4096
"""Certificates that were there before with a frame waiting, those that came last: more than can be
made up and repeated within their turn."""
MAX_OF_CERTIFICATE = 4
"""Frames with one certificate waiting, the newest."""
MAX_CERTIFICATES = 8192
"""Certificates that are remembered, those there last: 2 s of 3,000 made up a second."""

_ALL = b""
"""Stands for all senders of a kind in which they take no turns."""


class UnknownSigners:
    """Frames of unknown signers, the newest of each kind."""

    def __init__(self) -> None:
        self._answers, self._again, self._others = (
            SenderTurns(1),
            SenderTurns(MAX_IN_TURN),
            SenderTurns(1),
        )
        self._kinds = deque((self._answers, self._again, self._others))
        """The first one is next."""
        self._seen: OrderedDict[bytes, None] = OrderedDict()

    def __bool__(self) -> bool:
        return any(self._kinds)

    def put(self, frame: bytes) -> int:
        """Queue a frame, and return how many were dropped for it."""
        return self._others.put(_ALL, frame, MAX_WAITING)

    def put_answer(self, frame: bytes) -> int:
        """Queue certificates of authorities, and return how many frames were dropped for them."""
        return self._answers.put(_ALL, frame, MAX_WAITING)

    def put_certified(self, certificate: bytes, frame: bytes) -> int:
        """Queue a frame that carries a certificate, by its HashedId8; return as `put`."""
        was_there = certificate in self._seen
        self._seen[certificate] = None
        self._seen.move_to_end(certificate)
        if len(self._seen) > MAX_CERTIFICATES:
            self._seen.popitem(last=False)
        if was_there:
            return self._again.put(certificate, frame, MAX_OF_CERTIFICATE)
        return self.put(frame)

    def take(self) -> bytes | None:
        """Remove and return the next frame; `None` if there is none."""
        for _ in range(len(self._kinds)):
            kind = self._kinds[0]
            self._kinds.rotate(-1)
            if kind:
                return kind.take()
        return None
