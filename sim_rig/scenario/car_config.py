"""The `onboard` configuration of a scenario's cars, the same in live and virtual runs."""

import math
from typing import Any

from onboard.security.plate_digest import PlateDigest
from onboard.security.settings import PlateDigestSettings
from onboard.tools.test_ca.authority import KnownPlate
from onboard.wave_udp.settings import RadioProfile
from sim_rig.scenario.schema import Scenario
from sim_rig.scenario.sensor_settings import ReceiverSettings

DIGEST = {"scrypt_log2_n": 6}
"""Scrypt at its lowest cost: in the rig, communication IDs need no protection from guessing."""


def car_config(scenario: Scenario, car: str, seed: int) -> dict[str, Any]:
    """Tree of the car's `CarConfig` without its interfaces and without ground truth of other cars.

    Args:
        scenario: the scenario of the run.
        car: name of the car.
        seed: seed of the car's random numbers.
    """
    it = scenario.cars[car]
    has_plates = any(other.plate is not None for other in scenario.cars.values())
    has_tags = any(other.tag_id is not None for other in scenario.cars.values())
    config: dict[str, Any] = {
        "seed": seed,
        "car": {"plate": it.identity, "length_m": it.length_m, "width_m": it.width_m},
        "vision": {
            "plates": has_plates,
            "plate_width_m": 0.52,
            "tag_dictionary": "4X4_50" if has_tags else None,
            "lane_width_m": scenario.lane_width_m,
        },
        "beacons": scenario.beacons,
        "lcca": scenario.lcca.model_dump(),
        # The GNSS antenna is at the middle of the roof, the camera at the front bumper.
        "mvs": {
            "shared_in": it.shared_in.value,
            "sensing": {"camera_ahead_m": it.length_m / 2},
        },
        "access": it.access.model_dump(mode="json"),
        "security": {"plate_digest": DIGEST},
    }
    if it.broadcast is not None:
        signals = it.broadcast.model_dump(mode="json", exclude_defaults=True)
        config["obd"] = {"broadcast": signals | {"dbc": str(it.broadcast.dbc.resolve())}}
    if scenario.profile is not RadioProfile.WAVE:
        config["radio"] = virtual_radio(scenario)
    return config | {"brake_request": {}} if it.obeys_request else config


def virtual_radio(scenario: Scenario) -> dict[str, object]:
    """Tree of the radio settings of a car whose frames the rig carries."""
    return {"endpoint": "raw", "interface": "air", "profile": scenario.profile.value}


def gnss_config(receiver: ReceiverSettings) -> dict[str, object]:
    """Tree of the car's GNSS settings, without the address of gpsd."""
    return {"latency_s": receiver.latency_s}


def plate_digest() -> PlateDigest:
    """Return a new digest of the rig's settings."""
    return PlateDigest(PlateDigestSettings.model_validate(DIGEST))


def known_plates(scenario: Scenario) -> dict[str, KnownPlate]:
    """Return what the certificates of the equipped cars commit to, by name."""
    digest = plate_digest()
    return {name: KnownPlate(scenario.cars[name].identity, digest) for name in scenario.equipped}


def names_by_id(scenario: Scenario, from_utc_s: float, until_utc_s: float) -> dict[str, str]:
    """Map each communication ID (hex) of the run to its car.

    Args:
        scenario: the scenario of the run.
        from_utc_s: UTC at the start of the run, s.
        until_utc_s: UTC at the end of the run, s; IDs of all epochs in between are included.
    """
    settings = PlateDigestSettings.model_validate(DIGEST)
    digest = PlateDigest(settings)
    first, last = (math.floor(utc_s / settings.epoch_s) for utc_s in (from_utc_s, until_utc_s))
    return {
        digest.car_id(scenario.cars[name].identity, epoch * settings.epoch_s).hex(): name
        for epoch in range(first, last + 1)
        for name in scenario.equipped
    }
