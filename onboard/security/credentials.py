"""The keys and certificates of a car or an authority."""

from dataclasses import dataclass, field

from onboard.security import p256
from onboard.security.certificates import Certificate


@dataclass(frozen=True, slots=True)
class Credential:
    """A pseudonym certificate and its private key."""

    certificate: Certificate
    key: p256.PrivateKey = field(repr=False)
    committed: tuple[bytes, ...] = field(default=(), repr=False)
    """Leaves of the vehicle IDs that the certificate commits to (`id_commitment`); empty: none."""


@dataclass(frozen=True, slots=True)
class Credentials:
    """Everything that `onboard keys` writes for one car."""

    pseudonyms: tuple[Credential, ...]
    """One or more."""
    roots: tuple[Certificate, ...]
    authorities: tuple[Certificate, ...]
    """Between roots and pseudonyms."""
    crls: tuple[bytes, ...] = ()
    """Signed revocation lists (SecuredCrl)."""

    @property
    def commit_to_ids(self) -> bool:
        """Whether the authority binds vehicle IDs to certificates: others then prove theirs too."""
        return any(each.committed for each in self.pseudonyms)


@dataclass(frozen=True, slots=True)
class Authority:
    """An issuer of certificates, with the chain that makes them verifiable."""

    credential: Credential
    roots: tuple[Certificate, ...]
    authorities: tuple[Certificate, ...]
    """Itself included, unless it is a root."""
