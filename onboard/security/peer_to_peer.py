"""Peer-to-peer certificate distribution (IEEE 1609.2-2022, clause 8), without I/O.

A vehicle that does not know an issuer names it in its next BSM (`p2pcdLearningRequest`). Who has
that certificate answers with it and those above it, but the root (Ieee1609dot2Peer2PeerPDU, PSID
0x88). The answer is unsigned: certificates are verified by themselves.

Anybody can make up issuers, thousands a second. So while there are many, an issuer is asked for
only when a message comes under it again after `SIGHTED_S`, as of a vehicle that drives beside. Who
keeps that up as well can still fill the requests. So a vehicle that hears an unknown issuer also
sends the certificates above its own, as if it had been asked: the other one lacks them, most
likely. An answer is verified if its issuer was named in a message lately, asked for or not, and
another one in `UNNAMED_S`: messages that name it may be lost among those that are made up.

A request is honoured unverified, for who asks is often unknown to whom it asks. Anybody can make a
vehicle answer, so a certificate is sent at most once in `ANSWER_INTERVAL_S`, and not after
`ENOUGH_ANSWERS` of others: a flood of requests brings no more. Times are ours; those of the
standard's profile (SAE J2945/1) are not public.
"""

import math
from collections import OrderedDict
from collections.abc import Iterable

from typing_extensions import override

from onboard.core import Core
from onboard.security.certificate_codec import read_certificate
from onboard.security.certificates import Certificate
from onboard.security.oer import Malformed, OerReader, Unsupported, choice, sequence

SIGHTED_S = 0.3
"""From the first message under an issuer to that after which it is asked for, and announced: less
than the interval at which vehicles attach their certificates."""
MOST_SIGHTED = 8192
"""Issuers that are remembered, those of the last messages: 2 s of 3,000 made up a second, so that a
vehicle's is still among them at its next certificate."""
REQUEST_INTERVAL_S = 1.0
"""Between requests for one issuer: one message of ten asks."""
REQUEST_LIFETIME_S = 5.0
"""For which an issuer is asked for, and an answer taken, after a message under it."""
UNNAMED_S = 0.1
"""Between two answers that are verified though no message has named their issuer."""
BACKOFF_S = 0.25
"""Within which answers are spread."""
ANSWER_INTERVAL_S = 1.0
"""Between two answers with one certificate."""
ENOUGH_ANSWERS = 3
"""Of others, after which an answer that waits is dropped."""
MOST_REQUESTED = 16
"""Issuers that are asked for at a time; another one takes the place of one that was asked for."""

_VERSION = 1
_MOST_CERTIFICATES = 8


def hashed_id3(hashed_id8: bytes) -> bytes:
    """Return the HashedId3 of the certificate with this HashedId8."""
    return hashed_id8[-3:]


def encode_ca_certs(chain: Iterable[Certificate]) -> bytes:
    """Return the Ieee1609dot2Peer2PeerPDU with `chain`, each certificate issued by the next."""
    return bytes((_VERSION,)) + choice(0) + sequence([each.encoded for each in chain])


def decode_ca_certs(data: bytes) -> tuple[Certificate, ...]:
    """Return the certificates in an Ieee1609dot2Peer2PeerPDU.

    Raises:
        Malformed: the bytes are not one.
        Unsupported: it is of another version, or has other content.
    """
    reader = OerReader(data)
    if reader.byte() != _VERSION or reader.choice() != 0:
        raise Unsupported("another peer-to-peer message than certificates of authorities")
    count = reader.unsigned()
    if not 1 <= count <= _MOST_CERTIFICATES:
        raise Malformed(f"{count} certificates")
    certificates = tuple(read_certificate(reader) for _ in range(count))
    reader.finish()
    return certificates


def answered_by(data: bytes) -> bytes | None:
    """Return the HashedId8 of the first certificate in an answer; `None` without one."""
    reader = OerReader(data)
    try:
        if reader.byte() != _VERSION or reader.choice() != 0 or reader.unsigned() == 0:
            return None
        return read_certificate(reader).hashed_id8
    except (Malformed, Unsupported):
        return None


