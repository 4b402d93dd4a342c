"""LCCA messages to what is signed and back: with the proof that the sender's ID is the signer's.

Where the own certificates commit to vehicle IDs, those of others must too. Only an inquiry needs no
proof: nothing follows from whose it is, and answers are limited by signer.
"""

from onboard.messages import lcca
from onboard.messages.lcca import Inquiry, LccaMessage, LccaPdu
from onboard.security.credentials import Credentials
from onboard.security.id_commitment import Proof, is_proved, root_in
from onboard.security.pseudonyms import Pseudonym
from onboard.security.security_services import Opened


class LccaLink:
    """Proves the own ID, and asks others for the proof of theirs."""

    def __init__(self, credentials: Credentials | None) -> None:
        """Ask for proofs if the own certificates commit to IDs."""
        self._asks = credentials is not None and credentials.commit_to_ids
        self._proof: Proof = ()

    def use_pseudonym(self, pseudonym: Pseudonym) -> None:
        """Send under its ID from now on."""
        self._proof = pseudonym.proof

    def encode(self, message: LccaMessage) -> bytes:
        """Return what is to be signed."""
        return lcca.encode(message, () if isinstance(message, Inquiry) else self._proof)

    def refusal(self, pdu: LccaPdu, opened: Opened) -> str | None:
        """Return why a message is refused, as a counted word; `None` if its ID is the signer's.

        Args:
            pdu: as decoded.
            opened: what it was decoded from.
        """
        if not self._asks or isinstance(pdu.message, Inquiry):
            return None
        root = root_in(opened.ssp)
        is_own = root is not None and is_proved(pdu.message.sender_id, pdu.proof, root)
        return None if is_own else "unproved_id"
