"""Makes certificates for tests, rigs and prototypes: a root, issuing authorities, pseudonyms.

A root may only issue through one authority in between, and an authority only pseudonyms, which
name nobody. Nothing here revokes: certificates are meant to be short-lived.
"""

from collections.abc import Callable, Collection, Iterable
from typing import TypedDict

from onboard.security import p256
from onboard.security.certificate_codec import (
    decode_certificate,
    encode_certificate,
    encode_signature,
    encode_to_be_signed,
)
from onboard.security.certificates import Certificate, IssuePermission, Permission, Subject
from onboard.security.credentials import Authority, Credential, Credentials

DAY_S = 86_400.0

NewKey = Callable[[], p256.PrivateKey]


class Validity(TypedDict):
    """The two arguments that every `make_*` takes."""

    valid_from_utc_s: float
    valid_for_s: float


def make_root(
    name: str,
    psids: Collection[int],
    *,
    valid_from_utc_s: float,
    valid_for_s: float,
    new_key: NewKey = p256.new_key,
) -> Authority:
    """Make a root that may grant `psids` to cars, through one authority in between."""
    key = new_key()
    grant = IssuePermission(frozenset(psids), min_chain_length=2)
    certificate = _signed(
        Subject(
            name, valid_from_utc_s, valid_for_s, p256.compressed(key.public_key()), (), (grant,)
        ),
        key,
        None,
    )
    return Authority(Credential(certificate, key), roots=(certificate,), authorities=())


def make_issuing(
    root: Authority,
    name: str,
    *,
    valid_from_utc_s: float,
    valid_for_s: float,
    new_key: NewKey = p256.new_key,
) -> Authority:
    """Make an authority under `root` that may grant to cars what `root` may."""
    key = new_key()
    psids = frozenset[int]().union(
        *(grant.psids or () for grant in root.credential.certificate.subject.issue_permissions)
    )
    subject = Subject(
        name,
        valid_from_utc_s,
        valid_for_s,
        p256.compressed(key.public_key()),
        (),
        (IssuePermission(psids),),
    )
    certificate = _signed(subject, root.credential.key, root.credential.certificate)
    return Authority(Credential(certificate, key), root.roots, (*root.authorities, certificate))


def make_pseudonyms(
    issuing: Authority,
    count: int,
    psids: Collection[int],
    *,
    valid_from_utc_s: float,
    valid_for_s: float,
    new_key: NewKey = p256.new_key,
) -> Credentials:
    """Make `count` certificates for one car to take in turns, all valid for the same time."""
    issuer = issuing.credential
    permissions = tuple(Permission(psid) for psid in sorted(psids))
    pseudonyms = []
    for _ in range(count):
        key = new_key()
        subject = Subject(
            None, valid_from_utc_s, valid_for_s, p256.compressed(key.public_key()), permissions
        )
        pseudonyms.append(Credential(_signed(subject, issuer.key, issuer.certificate), key))
    return Credentials(tuple(pseudonyms), issuing.roots, issuing.authorities)


def make_trial(
    cars: Iterable[str],
    psids: Collection[int],
    utc_s: float,
    new_key: NewKey = p256.new_key,
    *,
    pseudonyms: int = 4,
) -> dict[str, Credentials]:
    """Make all that a rig's cars need to sign and to believe each other for 23 hours.

    Args:
        cars: their names, the keys of what is returned.
        psids: what they speak in.
        utc_s: now; the certificates hold from an hour before, for a day.
        new_key: `p256.key_from(rng)` gives the same keys for the same seed.
        pseudonyms: how many for each car.
    """
    valid: Validity = {"valid_from_utc_s": utc_s - 3600.0, "valid_for_s": DAY_S}
    root = make_root("trial root", psids, new_key=new_key, **valid)
    issuing = make_issuing(root, "trial issuing", new_key=new_key, **valid)
    return {
        car: make_pseudonyms(issuing, pseudonyms, psids, new_key=new_key, **valid) for car in cars
    }


def _signed(subject: Subject, key: p256.PrivateKey, issuer: Certificate | None) -> Certificate:
    to_be_signed = encode_to_be_signed(subject)
    signer = p256.SELF_SIGNED if issuer is None else issuer.digest
    signature = p256.sign(key, p256.digest_to_sign(to_be_signed, signer))
    issuer_id = None if issuer is None else issuer.hashed_id8
    # Read back, so that the subject says what the wire says: durations come in whole units.
    return decode_certificate(
        encode_certificate(issuer_id, to_be_signed, encode_signature(signature))
    )
