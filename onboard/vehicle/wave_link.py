"""Messages to frames and back: 1609.2 data in a profile's headers, sent by user priority."""

import math
from collections import deque
from collections.abc import Collection

from typing_extensions import override

from onboard.core import Core
from onboard.errors import DecodeError
from onboard.its_g5.congestion_control import ChannelLoad, CongestionControl
from onboard.its_g5.dcc_rate import LEAST_INTERVAL_S
from onboard.observations import Discarded
from onboard.security import ieee1609dot2
from onboard.security.peer_to_peer import answered_by
from onboard.security.security_services import NotTrusted, Opened, SecurityServices
from onboard.vehicle.framing import RadioFraming, WaveFraming
from onboard.wave_udp import psid
from onboard.wave_udp.radio_queue import PRIORITIES, RadioQueue
from onboard.wave_udp.wsmp import WaveShortMessage

AWARENESS_PRIORITY = 3
"""User priority of CAMs and CPMs, the lowest of messages that congestion control holds back."""
ANSWER_PRIORITY = 1
"""User priority of certificates for others: the lowest, background."""
ANSWER_LIFETIME_S = 1.0
"""Time such an answer may wait for the radio: who asks, asks again."""


class WaveLink(Core):
    """Secures, frames and queues messages, and opens received frames, without I/O."""

    def __init__(
        self,
        security: SecurityServices,
        psids: Collection[int],
        framing: RadioFraming | None = None,
        congestion_control: CongestionControl | None = None,
    ) -> None:
        """Receive the services `psids` only, in the frames of `framing`; WSMs by default.

        Frames are sent as `congestion_control` allows, and at any time without it.
        """
        self._security = security
        self._framing = framing or WaveFraming()
        self._psids = frozenset(psids)
        self._congestion_control = congestion_control
        self._queue = RadioQueue(gate=congestion_control)
        self._discarded: deque[Discarded] = deque()

    def submit(
        self,
        payload: bytes,
        psid: int,
        user_priority: int,
        lifetime_s: float,
        now: float,
        *,
        may_wait: bool = False,
    ) -> int:
        """Secure and queue a message.

        Args:
            payload: the encoded message.
            psid: its service.
            user_priority: 0 to 7.
            lifetime_s: time after which it is dropped if it could not be sent.
            now: the present time.
            may_wait: for the certificate of its signer; see `SecurityServices.secure`.

        Returns:
            size of the whole frame in bytes.
        """
        utc_s = self._security.utc_s(now)
        signed_part = self._framing.signed_part(payload, psid, user_priority, now, utc_s)
        location = self._framing.location(psid, now)
        secured = self._security.secure(
            signed_part, psid, now, location=location, may_wait=may_wait
        )
        wsm = self._framing.frame(psid, secured)
        self._queue.put(wsm, user_priority, now + lifetime_s, now)
        return len(wsm)

    def receive_wsm(self, data: bytes, now: float) -> tuple[int, Opened, bytes] | None:
        """Open a frame from the radio.

        Returns:
            its PSID, what was signed, and the message in it, or `None` if it was discarded.
        """
        if self._congestion_control is not None:
            self._congestion_control.receive_frame(len(data))
        try:
            wsm = self._framing.read(data)
            if wsm.psid == psid.PEER_TO_PEER and self._security.verifies:
                self._security.receive_ca_certs(wsm.payload, now)
                return None
            if wsm.psid in self._psids:
                opened = self._security.open(wsm.payload, wsm.psid, now)
                return wsm.psid, opened, self._framing.payload_in(opened.payload, now)
            self._discard("unknown_psid", f"0x{wsm.psid:X}", now)
        except DecodeError as error:
            self._discard(error.reason, error.detail, now)
        except NotTrusted as refusal:
            self._discarded.append(Discarded(now, "security", refusal.reason, refusal.detail))
        return None

    def _discard(self, reason: str, detail: str, now: float) -> None:
        self._discarded.append(Discarded(now, self._framing.component, reason, detail))

    def known_signer(self, wsm: WaveShortMessage) -> bytes | None:
        """Return who claims to have signed `wsm`, unverified, if it was verified before.

        Without keys nobody is, and all are known under one name.
        """
        if not self._security.verifies:
            return b""
        signer_id = ieee1609dot2.signer_in(wsm.payload)
        return signer_id if signer_id and self._security.has_verified(signer_id) else None

    def certificate_in(self, wsm: WaveShortMessage) -> tuple[bytes, bool] | None:
        """Return the HashedId8 of the certificate that `wsm` carries, and whether it is of use.

        As the signer's it may be valid, as an authority's messages have named it. Nothing is
        verified for that. `None` without a certificate.
        """
        if wsm.psid == psid.PEER_TO_PEER:
            issuer_id = answered_by(wsm.payload)
            named = self._security.distribution.is_named
            return None if issuer_id is None else (issuer_id, named(issuer_id))
        carried = ieee1609dot2.certificate_in(wsm.payload)
        return None if carried is None else (carried.hashed_id8, self._security.can_verify(carried))

    def wsms_to_send(self, now: float) -> list[tuple[int, bytes]]:
        """What the radio is to be given now, the most urgent first, as (user priority, WSM)."""
        for answer in self._security.distribution.answers_to_send(now):
            wsm = self._framing.frame(psid.PEER_TO_PEER, answer)
            self._queue.put(wsm, ANSWER_PRIORITY, now + ANSWER_LIFETIME_S, now)
        return self._queue.wsms_to_send(now)

    def urgent_wsms_to_send(self, now: float) -> list[tuple[int, bytes]]:
        """What nothing that is submitted later can precede, else as `wsms_to_send`."""
        return self._queue.wsms_to_send(now, least_priority=PRIORITIES - 1)

    def opens_at(self, now: float) -> float:
        """Return when to ask again whether an awareness message would be sent at once.

        At most `now` if it would; frames as urgent that wait take their turn first.
        """
        control = self._congestion_control
        if control is None:
            return now
        others = self._queue.waiting(AWARENESS_PRIORITY)
        return max(control.opens_at(0), now + LEAST_INTERVAL_S if others else now)

    @override
    def get_timer(self) -> float:
        """Return when something is due; `math.inf` if nothing is."""
        control = self._congestion_control
        return min(
            self._queue.get_timer(),
            self._security.distribution.get_timer(),
            math.inf if control is None else control.get_timer(),
        )

    @override
    def handle_timer(self, now: float) -> None:
        """Measure the channel load if that is due."""
        if self._congestion_control is not None:
            self._congestion_control.handle_timer(now)

    @override
    def next_event(self) -> Discarded | ChannelLoad | None:
        """The oldest event not yet taken."""
        if self._discarded:
            return self._discarded.popleft()
        control = self._congestion_control
        load = None if control is None else control.next_event()
        return load or self._queue.next_event()
