"""LCCA messages to what is signed and back: whose the sender's ID is, and who brakes.

Where the own certificates commit to vehicle IDs, those of others must too. Only an inquiry needs no
proof: nothing follows from whose it is, and answers are limited by signer.

Whoever repeats a warning adds what the braking vehicle signed. So the claim is that vehicle's own:
a forwarder invents nothing in its name, and is not charged for what it passes on.
"""

from collections import OrderedDict
from dataclasses import dataclass

from onboard.errors import DecodeError
from onboard.lcca.events import BrakingStatement
from onboard.messages import lcca
from onboard.messages.lcca import CarId, Inquiry, LccaMessage, LccaPdu, Warn, WarnCause
from onboard.security.credentials import Credentials
from onboard.security.id_commitment import Proof, is_proved, root_in
from onboard.security.pseudonyms import Pseudonym
from onboard.security.rejection import NotTrusted, RejectionReason
from onboard.security.security_services import MESSAGE_LIFETIME_S, Opened, SecurityServices

MAX_STATEMENTS = 256
"""Statements of braking vehicles that are kept, those received last."""

_Key = tuple[CarId, int, int, WarnCause | int, float]


@dataclass(frozen=True, slots=True)
class _Statement:
    """A warning as the braking vehicle sent it."""

    warn: Warn
    opened: Opened


class LccaLink:
    """Proves the own ID and passes on what others signed; asks the same of others."""

    def __init__(
        self, security: SecurityServices, psid: int, credentials: Credentials | None
    ) -> None:
        """Start without statements.

        Args:
            security: verifies what is passed on.
            psid: of the messages.
            credentials: the own ones; proofs are asked for if they commit to IDs.
        """
        self._security = security
        self._psid = psid
        self._asks = credentials is not None and credentials.commit_to_ids
        self._proof: Proof = ()
        self._statements: OrderedDict[_Key, _Statement] = OrderedDict()

    def use_pseudonym(self, pseudonym: Pseudonym) -> None:
        """Send under its ID from now on."""
        self._proof = pseudonym.proof

    def encode(self, message: LccaMessage) -> bytes:
        """Return what is to be signed."""
        if isinstance(message, Inquiry):
            return lcca.encode(message)
        statement = None
        if isinstance(message, Warn) and not message.is_direct:
            statement = self._statements.get(_key(message))
        return lcca.encode(
            message, self._proof, b"" if statement is None else statement.opened.secured
        )

    def refusal(self, pdu: LccaPdu, opened: Opened, now: float) -> str | None:
        """Return why a message is refused, as a counted word; `None` if it is accepted.

        Args:
            pdu: as decoded.
            opened: what it was decoded from.
            now: the present time.
        """
        message = pdu.message
        if isinstance(message, Inquiry):
            return None
        if not self._is_proved(message.sender_id, pdu.proof, opened):
            return "unproved_id"
        if not isinstance(message, Warn) or not self._security.verifies:
            return None
        if message.is_direct:
            self._keep(_Statement(message, opened))
            return None
        return None if self.statement_of(message, now) else self._refusal_of_copy(message, pdu, now)

    def _refusal_of_copy(self, warn: Warn, pdu: LccaPdu, now: float) -> str | None:
        """Take what the braking vehicle signed; return why it does not prove the copy."""
        try:
            opened = self._security.open_repeated(pdu.origin, self._psid, now)
            stated = lcca.decode(opened.payload)
        except NotTrusted as refusal:
            is_own = refusal.reason is RejectionReason.OWN_ECHO
            return "own_echo" if is_own else "unproved_origin"
        except DecodeError:
            return "unproved_origin"
        origin = stated.message
        if (
            not isinstance(origin, Warn)
            or not origin.is_direct
            or _key(origin) != _key(warn)
            or not self._is_proved(origin.sender_id, stated.proof, opened)
        ):
            return "unproved_origin"
        self._keep(_Statement(origin, opened))
        return None

    def statement_of(self, warn: Warn, now: float) -> BrakingStatement | None:
        """Return what the braking vehicle stated; `None` if it is not known, or out of date."""
        stated = self._statements.get(_key(warn))
        if stated is None or stated.opened.generation_utc_s is None:
            return None
        if self._security.utc_s(now) - stated.opened.generation_utc_s > MESSAGE_LIFETIME_S:
            return None
        return BrakingStatement(stated.warn, stated.opened.signer_id)

    def _is_proved(self, car_id: CarId, proof: Proof, opened: Opened) -> bool:
        root = root_in(opened.ssp)
        return not self._asks or (root is not None and is_proved(car_id, proof, root))

    def _keep(self, stated: _Statement) -> None:
        key = _key(stated.warn)
        self._statements[key] = stated
        self._statements.move_to_end(key)
        if len(self._statements) > MAX_STATEMENTS:
            self._statements.popitem(last=False)


def _key(warn: Warn) -> _Key:
    """Return what no copy may change."""
    return (
        warn.event_origin_id,
        warn.event_sequence,
        warn.first_sequence,
        warn.cause,
        warn.deceleration_m_s2,
    )
