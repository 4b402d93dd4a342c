"""Trusted certificates: each chain is verified once and then kept."""

from collections import OrderedDict
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from onboard.security import p256
from onboard.security.certificates import Certificate
from onboard.security.rejection import NotTrusted, RejectionReason

_MAX_RECEIVED = 4096
"""Received certificates that are kept, those used last."""


@dataclass(frozen=True, slots=True, eq=False)
class Trusted:
    """A certificate whose chain was verified."""

    certificate: Certificate
    key: p256.PublicKey
    issuer: "Trusted | None"
    valid_from_utc_s: float
    """Latest start of validity in its chain."""
    valid_until_utc_s: float
    """Earliest end of validity in its chain."""
    psids: frozenset[int]
    """Applications that its holder may send in."""

    def chain(self) -> "Iterator[Trusted]":
        """Yield the certificates above it, from its issuer up to the root."""
        above = self.issuer
        while above is not None:
            yield above
            above = above.issuer


class TrustStore:
    """The roots, authorities and received certificates of one car."""

    def __init__(self, roots: Iterable[Certificate], authorities: Iterable[Certificate]) -> None:
        """Trust the self-signed `roots`, and certificates whose chain leads to one of them.

        Args:
            roots: from the car's own files, never received by radio.
            authorities: certificates between roots and cars, in any order.

        Raises:
            NotTrusted: one of them cannot be verified.
        """
        self._anchors: dict[bytes, Trusted] = {}
        self._received: OrderedDict[bytes, Trusted] = OrderedDict()
        for root in roots:
            if root.issuer_id is not None:
                raise NotTrusted(
                    RejectionReason.UNTRUSTED_ISSUER, f"{root.subject.name}: is not a root"
                )
            self._anchors[root.hashed_id8] = self._check(root, None)
        waiting = list(authorities)
        while waiting:
            ready = [each for each in waiting if each.issuer_id in self._anchors] or waiting[:1]
            for authority in ready:
                waiting.remove(authority)
                checked = self._check(authority, self._issuer(authority))
                self._anchors[authority.hashed_id8] = checked

    def find(self, hashed_id8: bytes) -> Trusted | None:
        """Return the certificate of this HashedId8 if it was verified; else `None`."""
        found = self._received.get(hashed_id8)
        if found is None:
            return self._anchors.get(hashed_id8)
        self._received.move_to_end(hashed_id8)
        return found

    def receive(self, certificate: Certificate) -> Trusted:
        """Verify a received certificate and keep it.

        Raises:
            NotTrusted: `untrusted_issuer`, `bad_certificate` or `unsupported`.
        """
        known = self.find(certificate.hashed_id8)
        if known is not None and known.certificate.encoded == certificate.encoded:
            return known
        trusted = self._check(certificate, self._issuer(certificate))
        self._received[certificate.hashed_id8] = trusted
        if len(self._received) > _MAX_RECEIVED:
            self._received.popitem(last=False)
        return trusted

    def _issuer(self, certificate: Certificate) -> Trusted:
        if certificate.issuer_id is None:
            raise NotTrusted(RejectionReason.UNTRUSTED_ISSUER, "signed by itself")
        issuer = self.find(certificate.issuer_id)
        if issuer is None:
            raise NotTrusted(
                RejectionReason.UNTRUSTED_ISSUER, f"{certificate.issuer_id.hex()} is not known"
            )
        return issuer

    def _check(self, certificate: Certificate, issuer: Trusted | None) -> Trusted:
        """Verify `certificate`; `issuer` is `None` for an own root."""
        subject = certificate.subject
        if subject.public_key is None or certificate.signature is None:
            raise NotTrusted(RejectionReason.UNSUPPORTED, "an implicit certificate")
        try:
            key = p256.public_key(subject.public_key)
        except ValueError as error:
            raise NotTrusted(
                RejectionReason.BAD_CERTIFICATE, "its key is not on the curve"
            ) from error
        trusted = Trusted(
            certificate,
            key,
            issuer,
            max(subject.valid_from_utc_s, issuer.valid_from_utc_s if issuer else 0.0),
            min(subject.valid_until_utc_s, issuer.valid_until_utc_s if issuer else float("inf")),
            frozenset(permission.psid for permission in subject.permissions),
        )
        _check_permissions(trusted)
        signer = p256.SELF_SIGNED if issuer is None else issuer.certificate.digest
        digest = p256.digest_to_sign(certificate.to_be_signed, signer)
        if not p256.is_signed(key if issuer is None else issuer.key, digest, certificate.signature):
            raise NotTrusted(RejectionReason.BAD_CERTIFICATE, "its issuer did not sign it")
        return trusted


def _check_permissions(trusted: Trusted) -> None:
    """Check that every authority above may grant the permissions of the certificate."""
    subject = trusted.certificate.subject
    for height, authority in enumerate(trusted.chain(), start=1):
        granted = authority.certificate.subject.issue_permissions
        if not granted:
            raise NotTrusted(RejectionReason.UNTRUSTED_ISSUER, "its issuer may not issue")
        for permission in subject.permissions:
            if not any(grant.covers(permission, height) for grant in granted):
                raise NotTrusted(
                    RejectionReason.UNTRUSTED_ISSUER,
                    f"its issuer may not grant PSID 0x{permission.psid:X}",
                )
