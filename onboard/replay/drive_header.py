"""Converts the initial state of a vehicle's cores to the header of its recording, and back."""

import datetime as dt
import json

import numpy as np

from onboard.access.driver_model import DEFAULT_POPULATION, DriverModel
from onboard.obd.dbc_file import parse_signals
from onboard.recorder.build import present_build
from onboard.recorder.header import Certificates, RecordingHeader
from onboard.recorder.identities import Aliases
from onboard.replay.initial_state import InitialState
from onboard.security.credentials import Credentials
from onboard.settings import parse_settings
from onboard.vehicle.config import CarConfig
from onboard.wave_udp.settings import RadioProfile

OF_THE_CORES = frozenset({
    "car", "obd", "vision", "security", "lcca", "lcca_psid", "mvs", "risk", "brake_request",
    "access", "beacons", "sensor_timeouts",
})  # fmt: skip
"""The sections of a `CarConfig` that cores read. The others are connections and files, which may
hold addresses and passwords."""


def make_header(initial: InitialState, aliases: Aliases, *, is_complete: bool) -> RecordingHeader:
    """Return the header of a drive that starts with `initial`.

    Args:
        initial: what the cores are given before the first input.
        aliases: names to record in place of plates.
        is_complete: whether records that hold positions are kept.
    """
    config, seed, credentials = initial.config, initial.seed, initial.credentials
    tree = json.loads(config.model_dump_json(include=set(OF_THE_CORES), exclude_defaults=True))
    tree["car"]["plate"] = aliases.alias(config.car.plate)
    tree.get("access", {}).pop("driver_file", None)
    radio = config.radio
    if radio is not None and radio.profile is not RadioProfile.WAVE:  # without addresses
        tree["radio"] = {
            "endpoint": "raw",
            "interface": "-",
            "profile": radio.profile,
            "congestion_control": radio.congestion_control,
        }
    if config.interface is not None and config.interface.sends:
        tree["interface"] = {"sends": [each.model_dump() for each in config.interface.sends]}
    if "brake_request" in tree:  # without addresses
        tree["brake_request"] |= {"udp": None, "can": None}
    tree.get("security", {}).pop("keys_folder", None)
    tree.get("security", {}).get("plate_digest", {}).pop("community_key", None)
    assert isinstance(seed.entropy, int)  # noqa: S101 (what numpy makes of None or a number)
    return RecordingHeader(
        drive=_name(initial.utc_s),
        software=present_build().name,
        seed=(seed.entropy, *seed.spawn_key),
        now_s=initial.now,
        utc_s=initial.utc_s,
        sensors=tuple(sorted(initial.sensors)),
        config=tree,
        dbc=None if initial.signals is None else initial.signals.dbc_text,
        certificates=None if credentials is None else _public(credentials),
        driver=None if initial.driver is None else initial.driver.memory(),
        is_complete=is_complete,
    )


def _name(utc_s: float) -> str:
    """Return the name of a drive, as 20250615T150640.000Z."""
    return f"{dt.datetime.fromtimestamp(utc_s, dt.UTC):%Y%m%dT%H%M%S.%f}"[:-3] + "Z"


def _public(credentials: Credentials) -> Certificates:
    return Certificates(
        pseudonyms=tuple(own.certificate.encoded.hex() for own in credentials.pseudonyms),
        roots=tuple(root.encoded.hex() for root in credentials.roots),
        authorities=tuple(authority.encoded.hex() for authority in credentials.authorities),
        crls=tuple(crl.hex() for crl in credentials.crls),
        ids=tuple(b"".join(own.committed).hex() for own in credentials.pseudonyms),
    )


def initial_state_of(header: RecordingHeader) -> InitialState:
    """Return the initial state of a recorded drive.

    Raises:
        SettingsError: this version of the software does not have one of its settings, or one of
            its certificates cannot be read.
        UserError: its DBC file cannot be read.
    """
    entropy, *spawn_key = header.seed
    config = parse_settings(header.config, CarConfig, f"the recording of {header.drive}")
    broadcast = config.obd.broadcast
    return InitialState(
        config=config,
        sensors=frozenset(header.sensors),
        seed=np.random.SeedSequence(entropy, spawn_key=spawn_key),
        now=header.now_s,
        utc_s=header.utc_s,
        credentials=header.credentials(),
        driver=DriverModel(DEFAULT_POPULATION, memory=header.driver),
        signals=None if broadcast is None else parse_signals(broadcast, header.dbc or ""),
    )
