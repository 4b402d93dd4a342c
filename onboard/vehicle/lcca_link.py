"""LCCA messages to what is signed and back: whose the sender's ID is, and who brakes.

Where the own certificates commit to vehicle IDs, those of others must too. Only an inquiry needs no
proof: nothing follows from whose it is, and answers are limited by signer. An ID is that of the
epoch in which its message was signed, so no clocks are compared.

Whoever repeats a warning adds what the braking vehicle signed. So the claim is that vehicle's own:
a forwarder invents nothing in its name, and is not charged for what it passes on. What was signed
stays with the warning until its own copy is sent, whatever others send in the meantime.
"""

from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass, replace

from onboard.errors import DecodeError
from onboard.lcca.events import BrakingStatement
from onboard.messages import lcca
from onboard.messages.lcca import CarId, Inquiry, LccaMessage, LccaPdu, Warn, WarnCause
from onboard.security import ieee1609dot2
from onboard.security.credentials import Credentials
from onboard.security.id_commitment import Proof, is_proved, leaf, root_in
from onboard.security.plate_digest import PlateDigest
from onboard.security.pseudonyms import Pseudonym
from onboard.security.region import TwoDLocation
from onboard.security.rejection import NotTrusted, RejectionReason
from onboard.security.security_services import Opened, SecurityServices

MAX_STATEMENTS = 256
"""Statements of braking vehicles whose signatures are not verified again, those received last."""
EDGE_S = 0.01
"""Time between choosing an ID and signing under it."""

_Key = tuple[CarId, int, int, WarnCause | int, float]


class RefusalError(Exception):
    """Its sender may not send this message; the argument is the reason, a counted word."""


@dataclass(frozen=True, slots=True)
class _Statement:
    """A warning as the braking vehicle sent it."""

    warn: Warn
    opened: Opened


class LccaLink:
    """Proves the own ID and passes on what others signed; asks the same of others."""

    def __init__(
        self,
        security: SecurityServices,
        psid: int,
        credentials: Credentials | None,
        digest: PlateDigest,
        payload_in: Callable[[bytes, float], bytes] = lambda signed_part, _now: signed_part,
    ) -> None:
        """Start without statements.

        Args:
            security: verifies what is passed on.
            psid: of the messages.
            credentials: the own ones; proofs are asked for if they commit to IDs.
            digest: knows when epochs begin.
            payload_in: returns the message in what was signed, given the time; all by default.
        """
        self._security = security
        self._psid = psid
        self._asks = credentials is not None and credentials.commit_to_ids
        self._digest = digest
        self._payload_in = payload_in
        self._proof: Proof = ()
        self._statements: OrderedDict[_Key, _Statement] = OrderedDict()

    def use_pseudonym(self, pseudonym: Pseudonym) -> None:
        """Send under its ID from now on."""
        self._proof = pseudonym.proof

    def encode(self, message: LccaMessage) -> bytes:
        """Return what is to be signed."""
        if isinstance(message, Inquiry):
            return lcca.encode(message)
        return lcca.encode(
            message, self._proof, message.origin if isinstance(message, Warn) else b""
        )

    def receive_pdu(
        self, pdu: LccaPdu, opened: Opened, place: TwoDLocation | None, now: float
    ) -> tuple[LccaMessage, BrakingStatement | None]:
        """Return a message, and of a signed copy of a warning what the braking vehicle stated.

        Args:
            pdu: as decoded.
            opened: what it was decoded from.
            place: of the host vehicle; `None` if it is not known.
            now: the present time.

        Raises:
            RefusalError: its sender may not send it.
        """
        message = pdu.message
        if not isinstance(message, Inquiry) and not self._is_proved(
            message.sender_id, pdu.proof, opened
        ):
            raise RefusalError("unproved_id")
        if not isinstance(message, Warn) or not self._security.verifies:
            return message, None
        if message.is_direct:
            return self._signed(message, self._keep(_Statement(message, opened)), now), None
        stated = self._statements.get(_key(message)) or self._verified(pdu.origin, message, now)
        if stated.opened.signer_id == opened.signer_id:
            raise RefusalError("unproved_origin")
        if not stated.opened.is_valid_at(place):
            raise RefusalError(RejectionReason.OUTSIDE_REGION)
        statement = BrakingStatement(stated.warn, stated.opened.signer_id)
        return self._signed(message, stated, now), statement

    def _signed(self, warn: Warn, stated: _Statement, now: float) -> Warn:
        """Return a warning with what its braking vehicle signed."""
        stated_at_s = self._security.made_at_s(stated.opened, now) - stated.warn.age_s
        return replace(warn, origin=stated.opened.secured, stated_at_s=stated_at_s)

    def _verified(self, origin: bytes, copy: Warn, now: float) -> _Statement:
        """Return what the braking vehicle signed, verified only if the copy states the same."""
        if not self._states(ieee1609dot2.payload_in(origin) or b"", copy, now):
            raise RefusalError("unproved_origin")
        try:
            opened = self._security.open(origin, self._psid, now, is_repeated=True)
            stated = lcca.decode(self._payload_in(opened.payload, now))
        except NotTrusted as refusal:
            is_own = refusal.reason is RejectionReason.OWN_ECHO
            raise RefusalError("own_echo" if is_own else "unproved_origin") from refusal
        except DecodeError as error:  # `_states` has read on behind what is signed
            raise RefusalError("unproved_origin") from error
        if not isinstance(stated.message, Warn) or not self._is_proved(
            stated.message.sender_id, stated.proof, opened
        ):
            raise RefusalError("unproved_origin")
        return self._keep(_Statement(stated.message, opened))

    def _states(self, signed_part: bytes, copy: Warn, now: float) -> bool:
        """Whether this is the warning of the braking vehicle that a copy is of."""
        try:
            origin = lcca.decode(self._payload_in(signed_part, now)).message
        except DecodeError:
            return False
        return isinstance(origin, Warn) and origin.is_direct and _key(origin) == _key(copy)

    def _is_proved(self, car_id: CarId, proof: Proof, opened: Opened) -> bool:
        if not self._asks:
            return True
        root, signed_utc_s = root_in(opened.ssp), opened.generation_utc_s
        if root is None or signed_utc_s is None:
            return False
        epochs = {self._digest.epoch(signed_utc_s + edge_s) for edge_s in (-EDGE_S, EDGE_S)}
        return any(is_proved(leaf(epoch, car_id), proof, root) for epoch in epochs)

    def _keep(self, stated: _Statement) -> _Statement:
        key = _key(stated.warn)
        self._statements[key] = stated
        self._statements.move_to_end(key)
        if len(self._statements) > MAX_STATEMENTS:
            self._statements.popitem(last=False)
        return stated


def _key(warn: Warn) -> _Key:
    """Return what no copy may change."""
    return (
        warn.event_origin_id,
        warn.event_sequence,
        warn.first_sequence,
        warn.cause,
        warn.deceleration_m_s2,
    )
