"""Received frames that wait for the cores, without I/O.

More messages can arrive than one processor verifies, and anybody can send. Frames that name a
signer whose messages were verified before come first: those of the warning group at once, each
signer in turn, then the newest BSM of each sender. For all others (`unknown_signers.py`), the
caller has a budget of time. Under overload, every known sender is so processed with its newest
messages, whoever else floods the channel.
"""

from collections import OrderedDict
from collections.abc import Callable

from onboard.errors import DecodeError
from onboard.wave_udp import psid, wsmp
from onboard.wave_udp.sender_turns import SenderTurns
from onboard.wave_udp.unknown_signers import UnknownSigners
from onboard.wave_udp.wsmp import WaveShortMessage

MAX_SENDERS = 1024
"""Senders with a frame waiting, more than are in radio range on any road. If forged senders exceed
it, the frames that came first are dropped."""
KEEP_ALL_BELOW = 64
"""While fewer frames wait, all are kept, several of one sender too: 64 take under 0.05 s."""
MAX_URGENT = 4096
"""Urgent frames waiting, more than a trial has cars: a bound on memory under attack."""
MAX_URGENT_OF_SIGNER = 16
"""Urgent frames of one signer waiting, a second of group messages: what is forged in the name of
one vehicle delays no other one by more than its turn."""

NO_KEYS = b""
"""Stands for all signers where nothing is verified."""


def _no_certificate(_wsm: WaveShortMessage) -> None:
    """Find none where nothing is verified."""


def _never(_wsm: WaveShortMessage) -> bool:
    """Let no frame wait."""
    return False


class ReceiveQueue:
    """Urgent frames, then the newest frame of each other sender, then those of unknown signers."""

    def __init__(
        self,
        urgent_psid: int,
        sender_of: Callable[[WaveShortMessage], bytes | None],
        known_signer: Callable[[WaveShortMessage], bytes | None] = lambda _wsm: NO_KEYS,
        certificate_in: Callable[[WaveShortMessage], tuple[bytes, bool] | None] = _no_certificate,
        read: Callable[[bytes], WaveShortMessage] = wsmp.decode,
        *,
        may_wait: Callable[[WaveShortMessage], bool] = _never,
    ) -> None:
        """Queue frames under `urgent_psid` before all others.

        Args:
            urgent_psid: PSID of the warning group.
            sender_of: names the sender of a message without verifying it; `None` if it names none.
            known_signer: names its signer, if messages of that signer were verified; `NO_KEYS`
                where nothing is.
            certificate_in: identifies the certificate that a message carries, and tells whether it
                is of use: whether it may be valid, or is an authority's that messages have named.
                `None` without one.
            read: returns service and 1609.2 data of a frame.
            may_wait: whether a message of a known signer may wait for others.
        """
        self._read = read
        self._may_wait = may_wait
        self._urgent_psid = urgent_psid
        self._sender_of = sender_of
        self._known_signer = known_signer
        self._certificate_in = certificate_in
        self._urgent = SenderTurns(MAX_URGENT)
        self._others: OrderedDict[bytes, bytes] = OrderedDict()
        self._unknown = UnknownSigners()
        self._dropped = 0
        self._is_pressing = False

    def __bool__(self) -> bool:
        return self.has_known or self.has_unknown

    @property
    def has_urgent(self) -> bool:
        """Whether an urgent frame of a known signer waits."""
        return bool(self._urgent)

    @property
    def has_known(self) -> bool:
        """Whether a frame of a known signer waits."""
        return bool(self._urgent or self._others)

    @property
    def is_pressing(self) -> bool:
        """Whether one of them may not wait for others."""
        return self._is_pressing and self.has_known

    @property
    def has_unknown(self) -> bool:
        """Whether a frame of an unknown signer waits."""
        return bool(self._unknown)

    def put(self, wsm: bytes) -> None:
        """Queue a received frame."""
        self._is_pressing &= self.has_known
        try:
            message = self._read(wsm)
        except DecodeError:
            self._dropped += self._unknown.put(wsm)  # the cores count it with its reason
            return
        signer = self._known_signer(message)
        if signer is None:
            self._dropped += self._put_unknown(message, wsm)
        elif message.psid == self._urgent_psid:
            most = MAX_URGENT if signer == NO_KEYS else MAX_URGENT_OF_SIGNER
            self._dropped += self._urgent.put(signer, wsm, most)
            self._is_pressing = True
        else:
            self._is_pressing = self._is_pressing or not self._may_wait(message)
            self._put_other(self._sender_of(message) or wsm, wsm)

    def take(self, *, only_urgent: bool = False) -> bytes | None:
        """Remove and return the next frame of a known signer; `None` if there is none."""
        if self._urgent:
            return self._urgent.take()
        return self._others.popitem(last=False)[1] if self._others and not only_urgent else None

    def take_unknown(self) -> bytes | None:
        """Remove and return the next frame of an unknown signer; `None` if there is none."""
        return self._unknown.take()

    def take_dropped(self) -> int:
        """Return how many frames were dropped since the last call."""
        dropped, self._dropped = self._dropped, 0
        return dropped

    def _put_unknown(self, message: WaveShortMessage, wsm: bytes) -> int:
        certificate = self._certificate_in(message)
        if certificate is None:
            return self._unknown.put(wsm)
        hashed_id8, is_of_use = certificate
        if message.psid == psid.PEER_TO_PEER:
            return self._unknown.put_answer(wsm, is_named=is_of_use)
        return self._unknown.put_certified(hashed_id8, wsm, may_be_valid=is_of_use)

    def _put_other(self, sender: bytes, wsm: bytes) -> None:
        if sender in self._others and len(self._others) < KEEP_ALL_BELOW:
            sender = wsm
        self._dropped += sender in self._others
        self._others[sender] = wsm  # in the place of the older frame
        if len(self._others) > MAX_SENDERS:
            self._others.popitem(last=False)
            self._dropped += 1
