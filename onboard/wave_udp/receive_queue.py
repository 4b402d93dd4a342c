"""Received frames that wait for the cores, without I/O.

More messages can arrive than one processor verifies. Frames of the warning group then come first
and are never dropped for others. Of each other sender, only the newest BSM waits once many do, and
the senders take turns: under overload, every sender is processed less often, and always with its
newest message.
"""

from collections import OrderedDict, deque
from collections.abc import Callable

from onboard.errors import DecodeError
from onboard.wave_udp import wsmp
from onboard.wave_udp.wsmp import WaveShortMessage

MAX_SENDERS = 1024
"""Senders with a frame waiting, more than are in radio range on any road. If forged senders exceed
it, the frames that came first are dropped."""
KEEP_ALL_BELOW = 64
"""While fewer frames wait, all are kept, several of one sender too: 64 take under 0.05 s."""
MAX_URGENT = 4096
"""Urgent frames waiting, more than a trial has cars: a bound on memory under attack."""


class ReceiveQueue:
    """Urgent frames in their order, then the newest frame of each other sender, in turns."""

    def __init__(
        self, urgent_psid: int, sender_of: Callable[[WaveShortMessage], bytes | None]
    ) -> None:
        """Queue frames under `urgent_psid` before all others.

        Args:
            urgent_psid: PSID of the warning group.
            sender_of: names the sender of a message without verifying it; `None` if it names none.
        """
        self._urgent_psid = urgent_psid
        self._sender_of = sender_of
        self._urgent: deque[bytes] = deque(maxlen=MAX_URGENT)
        self._others: OrderedDict[bytes, bytes] = OrderedDict()
        self._dropped = 0

    def __bool__(self) -> bool:
        return bool(self._urgent or self._others)

    @property
    def has_urgent(self) -> bool:
        """Whether an urgent frame waits."""
        return bool(self._urgent)

    def put(self, wsm: bytes) -> None:
        """Queue a received frame."""
        try:
            message = wsmp.decode(wsm)
        except DecodeError:
            self._put_other(wsm, wsm)  # the cores count it with its reason
            return
        if message.psid == self._urgent_psid:
            self._dropped += len(self._urgent) == MAX_URGENT
            self._urgent.append(wsm)
        else:
            self._put_other(self._sender_of(message) or wsm, wsm)

    def take(self, *, only_urgent: bool = False) -> bytes | None:
        """Remove and return the next frame; `None` if there is none."""
        if self._urgent:
            return self._urgent.popleft()
        return self._others.popitem(last=False)[1] if self._others and not only_urgent else None

    def take_dropped(self) -> int:
        """Return how many frames were dropped since the last call."""
        dropped, self._dropped = self._dropped, 0
        return dropped

    def _put_other(self, sender: bytes, wsm: bytes) -> None:
        if sender in self._others and len(self._others) < KEEP_ALL_BELOW:
            sender = wsm
        self._dropped += sender in self._others
        self._others[sender] = wsm  # in the place of the older frame
        if len(self._others) > MAX_SENDERS:
            self._others.popitem(last=False)
            self._dropped += 1
