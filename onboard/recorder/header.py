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
from onboard.security.id_commitment import leaves_in
from onboard.security.oer import Malformed, Unsupported
from onboard.settings import Settings, SettingsError

FORMAT = 5
"""Version of the format; raised, with a migration, whenever a recorded input changes."""


class Certificates(Settings):
    """Own and trusted certificates, and revocation lists: IEEE 1609.2 in hexadecimal."""

    pseudonyms: tuple[str, ...]
    roots: tuple[str, ...]
    authorities: tuple[str, ...]
    crls: tuple[str, ...] = ()
    ids: tuple[str, ...] = ()
    """Of each pseudonym, the leaves of the vehicle IDs that it commits to; empty: of none."""


class RecordingHeader(Settings):
    """Initial state of the cores in a recorded drive."""

    drive: str
    """Name of the drive: its start in UTC."""
    software: str
    """The build of `onboard` that made the recording."""
    seed: tuple[int, ...]
    """Seed of all random draws until the first change of the pseudonym: entropy and spawn key of a
    `numpy.random.SeedSequence`."""
    now_s: float
    utc_s: float
    sensors: tuple[Sensor, ...]
    config: dict[str, Any]
    """The `CarConfig` as a tree, without connections, keys and default values: a replay uses the
    defaults of its own version."""
    dbc: str | None
    """Text of the DBC file that `config` names."""
    certificates: Certificates | None
    driver: DriverMemory | None
    is_complete: bool
    """Whether every input of the cores was recorded."""

    def credentials(self) -> Credentials | None:
        """Return the certificates of the host vehicle, each with a newly generated key.

        Raises:
            SettingsError: one of them cannot be decoded.
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
            crls = tuple(bytes.fromhex(crl) for crl in self.certificates.crls)
            ids = self.certificates.ids or ("",) * len(pseudonyms)
            own = tuple(
                Credential(certificate, p256.new_key(), leaves_in(bytes.fromhex(committed)))
                for certificate, committed in zip(pseudonyms, ids, strict=True)
            )
        except (ValueError, Malformed, Unsupported) as error:
            raise SettingsError(f"the recording of {self.drive}: a certificate: {error}") from error
        return Credentials(own, roots, authorities, crls)
