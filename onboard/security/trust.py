"""Trusted certificates: each chain is verified once and then kept."""

from collections import OrderedDict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

from onboard.security import ecqv, p256
from onboard.security.certificates import Certificate, Subject, may_grant
from onboard.security.crl import CrlContents
from onboard.security.region import GeographicRegion
from onboard.security.rejection import NotTrusted, RejectionReason
from onboard.security.revocation import Revocations

_MAX_RECEIVED = 4096
"""Received certificates that are kept, those used last."""


@dataclass(frozen=True, slots=True, eq=False)
class Trusted:
    """A certificate whose chain was verified; of an implicit one, the chain above it."""

    certificate: Certificate
    key: p256.PublicKey
    issuer: "Trusted | None"
    valid_from_utc_s: float
    """Latest start of validity in its chain."""
    valid_until_utc_s: float
    """Earliest end of validity in its chain."""
    psids: frozenset[int]
    """Applications that its holder may send in."""
    regions: tuple[GeographicRegion, ...] = ()
    """Where its chain is valid: in all of them."""

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
        self._revocations = Revocations()
        self._revoked: set[bytes] = set()
        """HashedId8 of those of the above that are revoked, or below a revoked one."""
        for root in roots:
            if root.issuer_id is not None:
                raise NotTrusted(
                    RejectionReason.UNTRUSTED_ISSUER, f"{root.subject.name}: is not a root"
                )
            self._anchors[root.hashed_id8] = _check(root, None)
        waiting = list(authorities)
        while waiting:
            ready = [each for each in waiting if each.issuer_id in self._anchors] or waiting[:1]
            for authority in ready:
                waiting.remove(authority)
                checked = _check(authority, self._issuer(authority))
                self._anchors[authority.hashed_id8] = checked

    def knows(self, hashed_id8: bytes) -> bool:
        """Whether the certificate of this HashedId8 was verified; to ask is not to use it."""
        return hashed_id8 in self._received or hashed_id8 in self._anchors

    def find(self, hashed_id8: bytes) -> Trusted | None:
        """Return the certificate of this HashedId8 if it was verified; else `None`."""
        found = self._received.get(hashed_id8)
        if found is None:
            return self._anchors.get(hashed_id8)
        self._received.move_to_end(hashed_id8)
        return found

    def receive_certificate(self, certificate: Certificate) -> Trusted:
        """Verify a received certificate; keep it, unless it is implicit.

        Raises:
            NotTrusted: `unknown_issuer`, `untrusted_issuer`, `bad_certificate` or `unsupported`.
        """
        known = self.find(certificate.hashed_id8)
        if known is not None and known.certificate.encoded == certificate.encoded:
            return known
        trusted = _check(certificate, self._issuer(certificate))
        if not certificate.is_implicit:
            self.keep(trusted)
        return trusted

    def signer(self, signer: bytes | tuple[Certificate, ...]) -> Trusted:
        """Return the certificate by which a message names its signer.

        Args:
            signer: HashedId8, or the certificate and its chain, which are received.

        Raises:
            NotTrusted: `unknown_certificate`, or as `receive_certificate`.
        """
        if isinstance(signer, bytes):
            known = self.find(signer)
            if known is None:
                raise NotTrusted(RejectionReason.UNKNOWN_CERTIFICATE, signer.hex())
            return known
        *above, own = reversed(signer)
        for certificate in above:
            self.receive_certificate(certificate)
        return self.receive_certificate(own)

    def revoke(self, contents: CrlContents) -> None:
        """Revoke what a verified list names."""
        self._revocations.add(contents)
        for trusted in (*self._anchors.values(), *self._received.values()):
            self._mark(trusted)

    def is_revoked(self, trusted: Trusted) -> bool:
        """Return whether a kept certificate, or one above it, is revoked."""
        return trusted.certificate.hashed_id8 in self._revoked

    def keep(self, trusted: Trusted) -> None:
        """Keep a received certificate, an implicit one after its holder's first valid signature.

        Anybody can make implicit certificates that give some key: kept before, they would push out
        those of others.
        """
        self._received[trusted.certificate.hashed_id8] = trusted
        if len(self._received) > _MAX_RECEIVED:
            forgotten, _ = self._received.popitem(last=False)
            self._revoked.discard(forgotten)
        self._mark(trusted)

    def _mark(self, trusted: Trusted) -> None:
        """Note whether a certificate is revoked: once, since linkage values take long."""
        chain = (trusted, *trusted.chain())
        ids = [each.certificate.hashed_id8 for each in chain]
        if any(
            self._revocations.is_revoked(each.certificate, ids[height:])
            for height, each in enumerate(chain)
        ):
            self._revoked.add(ids[0])

    def _issuer(self, certificate: Certificate) -> Trusted:
        if certificate.issuer_id is None:
            raise NotTrusted(RejectionReason.UNTRUSTED_ISSUER, "signed by itself")
        issuer = self.find(certificate.issuer_id)
        if issuer is None:
            raise NotTrusted(RejectionReason.UNKNOWN_ISSUER, certificate.issuer_id.hex())
        if issuer.certificate.is_implicit:
            raise NotTrusted(RejectionReason.UNSUPPORTED, "an implicit certificate of an authority")
        return issuer


