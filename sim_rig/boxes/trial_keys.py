"""Certificates of a run: of an authority of its own, or of the one that issued a box's keys."""

import shutil
import time
from collections.abc import Collection, Mapping
from dataclasses import replace
from pathlib import Path

from onboard.recorder.header import RecordingHeader
from onboard.security.credentials import Authority, Credentials
from onboard.security.key_files import (
    KeyFilesError,
    check_ids,
    read_authority,
    read_credentials,
    trusted,
    write_authority,
    write_credentials,
)
from onboard.tools.test_ca.authority import (
    DAY_S,
    KnownPlate,
    Validity,
    issue_trial,
    make_issuing,
    make_pseudonyms,
    make_root,
    make_trial,
)
from onboard.wave_udp import psid
from sim_rig.boxes.settings import BoxSettings
from sim_rig.cars.background_traffic import background_names
from sim_rig.road_side.open_channel import other_stations
from sim_rig.scenario.car_config import known_plates
from sim_rig.scenario.schema import Scenario

_BOX_DAYS = 30
_BOX_PSEUDONYMS = 20
_RUN_S = 3600.0
"""A run is over by then."""


def run_credentials(
    scenario: Scenario, boxes: Mapping[str, BoxSettings], utc_s: float
) -> dict[str, Credentials]:
    """Return the credentials of all stations of a run; a box has its own already.

    A vehicle beside a box has those of an earlier run, since a box rightly distrusts an ID that two
    signers use.

    Raises:
        KeyFilesError: the boxes' folder of keys cannot be read or made, or a box's certificates are
            not of its car.
    """
    cars = [*scenario.equipped, *background_names(scenario)]
    others, plates = other_stations(scenario), known_plates(scenario)
    if not boxes:
        return make_trial(
            cars,
            scenario.psids,
            utc_s,
            others=others,
            plates=plates,
        )
    folder = next(iter(boxes.values())).keys
    issuing = _authority(folder)
    for car in boxes:
        plate = plates[car]
        if (folder / car).exists():
            check_ids(folder / car, plate.text, plate.digest)
            continue
        own = make_pseudonyms(
            issuing, _BOX_PSEUDONYMS, scenario.psids, plate=plate, **_valid(utc_s, _BOX_DAYS)
        )
        write_credentials(folder / car, own)
    trial = issue_trial(issuing, cars, scenario.psids, utc_s, others=others, plates=plates)
    for car in plates.keys() - boxes.keys():
        trial[car] = _kept(folder / "others", trial[car], scenario.psids, plates[car], utc_s)
    for credentials in trial.values():
        # An authority that may not grant a service is an error now, not silence in the run.
        trusted(credentials, [folder / "issuing"] * len(credentials.pseudonyms))
    return trial


def _kept(
    folder: Path, new: Credentials, psids: Collection[int], plate: KnownPlate, utc_s: float
) -> Credentials:
    """Return the credentials of a plate in `folder`, where `new` ones are kept if none serve."""
    folder.mkdir(mode=0o700, exist_ok=True)
    own = folder / plate.text
    try:
        kept = read_credentials(own, psids)
        check_ids(own, plate.text, plate.digest)
    except KeyFilesError:
        kept = new
    until_utc_s = kept.pseudonyms[0].certificate.subject.valid_until_utc_s
    if kept is new or kept.authorities != new.authorities or utc_s + _RUN_S > until_utc_s:
        shutil.rmtree(own, ignore_errors=True)
        write_credentials(own, new)
        return new
    return kept


def make_keys_of_drive(folder: Path, header: RecordingHeader) -> None:
    """Make keys for a box that plays a recorded drive, unless there are some in its `folder`.

    They are of a new authority, valid at the time of the drive, and trust those of the drive: a
    recording has no private keys.

    Raises:
        UserError: the folder cannot be written, or a certificate of the drive cannot be read.
    """
    of_drive = header.credentials()
    if of_drive is None or folder.exists():
        return
    folder.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    issuing = _new_authority(header.utc_s)
    own = make_pseudonyms(
        issuing, _BOX_PSEUDONYMS, psid.OF_VEHICLES, **_valid(header.utc_s, _BOX_DAYS)
    )
    trusting = replace(
        own,
        roots=own.roots + of_drive.roots,
        authorities=own.authorities + of_drive.authorities,
        crls=of_drive.crls,
    )
    write_credentials(folder, trusting)


def _authority(folder: Path) -> Authority:
    """Read the authority of a trial, or make one in a new folder."""
    if folder.exists():
        return read_authority(folder / "issuing")
    folder.mkdir(mode=0o700, parents=True)
    issuing = _new_authority(time.time())
    write_authority(folder / "issuing", issuing)
    return issuing


def _new_authority(utc_s: float) -> Authority:
    valid = _valid(utc_s, 365)
    root = make_root("trial root", psid.OF_VEHICLES | psid.OF_ROAD_SIDE_UNITS, **valid)
    return make_issuing(root, "trial issuing", **valid)


def _valid(utc_s: float, days: float) -> Validity:
    return {"valid_from_utc_s": utc_s - 3600.0, "valid_for_s": days * DAY_S}
