"""Frames from the radio that wait for the cores, still without I/O.

A crowd can send more than one processor verifies. Then the few messages of the warning group must
not wait behind hundreds of BSMs: they come first, and none of them is given up. Where many others
wait, of each sender only the newest BSM does, since an older one has been said again; the senders
take turns. So a crowd that is too much is heard from less often, all of it alike, and always fresh.
"""

from collections import OrderedDict, deque

from onboard.messages import bsm
from onboard.messages.declaration import DecodeError
from onboard.security import ieee1609dot2
from onboard.wave_udp import wsmp

MOST_WAITING = 1024
"""Senders. No road has more in reach; of made-up ones those that came first are given up."""
FEW_WAITING = 64
"""Up to so many, all are kept, even of one sender: they are heard within 0.05 s."""
MOST_URGENT = 4096
"""No trial has so many cars; more is an attack on the car's memory."""


class ReceiveQueue:
    """Urgent frames in their order, then the newest of each other sender, in turns."""

    def __init__(self, urgent_psid: int) -> None:
        """Frames under `urgent_psid` go before all others."""
        self._urgent_psid = urgent_psid
        self._urgent: deque[bytes] = deque(maxlen=MOST_URGENT)
        self._others: OrderedDict[bytes, bytes] = OrderedDict()
        self._shed = 0

    def __bool__(self) -> bool:
        return bool(self._urgent or self._others)

    @property
    def has_urgent(self) -> bool:
        """Whether one of the frames that go first waits."""
        return bool(self._urgent)

    def put(self, wsm: bytes) -> None:
        """A frame came."""
        try:
            message = wsmp.decode(wsm)
        except DecodeError:
            self._put_other(wsm, wsm)  # the cores say what is wrong with it, when there is time
            return
        if message.psid == self._urgent_psid:
            self._shed += len(self._urgent) == MOST_URGENT
            self._urgent.append(wsm)
        else:
            self._put_other(_sender(message) or wsm, wsm)

    def take(self, *, only_urgent: bool = False) -> bytes | None:
        """The frame that is next; `None` when there is none."""
        if self._urgent:
            return self._urgent.popleft()
        return self._others.popitem(last=False)[1] if self._others and not only_urgent else None

    def take_shed(self) -> int:
        """How many frames have been given up since the last call."""
        shed, self._shed = self._shed, 0
        return shed

    def _put_other(self, sender: bytes, wsm: bytes) -> None:
        if sender in self._others and len(self._others) < FEW_WAITING:
            sender = wsm
        self._shed += sender in self._others
        self._others[sender] = wsm  # in the place of the older one
        if len(self._others) > MOST_WAITING:
            self._others.popitem(last=False)
            self._shed += 1


def _sender(message: wsmp.WaveShortMessage) -> bytes | None:
    """The temporary ID in a BSM, whoever wrote it there; `None` where there is none."""
    payload = ieee1609dot2.payload_in(message.payload) if message.psid == bsm.PSID else None
    return None if payload is None else bsm.temporary_id_in(payload)
