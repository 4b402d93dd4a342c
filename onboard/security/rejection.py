"""Reasons for which a received message is refused."""

from enum import StrEnum


class RejectionReason(StrEnum):
    """The check that failed, as a stable word for counters."""

    MALFORMED = "malformed"
    """Not the bytes of 1609.2 data."""
    UNSUPPORTED = "unsupported"
    """1609.2 data of a kind that is not supported: encrypted, another curve, ..."""
    UNSIGNED = "unsigned"
    """Unsecured data."""
    WRONG_PSID = "wrong_psid"
    """Signed for another application, or the certificate does not permit this one."""
    UNKNOWN_CERTIFICATE = "unknown_certificate"
    """The certificate has not been received yet; senders attach it every half second."""
    UNKNOWN_ISSUER = "unknown_issuer"
    """The certificate of the certificate's issuer is not known."""
    UNTRUSTED_ISSUER = "untrusted_issuer"
    """The issuer is known, but may not issue this certificate."""
    BAD_CERTIFICATE = "bad_certificate"
    """The named issuer did not sign this explicit certificate, or its key is no key."""
    REVOKED = "revoked"
    """A revocation list names the certificate, or one above it."""
    OUTSIDE_REGION = "outside_region"
    """Sent from where the certificate, or one above it, is not valid."""
    NOT_YET_VALID = "not_yet_valid"
    EXPIRED = "expired"
    """The certificate has expired, or the message's expiry time is over."""
    STALE = "stale"
    """Generated too long ago."""
    FROM_THE_FUTURE = "from_the_future"
    """Generation time ahead of the present by more than clocks may differ."""
    OWN_ECHO = "own_echo"
    """The host vehicle's own message."""
    REPLAY = "replay"
    """A second copy of a message."""
    BAD_SIGNATURE = "bad_signature"
    """Altered in transit, or not signed by the holder of the certificate; or its implicit
    certificate is forged, which shows no earlier."""


class NotTrusted(Exception):  # noqa: N818 (the sender's fault, not an error of ours)
    """A message that is refused."""

    def __init__(self, reason: RejectionReason, detail: str = "") -> None:
        super().__init__(f"{reason}: {detail}" if detail else reason)
        self.reason = reason
        self.detail = detail
