"""Path loss over distance.

Losses are in dB over distances in metres, vectorised. The two-ray model is the usual approximation
(Rappaport, "Wireless Communications", 4.6): free space up to the crossover distance, then the
fourth power of the distance.
"""

import math
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from onboard.settings import Settings

Array = NDArray[np.float64]

LIGHT_M_S = 299_792_458.0
NEAREST_M = 1.0
"""Shorter distances count as this."""


class LogDistance(Settings):
    """Log-distance model: one exponent from 1 m on."""

    model: Literal["log-distance"] = "log-distance"
    """One exponent from 1 m on."""
    reference_db: float = Field(default=47.86, ge=0.0, le=100.0)
    """At 1 m."""
    exponent: float = Field(default=2.75, ge=1.0, le=8.0)
    """The loss grows by ten times this in dB with each tenfold distance."""

    def loss_db(self, distance_m: Array) -> Array:
        """What is lost over each distance."""
        return self.reference_db + 10.0 * self.exponent * np.log10(_not_nearer(distance_m))


class DualSlope(Settings):
    """Dual-slope model: one exponent up to a breakpoint and a larger one beyond, for roads."""

    model: Literal["dual-slope"] = "dual-slope"
    """One exponent up to a breakpoint, and another one beyond."""
    reference_db: float = Field(default=47.86, ge=0.0, le=100.0)
    """At 1 m."""
    near_exponent: float = Field(default=2.0, ge=1.0, le=8.0)
    """The loss grows by ten times this in dB with each tenfold distance, up to `breakpoint_m`."""
    far_exponent: float = Field(default=3.8, ge=1.0, le=8.0)
    """The same beyond `breakpoint_m`."""
    breakpoint_m: float = Field(default=100.0, gt=1.0, le=10_000.0)
    """Distance from which `far_exponent` counts."""

    def loss_db(self, distance_m: Array) -> Array:
        """What is lost over each distance."""
        distance_m = _not_nearer(distance_m)
        near_db = 10.0 * self.near_exponent * np.log10(np.minimum(distance_m, self.breakpoint_m))
        beyond = np.maximum(distance_m / self.breakpoint_m, 1.0)
        return self.reference_db + near_db + 10.0 * self.far_exponent * np.log10(beyond)


class TwoRay(Settings):
    """Two-ray ground model: the direct ray and the one reflected by the road."""

    model: Literal["two-ray"] = "two-ray"
    """The direct ray and the one reflected by the road."""
    antenna_height_m: float = Field(default=1.5, gt=0.0, le=20.0)
    """Of both antennas above the road."""
    frequency_ghz: float = Field(default=5.86, gt=0.5, le=10.0)
    """Of the carrier."""

    def loss_db(self, distance_m: Array) -> Array:
        """What is lost over each distance."""
        distance_m = _not_nearer(distance_m)
        wave_m = LIGHT_M_S / (1e9 * self.frequency_ghz)
        crossover_m = 4.0 * math.pi * self.antenna_height_m**2 / wave_m
        free_db = 20.0 * np.log10(4.0 * math.pi * distance_m / wave_m)
        ground_db = 40.0 * np.log10(distance_m) - 40.0 * math.log10(self.antenna_height_m)
        return np.where(distance_m <= crossover_m, free_db, ground_db)


PathLoss = Annotated[LogDistance | DualSlope | TwoRay, Field(discriminator="model")]


def _not_nearer(distance_m: Array) -> Array:
    return np.maximum(distance_m, NEAREST_M)
