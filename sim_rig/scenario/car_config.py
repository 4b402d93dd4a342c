"""What a car of a scenario is told about itself: its configuration, the same live and virtual."""

import math
from typing import Any

from onboard.security.plate_digest import PlateDigest
from onboard.security.settings import PlateDigestSettings
from sim_rig.scenario.schema import Scenario
from sim_rig.scenario.sensor_settings import ReceiverSettings

DIGEST = {"scrypt_log2_n": 6}
"""Plates are cheap to derive on the desk, where nobody has to be kept from guessing them."""


def car_config(scenario: Scenario, car: str, seed: int) -> dict[str, Any]:
    """The tree of the car's `CarConfig`, without its wires. It holds no truth about the others."""
    it = scenario.cars[car]
    has_plates = any(other.plate is not None for other in scenario.cars.values())
    has_tags = any(other.tag_id is not None for other in scenario.cars.values())
    return {
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
        # The receiver's antenna is in the middle of the roof, the camera at the front bumper.
        "mvs": {"sensing": {"camera_ahead_m": it.length_m / 2}},
        "access": it.access.model_dump(mode="json"),
        "security": {"plate_digest": DIGEST},
    }


def gnss_config(receiver: ReceiverSettings) -> dict[str, object]:
    """The tree of what a car is told of its receiver, without where gpsd is."""
    return {"latency_s": receiver.latency_s}


def names_by_id(scenario: Scenario, from_utc_s: float, until_utc_s: float) -> dict[str, str]:
    """Which car sends under an ID (hex), in all the epochs that the run touches."""
    settings = PlateDigestSettings.model_validate(DIGEST)
    digest = PlateDigest(settings)
    first, last = (math.floor(utc_s / settings.epoch_s) for utc_s in (from_utc_s, until_utc_s))
    return {
        digest.car_id(scenario.cars[name].identity, epoch * settings.epoch_s).hex(): name
        for epoch in range(first, last + 1)
        for name in scenario.equipped
    }
