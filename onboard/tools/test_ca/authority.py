"""Issues certificates for tests, rigs and prototypes: a root, issuing authorities, pseudonyms.

A root issues authorities only, and an authority only pseudonyms, which have no name. Each signs
the revocation lists of what it issued.
"""

from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import TypedDict

from onboard.its_g5.permissions import cam_ssp, denm_ssp
from onboard.security import ecqv, ieee1609dot2, p256
from onboard.security.certificate_codec import (
    decode_certificate,
    encode_certificate,
    encode_signature,
    encode_to_be_signed,
)
from onboard.security.certificates import Certificate, IssuePermission, Permission, Subject
from onboard.security.credentials import Authority, Credential, Credentials
from onboard.security.crl import CrlContents, CrlSsp, HashIdCrl
from onboard.security.crl_codec import encode_crl, encode_ssp
from onboard.security.id_commitment import leaf, ssp_of
from onboard.security.plate_digest import PlateDigest
from onboard.security.region import GeographicRegion
from onboard.wave_udp.psid import CAM, CRL, DENM, J2735, LCCA

DAY_S = 86_400.0
SSPS_OF_CARS: Mapping[int, bytes] = {CAM: cam_ssp(), DENM: denm_ssp()}
"""What `onboard` says as an ordinary car."""
_SERIES = 1
_CRACA = Permission(CRL, encode_ssp(CrlSsp(is_craca=True, series=frozenset({_SERIES}))))
"""The permission to sign the revocation lists of the certificates below."""

NewKey = Callable[[], p256.PrivateKey]


@dataclass(frozen=True, slots=True)
class KnownPlate:
    """A vehicle's plate, to whose IDs its certificates commit."""

    text: str
    digest: PlateDigest
    psid: int = LCCA
    """Service of the messages that carry the IDs."""
    derived: Callable[[], None] = lambda: None
    """Called after each ID: one takes 34 ms."""

    def epochs(self, valid: "Validity") -> range:
        """Return the numbers of the epochs in which certificates are valid."""
        from_utc_s = valid["valid_from_utc_s"]
        first, last = (
            self.digest.epoch(utc_s) for utc_s in (from_utc_s, from_utc_s + valid["valid_for_s"])
        )
        return range(first, last + 1)

    def leaves(self, number: int, count: int, valid: "Validity") -> tuple[bytes, ...]:
        """Return the leaves of one of `count` certificates between which the vehicle changes.

        It is used in every `count`-th epoch (`Pseudonyms`).
        """
        epochs = self.epochs(valid)
        return tuple(map(self._leaf, epochs[(number - epochs.start) % count :: count]))

    def _leaf(self, epoch: int) -> bytes:
        own = leaf(epoch, self.digest.car_id(self.text, self.digest.begins_at(epoch)))
        self.derived()
        return own


class Validity(TypedDict):
    """The validity of a certificate, as arguments of the `make_*` functions."""

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
    """Make a self-signed root.

    Args:
        name: in the certificate.
        psids: services that may be granted to vehicles, through one issuing authority.
        valid_from_utc_s: beginning of the validity.
        valid_for_s: duration of the validity.
        new_key: creates the private key.
    """
    key = new_key()
    grants = (
        _grant(psids, min_chain_length=2),
        IssuePermission(frozenset(), any_ssp=frozenset({CRL})),
    )
    public_key = p256.compressed(key.public_key())
    subject = Subject(name, valid_from_utc_s, valid_for_s, public_key, (_CRACA,), grants)
    certificate = _signed(subject, key, None)
    return Authority(Credential(certificate, key), roots=(certificate,), authorities=())