class CertificateDistribution(Core):
    """What to ask others for, and what to answer them."""

    def __init__(self, chain: Iterable[Certificate]) -> None:
        """Start without requests.

        Args:
            chain: certificates of the authorities above the host vehicle's own, in any order.
        """
        by_id = {each.hashed_id8: each for each in chain}
        self._own_ids = frozenset(by_id)
        self._answers = {
            hashed_id3(key): encode_ca_certs(_up_from(each, by_id)) for key, each in by_id.items()
        }
        self._backoff_s = 0.0
        self._own_issuer = b""
        """HashedId3 of the issuer of the own certificate."""
        self._sighted: OrderedDict[bytes, tuple[float, float]] = OrderedDict()
        """First and last message, by the HashedId8 of the issuers that are not known."""
        self._requested: OrderedDict[bytes, float] = OrderedDict()
        """When to ask next, by the HashedId8 of the issuers to ask for."""
        self._waiting: dict[bytes, tuple[float, int]] = {}
        """When to answer, and the answers of others, by HashedId3."""
        self._answered_at: dict[bytes, float] = {}
        self._unnamed_at = -math.inf
        """When the next answer is verified whose issuer no message has named."""

    def use_certificate(self, hashed_id8: bytes, issuer_id: bytes | None = None) -> None:
        """Take the HashedId8 of the own certificate, which spreads the answers of vehicles.

        The time to an answer so tells nothing that outlasts a pseudonym.

        Args:
            hashed_id8: of the own certificate.
            issuer_id: HashedId8 of its issuer, whose certificates are announced.
        """
        self._backoff_s = BACKOFF_S * int.from_bytes(hashed_id8[:2]) / (1 << 16)
        self._own_issuer = hashed_id3(issuer_id or b"")

    # ---- asking ---------------------------------------------------------------------------

    def receive_unknown_issuer(self, issuer_id: bytes, now: float) -> None:
        """Take the HashedId8 of an issuer that a message came under."""
        self._forget(now)
        first_at, _ = self._sighted.pop(issuer_id, (now, now))
        self._sighted[issuer_id] = first_at, now
        if len(self._sighted) > MOST_SIGHTED:
            self._sighted.popitem(last=False)
        self.receive_request(self._own_issuer, now)
        if now - first_at >= SIGHTED_S or len(self._sighted) <= MOST_REQUESTED:
            self._place_request(issuer_id)

    def is_named(self, issuer_id: bytes) -> bool:
        """Whether a message has come under this issuer lately, which is not known."""
        return issuer_id in self._sighted

    def _place_request(self, issuer_id: bytes) -> None:
        """Plan to ask for an issuer, if there is a place or one that was asked for."""
        if issuer_id in self._requested:
            return
        if len(self._requested) >= MOST_REQUESTED:
            asked_for = (each for each, at in self._requested.items() if at > -math.inf)
            replaced = next(asked_for, None)
            if replaced is None:
                return
            del self._requested[replaced]
        self._requested[issuer_id] = -math.inf

    def request_to_send(self, now: float) -> bytes | None:
        """Return the HashedId3 to ask for in a BSM that is sent now, each in turn."""
        self._forget(now)
        for wanted, next_at in list(self._requested.items()):
            if wanted not in self._sighted:
                del self._requested[wanted]
            elif next_at <= now:
                self._requested[wanted] = now + REQUEST_INTERVAL_S
                self._requested.move_to_end(wanted)
                return hashed_id3(wanted)
        return None

    def _forget(self, now: float) -> None:
        """Forget the issuers of messages that were received too long ago."""
        while self._sighted:
            issuer_id, (_, last_at) = next(iter(self._sighted.items()))
            if now - last_at < REQUEST_LIFETIME_S:
                break
            del self._sighted[issuer_id]

    def wanted(
        self, certificates: Iterable[Certificate], now: float, *, is_known: bool
    ) -> list[Certificate]:
        """Take an answer of another vehicle; return it, the topmost certificate first.

        Certificates are told apart by HashedId8: one with the HashedId3 of another is soon found.

        Args:
            certificates: the answer.
            now: the time.
            is_known: whether its first certificate is.

        Returns:
            nothing, if it is known, or is neither named in a message nor has its turn.
        """
        chain = list(certificates)
        issuer_id = chain[0].hashed_id8
        answered = hashed_id3(issuer_id)
        if answered in self._waiting and issuer_id in self._own_ids:
            at, others = self._waiting[answered]
            self._waiting[answered] = at, others + 1
            if others + 1 >= ENOUGH_ANSWERS:
                del self._waiting[answered]
        self._forget(now)
        if is_known:
            return []
        if self._sighted.pop(issuer_id, None) is None:
            if now < self._unnamed_at:
                return []
            self._unnamed_at = now + UNNAMED_S
        self._requested.pop(issuer_id, None)
        return chain[::-1]

    # ---- answering ------------------------------------------------------------------------

    def receive_request(self, wanted: bytes, now: float) -> None:
        """Take the HashedId3 that another vehicle asks for."""
        last_at = self._answered_at.get(wanted, -math.inf)
        is_due = now - last_at >= ANSWER_INTERVAL_S
        if wanted in self._answers and wanted not in self._waiting and is_due:
            self._waiting[wanted] = now + self._backoff_s, 0

    def answers_to_send(self, now: float) -> list[bytes]:
        """Return the answers that are due."""
        if not self._waiting:
            return []
        due = [wanted for wanted, (at, _) in self._waiting.items() if at <= now]
        for wanted in due:
            del self._waiting[wanted]
            self._answered_at[wanted] = now
        return [self._answers[wanted] for wanted in due]

    @override
    def get_timer(self) -> float:
        """Return when an answer is due; infinite without one."""
        return min(at for at, _ in self._waiting.values()) if self._waiting else math.inf


def _up_from(certificate: Certificate, by_id: dict[bytes, Certificate]) -> list[Certificate]:
    """Return a certificate and those above it, as far as they are in `by_id`."""
    chain = [certificate]
    while (above := by_id.get(chain[-1].issuer_id or b"")) is not None and above not in chain:
        chain.append(above)
    return chain
