"""Signed revocation lists: verified before they revoke anything (IEEE 1609.2-2022, 7.4)."""

from onboard.security import ieee1609dot2, p256
from onboard.security.credentials import Credentials
from onboard.security.crl import CrlContents
from onboard.security.crl_codec import decode_crl, decode_ssp
from onboard.security.ieee1609dot2 import UnsecuredData
from onboard.security.oer import Malformed, Unsupported
from onboard.security.rejection import NotTrusted, RejectionReason
from onboard.security.trust import Trusted, TrustStore
from onboard.wave_udp import psid


def trust_store(credentials: Credentials) -> TrustStore:
    """Return what a car trusts, less what its revocation lists name.

    Raises:
        NotTrusted: an authority's certificate or a list is not valid.
    """
    trust = TrustStore(credentials.roots, credentials.authorities)
    for crl in credentials.crls:
        load_crl(crl, trust)
    return trust


def load_crl(data: bytes, trust: TrustStore) -> CrlContents:
    """Revoke in `trust` what a SecuredCrl names, and return it.

    Raises:
        NotTrusted: it is malformed or unsigned, or its signer may not sign it.
    """
    try:
        message = ieee1609dot2.decode(data)
        if isinstance(message, UnsecuredData):
            raise NotTrusted(RejectionReason.UNSIGNED)
        contents = decode_crl(message.payload)
        if message.psid != psid.CRL:
            raise NotTrusted(RejectionReason.WRONG_PSID, f"signed for 0x{message.psid:X}")
        signer = trust.signer(message.signer)
        _check_signer(contents, signer)
    except Malformed as malformed:
        raise NotTrusted(RejectionReason.MALFORMED, str(malformed)) from malformed
    except Unsupported as unsupported:
        raise NotTrusted(RejectionReason.UNSUPPORTED, str(unsupported)) from unsupported
    digest = p256.digest_to_sign(message.to_be_signed, signer.certificate.digest)
    if not p256.is_signed(signer.key, digest, message.signature):
        raise NotTrusted(RejectionReason.BAD_SIGNATURE)
    trust.keep(signer)
    if trust.is_revoked(signer):
        raise NotTrusted(RejectionReason.REVOKED, "its signer")
    trust.revoke(contents)
    return contents


def _check_signer(contents: CrlContents, signer: Trusted) -> None:
    """Check that the signer's certificate permits this list (7.4.3.3)."""
    permission = next(
        (each for each in signer.certificate.subject.permissions if each.psid == psid.CRL), None
    )
    if permission is None or permission.ssp is None or psid.CRL not in signer.psids:
        raise NotTrusted(RejectionReason.WRONG_PSID, "its signer may not sign revocation lists")
    ssp = decode_ssp(permission.ssp)
    craca = signer if ssp.is_craca else signer.issuer
    if craca is None or craca.certificate.hashed_id8 != contents.craca_id8:
        raise NotTrusted(RejectionReason.UNTRUSTED_ISSUER, "its signer is not of its CRACA")
    if contents.series not in ssp.series:
        raise NotTrusted(
            RejectionReason.UNTRUSTED_ISSUER, f"its signer may not sign series {contents.series}"
        )
    if not signer.valid_from_utc_s <= contents.issued_utc_s < signer.valid_until_utc_s:
        raise NotTrusted(RejectionReason.EXPIRED, "its signer's certificate, when it was issued")
