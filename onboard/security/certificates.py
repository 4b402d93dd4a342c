"""Certificates of IEEE 1609.2: permissions, validity and issuer of a public key.

Certificates are kept in canonical form, which is hashed and signed: points are compressed, and
the signature's r without a y (IEEE 1609.2-2022, 6.4).
"""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

from onboard.security import p256
from onboard.security.region import GeographicRegion


@dataclass(frozen=True, slots=True)
class Permission:
    """One application that the holder may send in."""

    psid: int
    ssp: bytes | None = None
    """Service-specific permissions."""
    is_bitmap: bool = False
    """Whether their bits are permissions, else octets of the application's own."""


@dataclass(frozen=True, slots=True)
class SspRange:
    """SSPs of one application that an authority may grant (IEEE 1609.2-2022, 6.4.31)."""

    psid: int
    opaque: frozenset[bytes] = frozenset()
    """Each of these; none if bitmaps are meant."""
    bitmap: tuple[bytes, bytes] | None = None
    """Value and mask: bitmaps that have the value's bits where the mask has ones."""

    def contains(self, permission: Permission) -> bool:
        """Return whether the SSP of `permission` is one of them."""
        if permission.psid != self.psid or permission.ssp is None:
            return False
        if not permission.is_bitmap:
            return permission.ssp in self.opaque
        if self.bitmap is None or any(len(part) != len(permission.ssp) for part in self.bitmap):
            return False
        ssp, value, mask = (
            int.from_bytes(octets, "big") for octets in (permission.ssp, *self.bitmap)
        )
        return (ssp ^ value) & mask == 0


@dataclass(frozen=True, slots=True)
class IssuePermission:
    """Permissions that an authority may grant, and at which depth of the chain."""

    psids: frozenset[int] | None
    """Applications that it may grant without SSP; `None`: all that no permission beside this one
    lists, with any SSP."""
    any_ssp: frozenset[int] = frozenset()
    """Applications that it may grant with any SSP or none."""
    some_ssps: frozenset[SspRange] = frozenset()
    min_chain_length: int = 1
    """1: it issues end certificates; 2: there is one authority in between."""
    chain_length_range: int = 0
    """Further authorities that are allowed in between; -1: any number."""

    def covers(self, permission: Permission, height: int) -> bool:
        """Return whether a certificate `height` steps below may hold `permission`."""
        longest = self.min_chain_length + self.chain_length_range
        if height < self.min_chain_length or (height > longest and self.chain_length_range != -1):
            return False
        if self.psids is None:
            return True
        if permission.psid in self.any_ssp:
            return True
        if permission.psid in self.psids and permission.ssp is None:
            return True
        return any(ssps.contains(permission) for ssps in self.some_ssps)

    def lists(self, psid: int) -> bool:
        """Return whether it names this application."""
        return (
            psid in self.any_ssp
            or psid in (self.psids or ())
            or any(ssps.psid == psid for ssps in self.some_ssps)
        )


def may_grant(grants: Sequence[IssuePermission], permission: Permission, height: int) -> bool:
    """Return whether an authority with these may grant `permission`, `height` steps below.

    Where an application is listed, what is said of all others does not count for it.
    """
    is_listed = any(grant.lists(permission.psid) for grant in grants)
    return any(
        grant.covers(permission, height)
        for grant in grants
        if not (is_listed and grant.psids is None)
    )


@dataclass(frozen=True, slots=True)
class GroupLinkageValue:
    """By which all certificates of a group of vehicles can be revoked together."""

    j_value: bytes
    """Encrypted index, 4 bytes."""
    value: bytes
    """9 bytes."""


@dataclass(frozen=True, slots=True)
class LinkageData:
    """By which all certificates of a vehicle can be revoked together (`linkage`)."""

    i_cert: int
    """Period of the certificate."""
    linkage_value: bytes
    """9 bytes."""
    group: GroupLinkageValue | None = None


@dataclass(frozen=True, slots=True)
class Subject:
    """The statements of a certificate about its holder."""

    name: str | None
    """`None` in a pseudonym certificate, which must not name its holder."""
    valid_from_utc_s: float
    valid_for_s: float
    public_key: bytes | None
    """A compressed point; `None` in an implicit certificate."""
    permissions: tuple[Permission, ...] = ()
    issue_permissions: tuple[IssuePermission, ...] = ()
    reconstruction_value: bytes | None = None
    """A compressed point, in an implicit certificate only (`ecqv`)."""
    linkage: LinkageData | None = None
    craca_id: bytes = bytes(3)
    """HashedId3 of the authority whose revocation lists may name it; zeros: none."""
    crl_series: int = 0
    """Series of these lists."""
    binary_id: bytes | None = None
    """An identifier in place of a name, as implicit certificates in use have it."""
    region: GeographicRegion | None = None
    assurance_level: int | None = None

    @property
    def valid_until_utc_s(self) -> float:
        """First second in which it is no longer valid."""
        return self.valid_from_utc_s + self.valid_for_s


@dataclass(frozen=True)
class Certificate:
    """A certificate."""

    subject: Subject
    issuer_id: bytes | None
    """HashedId8 of the issuer's certificate; `None` if it is self-signed."""
    to_be_signed: bytes = field(repr=False)
    signature: p256.Signature | None = field(repr=False)
    """`None` in an implicit certificate."""
    encoded: bytes = field(repr=False)

    def ssp(self, psid: int) -> bytes | None:
        """Return the service-specific permissions of one application; `None`: without."""
        found = (each.ssp for each in self.subject.permissions if each.psid == psid)
        return next(found, None)

    @property
    def is_implicit(self) -> bool:
        """Whether it has a reconstruction value in place of key and signature."""
        return self.signature is None

    @cached_property
    def digest(self) -> bytes:
        """SHA-256 of the canonical encoding."""
        return hashlib.sha256(self.encoded).digest()

    @property
    def hashed_id8(self) -> bytes:
        """Last eight octets of the digest, by which messages refer to it."""
        return self.digest[-8:]
