"""Whether the own clock is wrong, by the times at which others say that they sent.

Messages whose time is too far from the own clock are refused before their signature is verified. So
others are believed only while none of them agrees with the own clock: an outsider can make it seem
wrong only where no other vehicle is heard.
"""

import statistics
from collections import OrderedDict

LEAST_SIGNERS = 2
"""Of one other vehicle alone, it cannot be said whose clock is wrong."""
ALIKE_S = 2.0
"""Difference of the clocks of others that are right."""
RECEIVED_S = 10.0
"""Time for which a message counts."""
MAX_SIGNERS = 64
"""Signers kept; the one that was heard first is forgotten."""


class ClockCheck:
    """Compares the own clock with the clocks of signers."""

    def __init__(self) -> None:
        """Start without messages."""
        self._errors: OrderedDict[bytes, tuple[float, float]] = OrderedDict()
        """(time of reception, own clock less the signer's in s) by HashedId8, not verified."""
        self._agreed_at: float | None = None
        self.is_wrong = False
        """Whether the own clock was found to be wrong, and no message has agreed with it since."""

    def receive_agreement(self, now: float) -> None:
        """Take that a verified message was sent at a time that fits the own clock."""
        self._agreed_at, self.is_wrong = now, False
        self._errors.clear()

    def receive_error(self, signer_id: bytes, error_s: float, now: float) -> None:
        """Take the time of a message that does not fit the own clock.

        Args:
            signer_id: HashedId8 of who claims to have signed it.
            error_s: the own clock less that of the message.
            now: the present time.
        """
        self._errors.pop(signer_id, None)
        self._errors[signer_id] = now, error_s
        if len(self._errors) > MAX_SIGNERS:
            self._errors.popitem(last=False)
        self.is_wrong = self.is_wrong or self.error_s(now) is not None

    def error_s(self, now: float) -> float | None:
        """Return by how much the own clock is ahead; `None` if it seems right."""
        if self._agreed_at is not None and now - self._agreed_at <= RECEIVED_S:
            return None
        errors = [error_s for at_s, error_s in self._errors.values() if now - at_s <= RECEIVED_S]
        if len(errors) < LEAST_SIGNERS:
            return None
        median_s = statistics.median(errors)
        alike = sum(abs(each - median_s) <= ALIKE_S for each in errors)
        return median_s if alike >= LEAST_SIGNERS and 2 * alike > len(errors) else None
