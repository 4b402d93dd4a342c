"""Reception of beacons around a building at the corner (Table II).

A beacon is received if its power is not below the receiver's sensitivity. The path loss is that of
free space plus the loss in walls and inside of a building (obstacle model, the paper's reference
39).
"""

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from onboard.settings import Settings
from sim_rig.studies.joerer.traffic import Array

LIGHT_M_S = 299_792_458.0


class BeaconSettings(Settings):
    """Table II, and the positions of the buildings."""

    frequency_hz: float = Field(5.89e9, gt=0.0)
    """Of the carrier."""
    transmit_power_w: float = Field(0.020, gt=0.0)
    """Of each beacon."""
    sensitivity_dbm: float = -94.0
    """Least received power at which a beacon is received."""
    per_wall_db: float = Field(9.0, ge=0.0)
    """Loss of each wall that the line of sight cuts."""
    per_metre_db: float = Field(0.4, ge=0.0)
    """Loss of each metre of the line of sight inside of a building."""
    setback_m: float = Field(10.0, ge=0.0)
    """From the middle of the crossing to the nearest walls, along either road."""
    building_m: float = Field(30.0, ge=0.0)
    """Length of a building along either road; there is one at each corner."""
    intervals_s: tuple[float, ...] = (1.0, 0.5, 0.1, 0.04)
    """Between two beacons of a car; each is evaluated."""


def is_received(distance_m: Array, settings: BeaconSettings) -> NDArray[np.bool_]:
    """Whether a beacon between cars at `distance_m` (..., 2) from the crossing is received."""
    along = np.maximum(np.abs(distance_m), 1e-3)
    apart_m = np.hypot(along[..., 0], along[..., 1])
    near, far = settings.setback_m, settings.setback_m + settings.building_m
    # The line of sight at t is (t x, (1 - t) y); the building is a square on the diagonal.
    first = np.maximum(near / along[..., 0], 1.0 - far / along[..., 1])
    last = np.minimum(far / along[..., 0], 1.0 - near / along[..., 1])
    inside_m = np.maximum(last - first, 0.0) * apart_m
    wavelength_m = LIGHT_M_S / settings.frequency_hz
    free_space_db = 20.0 * np.log10(4.0 * np.pi * apart_m / wavelength_m)
    shadow_db = np.where(inside_m > 0.0, 2.0 * settings.per_wall_db, 0.0)
    shadow_db += settings.per_metre_db * inside_m
    power_dbm = 10.0 * np.log10(settings.transmit_power_w * 1e3)
    received: NDArray[np.bool_] = power_dbm - free_space_db - shadow_db >= settings.sensitivity_dbm
    return received
