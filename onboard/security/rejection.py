"""Why a message is not believed, in words that do not change."""

from enum import StrEnum


class RejectionReason(StrEnum):
    """Stable words, fit for a counter's label."""

    MALFORMED = "malformed"
    """Not the bytes of 1609.2 data."""
    UNSUPPORTED = "unsupported"
    """1609.2 data, but of a kind that is not read here: encrypted, another curve, ..."""
    UNSIGNED = "unsigned"
    """Nobody vouches for it."""
    WRONG_PSID = "wrong_psid"
    """Signed for another application, or by somebody who may not speak in this one."""
    UNKNOWN_CERTIFICATE = "unknown_certificate"
    """Its certificate has not been seen yet; it comes along within half a second."""
    UNTRUSTED_ISSUER = "untrusted_issuer"
    """The certificate does not lead to a root that this car trusts, or not with these rights."""
    BAD_CERTIFICATE = "bad_certificate"
    """The named issuer did not sign this certificate."""
    NOT_YET_VALID = "not_yet_valid"
    EXPIRED = "expired"
    """The certificate is out of date, or the message itself says that it is over."""
    STALE = "stale"
    """Made too long ago."""
    FROM_THE_FUTURE = "from_the_future"
    """Made later than now, by more than clocks may differ."""
    OWN_ECHO = "own_echo"
    """Our own message, come back."""
    REPLAY = "replay"
    """Had before."""
    BAD_SIGNATURE = "bad_signature"
    """Changed on its way, or never signed by the holder of the certificate."""


class NotTrusted(Exception):  # noqa: N818 (the sender's fault, not an error of ours)
    """A message that must not be believed."""

    def __init__(self, reason: RejectionReason, detail: str = "") -> None:
        super().__init__(f"{reason}: {detail}" if detail else reason)
        self.reason = reason
        self.detail = detail
