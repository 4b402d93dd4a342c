"""What a user may set about signatures and pseudonyms."""

from pathlib import Path

from pydantic import Field, SecretStr

from onboard.settings import Settings


class PlateDigestSettings(Settings):
    """How a plate becomes a communication ID; equal in all cars of one trial."""

    community_key: SecretStr = Field(default=SecretStr("onboard-open-community"), min_length=16)
    """Shared by all cars of a trial. The default is public: it keeps plates out of sight of a
    casual listener and no more."""
    epoch_s: float = Field(default=300.0, ge=10.0, le=86_400.0)
    """How long an ID lives, in seconds. Epochs begin at multiples of it since 1970 (UTC), so that
    all cars change at once."""
    scrypt_log2_n: int = Field(default=14, ge=1, le=20)
    """Work for one derivation, as a power of two: 14 takes 16 MiB and about 35 ms."""


class SecuritySettings(Settings):
    """How messages are secured."""

    keys_folder: Path | None = None
    """The folder that `onboard keys` wrote for this car. Without one, messages go out as 1609.2
    unsecured data, and nothing that comes in is verified."""
    plate_digest: PlateDigestSettings = PlateDigestSettings()
    message_lifetime_s: float = Field(default=5.0, gt=0.0, le=30.0)
    """How old a signed message may be, in seconds. What it says about ages is up to the message."""
    clock_tolerance_s: float = Field(default=2.0, ge=0.0, le=10.0)
    """How far ahead of our own the sender's clock may be, in seconds."""
    certificate_interval_s: float = Field(default=0.45, ge=0.0, le=1.0)
    """How often a BSM carries the certificate, in seconds; the others name it by its digest. The
    default is SAE J2945/1's vCertAttachInterval. Group messages always carry it: they are few, and
    a warning cannot wait for the next certificate."""
    brakes_must_show: bool = True
    """Whether a hard brake is only believed of a car whose own speeds show it. Off in a
    demonstration whose cars have a brake button: pressing it does not brake."""
