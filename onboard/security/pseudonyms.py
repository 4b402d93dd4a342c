"""Pseudonyms: certificate, temporary ID and communication ID, which change together.

An identifier that stayed while the others changed would link the old pseudonym to the new one.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from onboard.security.credentials import Credential, Credentials
from onboard.security.id_commitment import Proof, leaf, proof_of
from onboard.security.plate_digest import PlateDigest

FreshEntropy = Callable[[], bytes | None]
"""Returns secret random octets, `ENTROPY_BYTES`; `None` to go on with the present seed."""
ENTROPY_BYTES = 16


@dataclass(frozen=True, slots=True)
class CertificateExpired:
    """The host vehicle signs with a certificate that is not valid now: receivers refuse it.

    `onboard keys car` makes new ones.
    """

    kind: ClassVar[str] = "certificate_expired"
    stamp_s: float
    valid_until_utc_s: float


@dataclass(frozen=True, slots=True)
class Pseudonym:
    """The identifiers of one epoch."""

    car_id: bytes
    """Communication ID of LCCA messages."""
    temporary_id: bytes
    """Temporary ID of BSMs."""
    first_msg_cnt: int
    """First `msg_cnt` of its BSMs, 0 to 127."""
    credential: Credential | None
    """Certificate and key; `None` if messages are not signed."""
    ends_at_utc_s: float
    proof: Proof = ()
    """That the certificate commits to `car_id`; empty if it does not."""

    def is_out_of_date(self, utc_s: float) -> bool:
        """Whether its certificate is not valid at `utc_s`."""
        if self.credential is None:
            return False
        subject = self.credential.certificate.subject
        return not subject.valid_from_utc_s <= utc_s < subject.valid_until_utc_s


class Pseudonyms:
    """The pseudonyms of one car, one for each epoch of the plate digest."""

    def __init__(
        self,
        plate_text: str,
        digest: PlateDigest,
        credentials: Credentials | None,
        rng: np.random.Generator,
        fresh_entropy: FreshEntropy | None = None,
    ) -> None:
        """Use the pseudonym certificates of `credentials` in turns.

        Args:
            plate_text: the car's own plate.
            digest: derives the communication IDs.
            credentials: `None` if messages are not signed.
            rng: draws temporary IDs and message counts.
            fresh_entropy: asked at each change for a new seed of `rng`, which all cores share.
        """
        self._plate_text = plate_text
        self._digest = digest
        self._credentials = () if credentials is None else credentials.pseudonyms
        self._rng = rng
        self._fresh_entropy = fresh_entropy
        self._current: Pseudonym | None = None

    def at(self, utc_s: float) -> Pseudonym:
        """Return the pseudonym at `utc_s`; the same object until it ends."""
        ends_at_utc_s = self._digest.epoch_ends_at(utc_s)
        if self._current is None or self._current.ends_at_utc_s != ends_at_utc_s:
            if self._current is not None:
                self._reseed()
            car_id = self._digest.car_id(self._plate_text, utc_s)
            own = leaf(self._digest.epoch(utc_s), car_id)
            credential = self._credential(own, utc_s, ends_at_utc_s)
            committed = () if credential is None else credential.committed
            self._current = Pseudonym(
                car_id=car_id,
                temporary_id=self._rng.bytes(4),
                first_msg_cnt=int(self._rng.integers(128)),
                credential=credential,
                ends_at_utc_s=ends_at_utc_s,
                proof=proof_of(own, committed) or (),
            )
        return self._current

    def _reseed(self) -> None:
        """Let no earlier draw or seed tell anything of the next pseudonym."""
        entropy = None if self._fresh_entropy is None else self._fresh_entropy()
        if entropy is not None:
            fresh = type(self._rng.bit_generator)(np.random.SeedSequence(int.from_bytes(entropy)))
            self._rng.bit_generator.state = fresh.state

    def _credential(self, own: bytes, utc_s: float, ends_at_utc_s: float) -> Credential | None:
        """Return the certificate of this epoch, one that is valid for all of it.

        One that commits to the ID of the epoch comes first: only with it the ID can be proved.
        The epoch's number selects it: a car that restarts within an epoch signs as before and is
        not taken for a second signer of the same communication ID. If none is valid, an expired one
        is used: receivers refuse its messages with a reason, which is easier to diagnose than
        silence.
        """
        valid = [each for each in self._credentials if _is_valid(each, utc_s, ends_at_utc_s)]
        committed = [each for each in valid if own in each.committed]
        candidates = committed or valid or self._credentials
        return candidates[self._digest.epoch(utc_s) % len(candidates)] if candidates else None


def _is_valid(credential: Credential, utc_s: float, ends_at_utc_s: float) -> bool:
    subject = credential.certificate.subject
    return subject.valid_from_utc_s <= utc_s and ends_at_utc_s <= subject.valid_until_utc_s
