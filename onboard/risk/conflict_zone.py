"""Conflict zone of two cars on crossing paths, in positions along these paths.

`s_a_m` and `s_b_m` are the positions of the cars' centres along their own paths, 0 where the paths
meet (figure 1). For every position of car A there is one interval of positions of car B in which
the two rectangles overlap; that interval, for all of A's positions, is the zone.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from onboard.kinematics.arrays import Array

NEARLY_ORTHOGONAL = 1e-9
"""Cosine below which the zone is a rectangle."""


@dataclass(frozen=True, slots=True)
class CarSize:
    """Bumper to bumper and side to side; arrays broadcast over pairs."""

    length_m: Array
    width_m: Array


class ConflictZone(Protocol):
    """What P_C needs to know of a crossing; `side` is -1 for B's first position, 1 for its last."""

    @property
    def is_orthogonal(self) -> bool:
        """Whether B's interval depends on A's position nowhere."""

    def extent_m(self) -> tuple[Array, Array]:
        """Return A's first and last position with any overlap."""

    def first_m(self, s_a_m: Array) -> Array:
        """Return B's first position that overlaps with A at `s_a_m`."""

    def last_m(self, s_a_m: Array) -> Array:
        """Return B's last position that overlaps with A at `s_a_m`."""

    def interval_of_a_m(self, s_b_m: Array) -> tuple[Array, ...]:
        """Return A's first and last position that overlap with B at `s_b_m`.

        None at a right angle, where they are those of `extent_m`.
        """

    def corners_m(self, side: float) -> tuple[Array, ...]:
        """Return A's positions at the corners of a side, between its ends."""

    def sloped_edges(self, side: float) -> tuple[tuple[Array, Array], ...]:
        """Return slope and offset in m of the edges of a side that depend on A's position.

        On such an edge B is at `slope * s_a_m + offset`.
        """


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
    def is_orthogonal(self) -> bool:
        """Whether B's interval depends on A's position nowhere."""
        return bool(np.all(np.abs(np.cos(self.angle_rad)) < NEARLY_ORTHOGONAL))

    @property
    def _cosine(self) -> Array:
        cosine = np.cos(self.angle_rad)
        return np.where(np.abs(cosine) < NEARLY_ORTHOGONAL, NEARLY_ORTHOGONAL, cosine)

    def corners_m(self, side: float) -> tuple[Array, ...]:
        """Return A's positions at the corners of a side; none at a right angle."""
        if self.is_orthogonal:
            return ()
        cosine = self._cosine
        along_a, along_b = self.reach_m(), self._reach_m(self.b, self.a)
        one = (along_b - self._half_extent_m(self.b, self.a)) / cosine
        other = np.sign(cosine) * (along_a - along_b * np.abs(cosine)) / (1.0 - cosine**2)
        return -side * one, -side * other

    def sloped_edges(self, side: float) -> tuple[tuple[Array, Array], ...]:
        """Return slope and offset in m of a side's edges; none at a right angle."""
        if self.is_orthogonal:
            return ()
        cosine = self._cosine
        along_a, along_b = self.reach_m(), self._reach_m(self.b, self.a)
        return (1.0 / cosine, side * along_a / np.abs(cosine)), (cosine, side * along_b)

    def reach_m(self) -> Array:
        """Return A's last position that overlaps with B in the middle of the crossing."""
        return self._reach_m(self.a, self.b)

    def extent_m(self) -> tuple[Array, Array]:
        """Return A's first and last position with any overlap."""
        half = self._half_extent_m(self.a, self.b)
        return -half, half

    def interval_m(self, s_a_m: Array) -> tuple[Array, Array]:
        """Return B's first and last position that overlap with A at `s_a_m`."""
        return self.first_m(s_a_m), self.last_m(s_a_m)

    def first_m(self, s_a_m: Array) -> Array:
        """Return B's first position that overlaps with A at `s_a_m`."""
        first = -self._half_extent_m(self.b, self.a)
        for slope, offset_m in self.sloped_edges(-1.0):
            first = np.maximum(first, slope * s_a_m + offset_m)
        return first

    def last_m(self, s_a_m: Array) -> Array:
        """Return B's last position that overlaps with A at `s_a_m`."""
        return -self.first_m(-s_a_m)

    def interval_of_a_m(self, s_b_m: Array) -> tuple[Array, ...]:
        """Return A's first and last position that overlap with B at `s_b_m`.

        None at a right angle, where they are those of `extent_m`.
        """
        if self.is_orthogonal:
            return ()
        return XCrossing(self.b, self.a, -self.angle_rad).interval_m(s_b_m)

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
