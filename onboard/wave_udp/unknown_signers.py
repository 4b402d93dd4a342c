"""Frames of signers that are not known yet, among which anybody can put any number, without I/O.

Four kinds take turns: certificates of authorities that messages have named, frames with a
certificate that was there before, frames with another one, and all that cannot be verified yet.
Authorities that no message has named have a turn now and then, as it may be lost. A certificate
that cannot be valid, or whose issuer is not known, is of the last kind. So who makes up a
certificate for each frame delays neither the answer to a request nor a vehicle, which attaches its
certificate twice a second.
"""

from collections import OrderedDict, deque

from onboard.wave_udp.sender_turns import SenderTurns

MAX_WAITING = 256
"""Frames of each other kind waiting, the newest, which come first: what is made up delays none."""
MAX_IN_TURN = 4096
"""Certificates that were there before with a frame waiting, those that came last: more than can be
made up and repeated within their turn."""
MAX_OF_CERTIFICATE = 4
"""Frames with one certificate waiting, the newest."""
MAX_CERTIFICATES = 8192
"""Certificates that are remembered, those there last: 2 s of 3,000 made up a second."""


TURNS = 4
"""Of each other kind, for one of the authorities that no message has named: few of these are
verified in a second."""


class _Newest:
    """The last frames that were put, the newest first."""

    def __init__(self) -> None:
        self._frames: deque[bytes] = deque(maxlen=MAX_WAITING)

    def __bool__(self) -> bool:
        return bool(self._frames)

    def put(self, frame: bytes) -> int:
        """Add a frame, and return how many were dropped for it."""
        is_full = len(self._frames) == MAX_WAITING
        self._frames.append(frame)
        return int(is_full)

    def take(self) -> bytes | None:
        """Remove and return the newest frame; `None` if there is none."""
        return self._frames.pop() if self._frames else None


class UnknownSigners:
    """Frames of unknown signers, the newest of each kind."""

    def __init__(self) -> None:
        self._again = SenderTurns(MAX_IN_TURN)
        self._answers, self._unnamed = _Newest(), _Newest()
        self._new, self._others = _Newest(), _Newest()
        each = self._answers, self._again, self._new, self._others
        self._kinds: deque[SenderTurns | _Newest] = deque((*(each * TURNS), self._unnamed))
        """The first one is next."""
        self._seen: OrderedDict[bytes, None] = OrderedDict()

    def __bool__(self) -> bool:
        return any(self._kinds)

    def put(self, frame: bytes) -> int:
        """Queue a frame, and return how many were dropped for it."""
        return self._others.put(frame)

    def put_answer(self, frame: bytes, *, is_named: bool) -> int:
        """Queue certificates of authorities, and return how many frames were dropped for them.

        Args:
            frame: that carries them.
            is_named: whether messages have named the first one.
        """
        return (self._answers if is_named else self._unnamed).put(frame)

    def put_certified(self, certificate: bytes, frame: bytes, *, may_be_valid: bool) -> int:
        """Queue a frame that carries a certificate, by its HashedId8; return as `put`."""
        was_there = certificate in self._seen
        self._seen[certificate] = None
        self._seen.move_to_end(certificate)
        if len(self._seen) > MAX_CERTIFICATES:
            self._seen.popitem(last=False)
        if not may_be_valid:
            return self.put(frame)
        if was_there:
            return self._again.put(certificate, frame, MAX_OF_CERTIFICATE)
        return self._new.put(frame)

    def take(self) -> bytes | None:
        """Remove and return the next frame; `None` if there is none."""
        for _ in range(len(self._kinds)):
            kind = self._kinds[0]
            self._kinds.rotate(-1)
            if kind:
                return kind.take()
        return None
