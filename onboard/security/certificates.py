"""Explicit certificates of IEEE 1609.2: who may say what, until when, and who vouches for it.

Certificates are kept in their canonical form, the one that is hashed and signed: points compressed,
the signature's r without a y (IEEE 1609.2-2022, 6.4).
"""

import hashlib
from dataclasses import dataclass, field
from functools import cached_property

from onboard.security import p256


@dataclass(frozen=True, slots=True)
class Permission:
    """One application that the holder may speak in."""

    psid: int
    ssp: bytes | None = None
    """Service-specific permissions, opaque."""


@dataclass(frozen=True, slots=True)
class IssuePermission:
    """What an authority may grant, and how far below itself."""

    psids: frozenset[int] | None
    """Applications it may grant without SSP; `None`: all of them, with any SSP."""
    any_ssp: frozenset[int] = frozenset()
    """Applications it may grant with any SSP or none."""
    min_chain_length: int = 1
    """1: the certificate directly below it is the last; 2: there is one authority between."""
    chain_length_range: int = 0
    """So many more are allowed; -1: any number."""

    def covers(self, permission: Permission, height: int) -> bool:
        """Return whether a certificate `height` steps below may hold `permission`."""
        longest = self.min_chain_length + self.chain_length_range
        if height < self.min_chain_length or (height > longest and self.chain_length_range != -1):
            return False
        if self.psids is None:
            return True
        if permission.psid in self.any_ssp:
            return True
        return permission.psid in self.psids and permission.ssp is None


@dataclass(frozen=True, slots=True)
class Subject:
    """What a certificate says of its holder."""

    name: str | None
    """`None` in a pseudonym certificate, which must not name anybody."""
    valid_from_utc_s: float
    valid_for_s: float
    public_key: bytes | None
    """A compressed point; `None` in an implicit certificate."""
    permissions: tuple[Permission, ...] = ()
    issue_permissions: tuple[IssuePermission, ...] = ()

    @property
    def valid_until_utc_s(self) -> float:
        """The first second in which it no longer holds."""
        return self.valid_from_utc_s + self.valid_for_s


@dataclass(frozen=True)
class Certificate:
    """A certificate as it was read or made."""

    subject: Subject
    issuer_id: bytes | None
    """HashedId8 of the certificate that signed this one; `None`: it signed itself."""
    to_be_signed: bytes = field(repr=False)
    signature: p256.Signature | None = field(repr=False)
    """`None` in an implicit certificate."""
    encoded: bytes = field(repr=False)

    @cached_property
    def digest(self) -> bytes:
        """SHA-256 of the canonical encoding."""
        return hashlib.sha256(self.encoded).digest()

    @property
    def hashed_id8(self) -> bytes:
        """The name under which others refer to it."""
        return self.digest[-8:]
