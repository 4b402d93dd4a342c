"""The head of a recording: all that the cores were given before the first input.

It holds no plate, no private key and no key of the plate digest; the words for plates and the IDs
that they had stand for them (`identities.py`), and any key signs as well as the right one in a
replay, where signatures are not compared.
"""

import datetime as dt
import json
from importlib.metadata import version
from typing import Any

import numpy as np

from onboard.access.driver_model import DEFAULT_POPULATION, DriverMemory, DriverModel
from onboard.config import CarConfig
from onboard.observations import Sensor
from onboard.recorder.identities import Aliases
from onboard.recorder.initial_state import InitialState
from onboard.security import p256
from onboard.security.certificate_codec import decode_certificate
from onboard.security.credentials import Credential, Credentials
from onboard.security.oer import Malformed, Unsupported
from onboard.settings import Settings, SettingsError, parse_settings

FORMAT = 1
"""Counts up when a replay of this software could no longer read what an older one wrote."""

OF_THE_CORES = frozenset({
    "car", "obd", "vision", "security", "lcca", "lcca_psid", "mvs", "risk", "access", "beacons",
    "sensor_timeouts",
})  # fmt: skip
"""The sections of a `CarConfig` that cores read. The others are wires and files, which may hold
addresses and passwords."""


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

    def car_config(self) -> CarConfig:
        """The configuration of the cores.

        Raises:
            SettingsError: this version of the software has no such setting.
        """
        return parse_settings(self.config, CarConfig, f"the recording of {self.drive}")

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

    def beginning(self) -> InitialState:
        """The same beginning again, for who drove as far as the box knew then.

        Raises:
            SettingsError: this version of the software cannot begin like that.
        """
        entropy, *spawn_key = self.seed
        return InitialState(
            config=self.car_config(),
            sensors=frozenset(self.sensors),
            seed=np.random.SeedSequence(entropy, spawn_key=spawn_key),
            now=self.now_s,
            utc_s=self.utc_s,
            credentials=self.credentials(),
            driver=DriverModel(DEFAULT_POPULATION, memory=self.driver),
        )


def make_header(beginning: InitialState, aliases: Aliases, *, is_complete: bool) -> RecordingHeader:
    """Write down what the cores are about to be given."""
    config, seed, credentials = beginning.config, beginning.seed, beginning.credentials
    tree = json.loads(config.model_dump_json(include=set(OF_THE_CORES), exclude_defaults=True))
    tree["car"]["plate"] = aliases.word(config.car.plate)
    tree.get("access", {}).pop("driver_file", None)
    tree.get("security", {}).pop("keys_folder", None)
    tree.get("security", {}).get("plate_digest", {}).pop("community_key", None)
    broadcast = config.obd.broadcast
    assert isinstance(seed.entropy, int)  # noqa: S101 (what numpy makes of None or a number)
    return RecordingHeader(
        drive=_name(beginning.utc_s),
        software=version("onboard"),
        seed=(seed.entropy, *seed.spawn_key),
        now_s=beginning.now,
        utc_s=beginning.utc_s,
        sensors=tuple(sorted(beginning.sensors)),
        config=tree,
        dbc=broadcast.dbc.read_text("latin-1") if broadcast is not None else None,
        certificates=None if credentials is None else _public(credentials),
        driver=None if beginning.driver is None else beginning.driver.memory(),
        is_complete=is_complete,
    )


def _name(utc_s: float) -> str:
    """Of a drive: 20250615T150640.000Z."""
    return f"{dt.datetime.fromtimestamp(utc_s, dt.UTC):%Y%m%dT%H%M%S.%f}"[:-3] + "Z"


def _public(credentials: Credentials) -> Certificates:
    return Certificates(
        pseudonyms=tuple(own.certificate.encoded.hex() for own in credentials.pseudonyms),
        roots=tuple(root.encoded.hex() for root in credentials.roots),
        authorities=tuple(authority.encoded.hex() for authority in credentials.authorities),
    )
