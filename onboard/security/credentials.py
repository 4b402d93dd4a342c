"""What a car signs with, and whom it trusts."""

from dataclasses import dataclass, field

from onboard.security import p256
from onboard.security.certificates import Certificate


@dataclass(frozen=True, slots=True)
class Credential:
    """A pseudonym certificate and its private key."""

    certificate: Certificate
    key: p256.PrivateKey = field(repr=False)


@dataclass(frozen=True, slots=True)
class Credentials:
    """All that `onboard keys` wrote for one car."""

    pseudonyms: tuple[Credential, ...]
    """At least one."""
    roots: tuple[Certificate, ...]
    authorities: tuple[Certificate, ...]
    """Between roots and pseudonyms."""


@dataclass(frozen=True, slots=True)
class Authority:
    """Somebody who issues certificates, and what those need to be believed."""

    credential: Credential
    roots: tuple[Certificate, ...]
    authorities: tuple[Certificate, ...]
    """Itself included, unless it is a root."""
