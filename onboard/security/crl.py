"""Certificate revocation lists: their contents, and who may sign them (IEEE 1609.2, 7.3, 7.4.3)."""

from collections.abc import Mapping
from dataclasses import dataclass

from onboard.security.linkage import SeedPair


@dataclass(frozen=True, slots=True)
class HashIdCrl:
    """Certificates that are revoked one by one (ToBeSignedHashIdCrl)."""

    serial: int
    expiry_utc_s: Mapping[bytes, float]
    """End of validity by HashedId10."""


@dataclass(frozen=True, slots=True)
class LinkedRevocation:
    """Seeds of a revoked vehicle, or of a revoked group of vehicles."""

    i_max: int
    """Last period of which it has certificates."""
    j_max: int | None
    """Most certificates in a period; `None` for a group."""
    seeds: SeedPair
    """Of the period `LinkageCrl.i_rev`."""


@dataclass(frozen=True, slots=True)
class LinkageCrl:
    """Vehicles all of whose certificates are revoked (ToBeSignedLinkageValueCrl)."""

    i_rev: int
    """Period from which they are revoked."""
    index_within_i: int
    entries: tuple[LinkedRevocation, ...]


@dataclass(frozen=True, slots=True)
class CrlContents:
    """A list, as its signature covers it."""

    series: int
    craca_id8: bytes
    """HashedId8 of the certificate revocation authorizing CA."""
    issued_utc_s: float
    next_utc_s: float
    """When the next list is expected."""
    body: HashIdCrl | LinkageCrl


@dataclass(frozen=True, slots=True)
class CrlSsp:
    """What a certificate with the PSID of CRLs permits its holder."""

    is_craca: bool
    """Whether it is the CRACA itself; else its issuer is."""
    series: frozenset[int]