def make_issuing(
    root: Authority,
    name: str,
    *,
    valid_from_utc_s: float,
    valid_for_s: float,
    new_key: NewKey = p256.new_key,
) -> Authority:
    """Make an authority that may grant the services of its root.

    Args:
        root: the issuer.
        name: in the certificate.
        valid_from_utc_s: beginning of the validity.
        valid_for_s: duration of the validity.
        new_key: creates the private key.
    """
    key = new_key()
    grants = root.credential.certificate.subject.issue_permissions
    psids = frozenset[int]().union(*((grant.psids or set()) | grant.any_ssp for grant in grants))
    subject = Subject(
        name,
        valid_from_utc_s,
        valid_for_s,
        p256.compressed(key.public_key()),
        (_CRACA,),
        (_grant(psids - {CRL}),),
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
    implicit: bool = False,
    region: GeographicRegion | None = None,
    plate: KnownPlate | None = None,
    ssps: Mapping[int, bytes] = SSPS_OF_CARS,
) -> Credentials:
    """Make the pseudonym certificates of one vehicle.

    Args:
        issuing: the issuer.
        count: number of certificates, all with the same validity.
        psids: services that they may sign.
        valid_from_utc_s: beginning of the validity.
        valid_for_s: duration of the validity.
        new_key: creates each private key.
        implicit: make implicit certificates.
        region: where they are valid; everywhere if not given.
        plate: to whose IDs they commit, in a service of `psids`; to none if not given. Of more
            certificates than epochs, those that are used in none commit to nothing.
        ssps: bitmaps of permissions in services of `psids`.
    """
    issuer = issuing.credential
    pseudonyms = []
    valid: Validity = {"valid_from_utc_s": valid_from_utc_s, "valid_for_s": valid_for_s}
    for number in range(count):
        key = new_key()
        leaves = () if plate is None else plate.leaves(number, count, valid)
        permissions = tuple(
            Permission(psid, ssp_of(leaves))
            if plate is not None and leaves and psid == plate.psid
            else Permission(psid, ssps.get(psid), is_bitmap=psid in ssps)
            for psid in sorted(psids)
        )
        subject = Subject(
            None,
            valid_from_utc_s,
            valid_for_s,
            p256.compressed(key.public_key()),
            permissions,
            region=region,
        )
        if implicit:
            own = _implicit(subject, key, issuer, ephemeral=new_key())
        else:
            own = Credential(_signed(subject, issuer.key, issuer.certificate), key)
        pseudonyms.append(replace(own, committed=leaves))
    return Credentials(tuple(pseudonyms), issuing.roots, issuing.authorities)


def make_trial(
    cars: Iterable[str],
    psids: Collection[int],
    utc_s: float,
    new_key: NewKey = p256.new_key,
    *,
    pseudonyms: int = 4,
    implicit: bool = False,
    others: Mapping[str, Collection[int]] = MappingProxyType({}),
    plates: Mapping[str, KnownPlate] | None = None,
    ssps: Mapping[int, bytes] = SSPS_OF_CARS,
) -> dict[str, Credentials]:
    """Make the credentials with which vehicles of a rig sign and verify for 23 hours.

    Args:
        cars: names of the vehicles.
        psids: services that they may sign.
        utc_s: now; the certificates are valid from an hour before, for a day.
        new_key: `p256.key_from(rng)` gives the same keys for the same seed.
        pseudonyms: number of certificates a vehicle.
        implicit: make implicit certificates.
        others: other stations by name, such as road-side units, with the services of each.
        plates: of the vehicles whose certificates commit to their IDs, by name.
        ssps: bitmaps of permissions in the vehicles' services.

    Returns:
        the credentials by name.
    """
    granted = set(psids).union(*others.values())
    valid = _of_a_trial(utc_s)
    root = make_root("trial root", granted, new_key=new_key, **valid)
    issuing = make_issuing(root, "trial issuing", new_key=new_key, **valid)
    return issue_trial(
        issuing,
        cars,
        psids,
        utc_s,
        new_key,
        pseudonyms=pseudonyms,
        implicit=implicit,
        others=others,
        plates=plates,
        ssps=ssps,
    )


