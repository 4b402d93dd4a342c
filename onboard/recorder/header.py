"""Header of a recording: everything that the cores were given before the first input.

It holds no plate, no private key and no key of the plate digest. Aliases and communication IDs
stand for plates (`identities.py`). A replay signs with any key, since it does not compare
signatures.
"""

from typing import Any

from onboard.access.driver_model import DriverMemory
from onboard.observations import Sensor
from onboard.security import p256
from onboard.security.certificate_codec import decode_certificate
from onboard.security.credentials import Credential, Credentials
from onboard.security.oer import Malformed, Unsupported
from onboard.settings import Settings, SettingsError

FORMAT = 1
"""Counts up when a replay of this software could no longer read what an older one wrote."""


class Certificates(Settings):
    """What was signed with and whom the car trusted, as hexadecimal 1609.2 certificates."""

    pseudonyms: tuple[str, ...]
    roots: tuple[str, ...]
    authorities: tuple[str, ...]


class RecordingHeader(Settings):
    """What a drive began with."""

    drive: str
    """Its name: when it began, in UTC."""
    software: str
    """Version of `onboard`."""
    seed: tuple[int, ...]
    """Of everything random: entropy and spawn key of a `numpy.random.SeedSequence`."""
    now_s: float
    utc_s: float
    sensors: tuple[Sensor, ...]
    config: dict[str, Any]
    """The tree of a `CarConfig`, without wires and keys, and without what is as by default: a
    replay takes the defaults of its own software, which may have other settings."""
    dbc: str | None
    """The file that `config` names, if it does."""
    certificates: Certificates | None
    driver: DriverMemory | None
    is_complete: bool
    """Whether everything was recorded that the cores decided from."""

    def credentials(self) -> Credentials | None:
        """The car's certificates, each with a key that is not its own.

        Raises:
            SettingsError: one of them is none.
        """
        if self.certificates is None:
            return None
        try:
            pseudonyms, roots, authorities = (
                tuple(decode_certificate(bytes.fromhex(each)) for each in encoded)
                for encoded in (
                    self.certificates.pseudonyms,
                    self.certificates.roots,
                    self.certificates.authorities,
                )
            )
        except (ValueError, Malformed, Unsupported) as error:
            raise SettingsError(f"the recording of {self.drive}: a certificate: {error}") from error
        return Credentials(
            tuple(Credential(certificate, p256.new_key()) for certificate in pseudonyms),
            roots,
            authorities,
        )