def _check(certificate: Certificate, issuer: Trusted | None) -> Trusted:
    """Verify `certificate`; `issuer` is `None` for an own root."""
    subject = certificate.subject
    above = () if issuer is None else (issuer, *issuer.chain())
    psids = _granted_psids(subject, above)
    try:
        key = _key(certificate, issuer)
    except ValueError as error:
        raise NotTrusted(RejectionReason.BAD_CERTIFICATE, "its key is not on the curve") from error
    return Trusted(
        certificate,
        key,
        issuer,
        max(subject.valid_from_utc_s, issuer.valid_from_utc_s if issuer else 0.0),
        min(subject.valid_until_utc_s, issuer.valid_until_utc_s if issuer else float("inf")),
        psids,
        tuple(
            each.region
            for each in (subject, *(authority.certificate.subject for authority in above))
            if each.region is not None
        ),
    )


def _key(certificate: Certificate, issuer: Trusted | None) -> p256.PublicKey:
    """Return the key of a certificate that its issuer signed, or that is implicit.

    Raises:
        NotTrusted: the issuer did not sign it.
        ValueError: its key is not on the curve.
    """
    subject, signature = certificate.subject, certificate.signature
    signer = p256.SELF_SIGNED if issuer is None else issuer.certificate.digest
    digest = p256.digest_to_sign(certificate.to_be_signed, signer)
    if subject.reconstruction_value is not None and issuer is not None:
        return ecqv.public_key(subject.reconstruction_value, ecqv.scalar(digest), issuer.key)
    if subject.public_key is not None and signature is not None:
        key = p256.public_key(subject.public_key)
        if p256.is_signed(key if issuer is None else issuer.key, digest, signature):
            return key
    raise NotTrusted(RejectionReason.BAD_CERTIFICATE, "its issuer did not sign it")


def _granted_psids(subject: Subject, above: Sequence[Trusted]) -> frozenset[int]:
    """Return the applications that all authorities, from issuer to root, grant the subject.

    Authorities sign no messages: for one, whatever else its certificate names is left out.

    Raises:
        NotTrusted: one of them may not issue, or may not grant what an end certificate names.
    """
    grants = [authority.certificate.subject.issue_permissions for authority in above]
    if not all(grants):
        raise NotTrusted(RejectionReason.UNTRUSTED_ISSUER, "its issuer may not issue")
    refused = frozenset(
        permission.psid
        for permission in subject.permissions
        for height, granted in enumerate(grants, start=1)
        if not may_grant(granted, permission, height)
    )
    if refused and not subject.issue_permissions:
        listed = ", ".join(f"0x{psid:X}" for psid in sorted(refused))
        raise NotTrusted(
            RejectionReason.UNTRUSTED_ISSUER, f"its issuer may not grant PSID {listed}"
        )
    return frozenset(permission.psid for permission in subject.permissions) - refused
