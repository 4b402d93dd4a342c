"""Settings of signatures and pseudonyms."""

from pathlib import Path
from typing import Self

from pydantic import Field, SecretStr, model_validator

from onboard.settings import Settings


class PlateDigestSettings(Settings):
    """How a communication ID is derived from a plate; equal in all cars of one trial."""

    community_key: SecretStr = Field(default=SecretStr("onboard-open-community"), min_length=16)
    """Secret of all cars of a trial. The default is public: it hides plates from casual listeners
    only."""
    epoch_s: float = Field(default=300.0, ge=10.0, le=86_400.0)
    """Period of pseudonyms: time for which an ID is valid, in seconds. Epochs begin at multiples
    of it since 1970 (UTC), so that all cars change at once."""
    scrypt_log2_n: int = Field(default=14, ge=1, le=20)
    """Cost of one derivation (N of scrypt, as a power of two): 14 takes 16 MiB and about 35 ms."""


class TokenSettings(Settings):
    """A PKCS #11 token with the private keys of this car."""

    module: Path
    """The library of the token, as /usr/lib/softhsm/libsofthsm2.so."""
    label: str = Field(min_length=1, max_length=32)
    """Label of the token."""
    pin_file: Path
    """File with the user's PIN, which only its owner may use (mode 600)."""


class SecuritySettings(Settings):
    """How messages are signed and verified."""

    keys_folder: Path | None = None
    """The folder that `onboard keys` wrote for this car. Without one, messages are sent as 1609.2
    unsecured data, and received messages are not verified."""
    token: TokenSettings | None = None
    """Where the private keys are, if not in `keys_folder`, which has the certificates."""
    plate_digest: PlateDigestSettings = PlateDigestSettings()
    check_braking: bool = True
    """Whether hard braking is accepted only of a sender whose BSM speeds do not contradict it, and
    signers of alarms that nothing confirms are ignored. Off on a test bench: nothing slows down."""

    @model_validator(mode="after")
    def _has_certificates_beside_a_token(self) -> Self:
        if self.token is not None and self.keys_folder is None:
            raise ValueError("`token` needs `keys_folder`: without certificates nothing is signed")
        return self
