"""Who the car is for now: certificate, temporary ID and plate digest, which change together.

If one of them stayed while the others changed, it would join the old identity to the new one.
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from onboard.security.credentials import Credential, Credentials
from onboard.security.plate_digest import PlateDigest


@dataclass(frozen=True, slots=True)
class CertificateExpired:
    """The car signs with a certificate that does not hold any more, or not yet: nobody believes it.

    `onboard keys car` makes new ones.
    """

    kind: ClassVar[str] = "certificate_expired"
    stamp_s: float
    valid_until_utc_s: float


@dataclass(frozen=True, slots=True)
class Pseudonym:
    """One identity."""

    car_id: bytes
    """Of the LCCA messages: the digest of the plate."""
    temporary_id: bytes
    """Of the BSMs."""
    first_msg_cnt: int
    """Where the BSMs begin to count, 0 to 127."""
    credential: Credential | None
    """What to sign with; `None`: messages are not signed."""
    ends_at_utc_s: float

    def is_out_of_date(self, utc_s: float) -> bool:
        """Whether messages signed with it are refused by everybody."""
        if self.credential is None:
            return False
        subject = self.credential.certificate.subject
        return not subject.valid_from_utc_s <= utc_s < subject.valid_until_utc_s


class Pseudonyms:
    """The identities of one car, one for each epoch of the plate digest."""

    def __init__(
        self,
        plate_text: str,
        digest: PlateDigest,
        credentials: Credentials | None,
        rng: np.random.Generator,
    ) -> None:
        """Take the pseudonym certificates of `credentials` in turns."""
        self._plate_text = plate_text
        self._digest = digest
        self._credentials = () if credentials is None else credentials.pseudonyms
        self._rng = rng
        self._current: Pseudonym | None = None

    def at(self, utc_s: float) -> Pseudonym:
        """Return the identity that holds at `utc_s`; the same object until it ends."""
        ends_at_utc_s = self._digest.epoch_ends_at(utc_s)
        if self._current is None or self._current.ends_at_utc_s != ends_at_utc_s:
            self._current = Pseudonym(
                car_id=self._digest.car_id(self._plate_text, utc_s),
                temporary_id=self._rng.bytes(4),
                first_msg_cnt=int(self._rng.integers(128)),
                credential=self._credential(utc_s, ends_at_utc_s),
                ends_at_utc_s=ends_at_utc_s,
            )
        return self._current

    def _credential(self, utc_s: float, ends_at_utc_s: float) -> Credential | None:
        """Return the certificate of this epoch, among those that hold for all of it.

        It follows from the epoch's number: a car that starts again within an epoch signs as before,
        and is not taken for a second one that goes by the same plate digest.

        Where none holds, one of all: others will refuse it as `expired` and say so, which is better
        than a car that falls silent.
        """
        holding = [each for each in self._credentials if _holds(each, utc_s, ends_at_utc_s)]
        among = holding or self._credentials
        return among[self._digest.epoch(utc_s) % len(among)] if among else None


def _holds(credential: Credential, utc_s: float, ends_at_utc_s: float) -> bool:
    subject = credential.certificate.subject
    return subject.valid_from_utc_s <= utc_s and ends_at_utc_s <= subject.valid_until_utc_s
