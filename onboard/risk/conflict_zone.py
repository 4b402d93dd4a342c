"""Conflict zone of two cars on crossing paths, in positions along these paths.

`s_a_m` and `s_b_m` are the positions of the cars' centres along their own paths, 0 where the paths
meet (figure 1). For every position of car A there is one interval of positions of car B in which
the two rectangles overlap; that interval, for all of A's positions, is the zone.
"""

from dataclasses import dataclass

import numpy as np

from onboard.kinematics.arrays import Array

SHALLOW_RAD = np.deg2rad(20.0)
"""Crossing angle below which the zone is evaluated at more positions."""

NEARLY_ORTHOGONAL = 1e-9
"""Cosine below which the zone is a rectangle."""


@dataclass(frozen=True, slots=True)
class CarSize:
    """Bumper to bumper and side to side; arrays broadcast over pairs."""

    length_m: Array
    width_m: Array


@dataclass(frozen=True, slots=True)
class XCrossing:
    """Two straight paths that cross at `angle_rad` between the headings, 90 degrees or any other.

    Two rectangles overlap unless one of their four side directions separates them (separating
    axis theorem); each direction gives one band of the (s_a, s_b) plane, together a hexagon, at a
    right angle the rectangle of section III-C.
    """

    a: CarSize
    b: CarSize
    angle_rad: Array

    @property
    def positions(self) -> int:
        """Two suffice where the interval does not depend on A's position, four with the corners.

        At a shallow angle the zone is long, and the trajectory of a car from rest is curved in it.
        """
        cosines = np.abs(np.cos(self.angle_rad))
        if bool(np.all(cosines < NEARLY_ORTHOGONAL)):
            return 2
        return 4 if bool(np.all(cosines < np.cos(SHALLOW_RAD))) else 17

    def corners_m(self) -> tuple[Array, ...]:
        """Return A's positions at the corners of the hexagon; none at a right angle."""
        if self.positions == 2:
            return ()
        cosine = np.cos(self.angle_rad)
        cosine = np.where(np.abs(cosine) < NEARLY_ORTHOGONAL, NEARLY_ORTHOGONAL, cosine)
        along_a, along_b = self._reach_m(self.a, self.b), self._reach_m(self.b, self.a)
        one = (along_b - self._half_extent_m(self.b, self.a)) / cosine
        other = np.sign(cosine) * (along_a - along_b * np.abs(cosine)) / (1.0 - cosine**2)
        return one, -one, other, -other

    def extent_m(self) -> tuple[Array, Array]:
        """Return A's first and last position with any overlap."""
        half = self._half_extent_m(self.a, self.b)
        return -half, half

    def interval_m(self, s_a_m: Array) -> tuple[Array, Array]:
        """Return B's first and last position that overlap with A at `s_a_m`."""
        half = self._half_extent_m(self.b, self.a)
        cosine = np.cos(self.angle_rad)
        slope = np.where(np.abs(cosine) < NEARLY_ORTHOGONAL, np.inf, cosine)
        along_a, along_b = self._reach_m(self.a, self.b), self._reach_m(self.b, self.a)
        with np.errstate(invalid="ignore"):
            one, other = (s_a_m - along_a) / slope, (s_a_m + along_a) / slope
        one = np.where(np.isinf(slope), -np.inf, one)
        other = np.where(np.isinf(slope), np.inf, other)
        low = np.maximum(-half, np.maximum(np.minimum(one, other), s_a_m * cosine - along_b))
        high = np.minimum(half, np.minimum(np.maximum(one, other), s_a_m * cosine + along_b))
        return low, high

    def _half_extent_m(self, own: CarSize, other: CarSize) -> Array:
        sine, cosine = np.abs(np.sin(self.angle_rad)), np.abs(np.cos(self.angle_rad))
        own_across = own.length_m * sine + own.width_m * cosine
        result: Array = 0.5 * (other.width_m + own_across) / sine
        return result

    def _reach_m(self, own: CarSize, other: CarSize) -> Array:
        """Half the sum of both cars' lengths as seen along `own`'s path."""
        sine, cosine = np.abs(np.sin(self.angle_rad)), np.abs(np.cos(self.angle_rad))
        result: Array = 0.5 * (own.length_m + other.length_m * cosine + other.width_m * sine)
        return result
