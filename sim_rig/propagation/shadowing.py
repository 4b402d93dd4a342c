"""Attenuation by buildings and cars between two antennas.

Buildings after Sommer et al., "A Computationally Inexpensive Empirical Model of IEEE 802.11p Radio
Shadowing in Urban Environments" (WONS 2011): a loss for each wall that the line of sight cuts, and
a loss per metre inside. Cars after Boban et al., "Impact of Vehicles as Obstacles in Vehicular Ad
Hoc Networks" (JSAC 2011), as single knife edges (ITU-R P.526, 4.1), of which the largest counts.
"""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from onboard.settings import Settings

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]

_CLEAR_BELOW = -0.78
"""Fresnel parameter below which an edge causes no loss."""

Corner = Annotated[tuple[float, float], Field(description="x and y in metres")]


class Building(Settings):
    """Ground plan of a building."""

    corners_m: tuple[Corner, ...] = Field(min_length=3)
    """In either order of rotation; the last is joined to the first."""
    wall_db: float = Field(default=9.0, ge=0.0, le=60.0)
    """Loss of each wall cut."""
    inside_db_per_m: float = Field(default=0.4, ge=0.0, le=10.0)
    """Loss of each metre of the line of sight inside."""

    def loss_db(self, from_m: Array, to_m: Array) -> Array:
        """Loss of each line of sight, (lines,), from `from_m` to `to_m`, both (lines, 2)."""
        corners_m = np.array(self.corners_m)
        x, y = corners_m.T
        if np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y) < 0.0:
            corners_m = corners_m[::-1]  # anticlockwise from here on
        wall_m = np.roll(corners_m, -1, axis=0) - corners_m
        line_m = to_m - from_m
        # A wall is cut if its ends are on different sides of the line. Each corner's side is
        # computed once for both its walls, so that a line through a corner cuts both or neither.
        to_corner_m = corners_m[None] - from_m[:, None]
        left = _cross(line_m[:, None], to_corner_m) > 0.0
        span = _cross(line_m[:, None], wall_m[None])
        crossing = (left != np.roll(left, -1, axis=1)) & (span != 0.0)
        t = np.divide(_cross(to_corner_m, wall_m[None]), span, np.zeros_like(span), where=crossing)
        cut = crossing & (t >= 0.0) & (t <= 1.0)
        # Walls at exits add the part of the line before them, walls at entries subtract it.
        inside = np.sum(np.where(cut, np.sign(span) * t, 0.0), axis=1) + self._holds(
            to_m, corners_m
        )
        inside_m = inside * np.linalg.norm(line_m, axis=1)
        loss_db: Array = self.wall_db * cut.sum(axis=1)
        loss_db += self.inside_db_per_m * np.maximum(inside_m, 0.0)
        return loss_db

    def _holds(self, point_m: Array, corners_m: Array) -> Bools:
        """Whether each point is inside: a ray from it cuts an odd number of walls."""
        (x, y), (corner_x, corner_y) = point_m.T, corners_m.T
        next_x, next_y = np.roll(corner_x, -1), np.roll(corner_y, -1)
        beside = (corner_y > y[:, None]) != (next_y > y[:, None])
        with np.errstate(divide="ignore", invalid="ignore"):
            slope = (next_x - corner_x) / (next_y - corner_y)
            cut_x = corner_x + (y[:, None] - corner_y) * slope
        odd: Bools = np.sum(beside & (x[:, None] < cut_x), axis=1) % 2 == 1
        return odd


@dataclass(frozen=True, slots=True, eq=False)
class VehicleShadowing:
    """All cars on the road, with or without a radio."""

    middle_m: Array
    """(vehicles, 2)."""
    width_m: Array
    """(vehicles,)."""
    roof_m: Array
    """(vehicles,) above the road."""

    def loss_db(self, from_m: Array, to_m: Array, antenna_m: float, wave_m: float) -> Array:
        """Loss of each line of sight by the car that attenuates most; 0 without cars between.

        Args:
            from_m: (lines, 2).
            to_m: (lines, 2).
            antenna_m: height of the antennas; a car does not shadow its own.
            wave_m: wavelength.
        """
        line_m = to_m - from_m
        length_m = np.linalg.norm(line_m, axis=1)[:, None]
        to_vehicle_m = self.middle_m[None] - from_m[:, None]
        with np.errstate(divide="ignore", invalid="ignore"):
            along_m = np.einsum("lvx,lx->lv", to_vehicle_m, line_m) / length_m
            aside_m = np.abs(_cross(to_vehicle_m, line_m[:, None])) / length_m
            rest_m = length_m - along_m
            ends = (along_m <= self.width_m) | (rest_m <= self.width_m)
            between = (aside_m <= self.width_m / 2.0) & ~ends
            above_m = self.roof_m - antenna_m
            v = above_m * np.sqrt(2.0 * length_m / (wave_m * along_m * rest_m))
            knife_db = 6.9 + 20.0 * np.log10(np.hypot(v - 0.1, 1.0) + v - 0.1)
        shadows = between & (v > _CLEAR_BELOW)
        worst_db: Array = np.max(np.where(shadows, knife_db, 0.0), axis=1, initial=0.0)
        return worst_db


def _cross(one: Array, other: Array) -> Array:
    product: Array = one[..., 0] * other[..., 1] - one[..., 1] * other[..., 0]
    return product