def issue_trial(
    issuing: Authority,
    cars: Iterable[str],
    psids: Collection[int],
    utc_s: float,
    new_key: NewKey = p256.new_key,
    *,
    pseudonyms: int = 4,
    implicit: bool = False,
    others: Mapping[str, Collection[int]] = MappingProxyType({}),
    plates: Mapping[str, KnownPlate] | None = None,
    ssps: Mapping[int, bytes] = SSPS_OF_CARS,
) -> dict[str, Credentials]:
    """Make such credentials with an authority that exists; for the arguments see `make_trial`."""
    valid = _of_a_trial(utc_s)
    return {
        name: make_pseudonyms(
            issuing,
            count,
            services,
            new_key=new_key,
            implicit=implicit,
            plate=(plates or {}).get(name),
            ssps=ssps,
            **valid,
        )
        for name, count, services in (
            *((car, pseudonyms, psids) for car in cars),
            *((other, 1, services) for other, services in others.items()),
        )
    }


def _grant(psids: Collection[int], min_chain_length: int = 1) -> IssuePermission:
    """Return the permission to grant services: J2735's without SSP, others with any or none."""
    of_j2735 = J2735.intersection(psids)
    own = frozenset(psids) - of_j2735
    return IssuePermission(of_j2735, any_ssp=own, min_chain_length=min_chain_length)


def _of_a_trial(utc_s: float) -> Validity:
    return {"valid_from_utc_s": utc_s - 3600.0, "valid_for_s": DAY_S}


def make_crl(
    authority: Authority,
    certificates: Iterable[Certificate],
    *,
    serial: int,
    issued_utc_s: float,
    valid_for_s: float,
) -> bytes:
    """Return a signed list (SecuredCrl) that revokes certificates that `authority` issued.

    Args:
        authority: their issuer.
        certificates: all that are revoked, those of earlier lists included.
        serial: number of the list, one more than that of the last.
        issued_utc_s: now.
        valid_for_s: time until the next list.
    """
    own = authority.credential
    ends = {each.digest[-10:]: each.subject.valid_until_utc_s for each in certificates}
    contents = CrlContents(
        _SERIES,
        own.certificate.hashed_id8,
        issued_utc_s,
        issued_utc_s + valid_for_s,
        HashIdCrl(serial, ends),
    )
    to_be_signed = ieee1609dot2.encode_to_be_signed(encode_crl(contents), CRL, None)
    digest = p256.digest_to_sign(to_be_signed, own.certificate.digest)
    signature = p256.sign(own.key, digest)
    return ieee1609dot2.encode_signed(to_be_signed, own.certificate.hashed_id8, signature)


def _revocable(subject: Subject, issuer: Certificate) -> Subject:
    """Return a subject that the lists of its issuer may name."""
    return replace(subject, craca_id=issuer.digest[-3:], crl_series=_SERIES)


def _signed(subject: Subject, key: p256.PrivateKey, issuer: Certificate | None) -> Certificate:
    to_be_signed = encode_to_be_signed(subject if issuer is None else _revocable(subject, issuer))
    signer = p256.SELF_SIGNED if issuer is None else issuer.digest
    signature = p256.sign(key, p256.digest_to_sign(to_be_signed, signer))
    issuer_id = None if issuer is None else issuer.hashed_id8
    # Decoded again, since the encoding rounds durations to whole units.
    return decode_certificate(
        encode_certificate(issuer_id, to_be_signed, encode_signature(signature))
    )


def _implicit(
    subject: Subject, request: p256.PrivateKey, issuer: Credential, ephemeral: p256.PrivateKey
) -> Credential:
    """Return an implicit certificate for the holder of `request`, and the key that belongs to it.

    Here one program is both issuer and holder (SEC 4, 3.3 to 3.6).
    """
    certificate = issuer.certificate
    value = ecqv.reconstruction_point(request.public_key(), ephemeral)
    to_be_signed = encode_to_be_signed(
        replace(_revocable(subject, certificate), public_key=None, reconstruction_value=value)
    )
    e = ecqv.scalar(p256.digest_to_sign(to_be_signed, certificate.digest))
    r = ecqv.private_reconstruction(e, ephemeral, issuer.key)
    return Credential(
        decode_certificate(encode_certificate(certificate.hashed_id8, to_be_signed, None)),
        ecqv.private_key(e, request, r),
    )
