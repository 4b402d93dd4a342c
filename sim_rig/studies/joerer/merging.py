"""P_C of merging paths: the Y crossing of figure 1b, which the paper names and does not evaluate.

The approaches are those of the X crossing, up to the place where the paths meet. The second car
joins the first one's lane there, and both drive on in it; who follows whom beyond `merged_m` is no
matter of a crossing.
"""

from dataclasses import dataclass, replace

import numpy as np

from onboard.risk.conflict_zone import CarSize, XCrossing
from sim_rig.studies.joerer.traffic import Approaches, ApproachOutcome, Array

EVERY = 5
"""P_C of a hexagonal zone takes more time than that of a rectangle: ten states a second will do."""


@dataclass(frozen=True, slots=True)
class YCrossing:
    """B's path joins A's straight one at `angle_rad` and goes on in A's lane.

    Up to the junction B stands at the angle, from there on it is in line with A. The methods are
    those of `ConflictZone`.
    """

    a: CarSize
    b: CarSize
    angle_rad: Array
    """Between the headings, less than a right angle."""
    merged_m: Array
    """A's last position that counts, beyond the junction."""

    @property
    def is_orthogonal(self) -> bool:
        """Whether B's interval depends on A's position nowhere."""
        return False

    def extent_m(self) -> tuple[Array, Array]:
        """Return A's first and last position with any overlap that counts."""
        first, _ = self._before.extent_m()
        return np.minimum(first, -self._in_line_m), self.merged_m

    def first_m(self, s_a_m: Array) -> Array:
        """Return B's first position that overlaps with A at `s_a_m`."""
        begin, end = self._before.extent_m()
        first = self._before.first_m(s_a_m)
        joins = (s_a_m >= begin) & (s_a_m <= end) & (first <= 0.0)
        return np.where(joins, first, np.maximum(s_a_m - self._in_line_m, 0.0))

    def last_m(self, s_a_m: Array) -> Array:
        """Return B's last position that overlaps with A at `s_a_m`."""
        last = np.minimum(self._before.last_m(s_a_m), 0.0)
        return np.where(s_a_m >= -self._in_line_m, s_a_m + self._in_line_m, last)

    def interval_of_a_m(self, s_b_m: Array) -> tuple[Array, ...]:
        """Return A's first and last position that overlap with B at `s_b_m`."""
        before = self._before.interval_of_a_m(s_b_m)
        after = s_b_m - self._in_line_m, s_b_m + self._in_line_m
        return tuple(np.where(s_b_m < 0.0, *each) for each in zip(before, after, strict=True))

    def corners_m(self, side: float) -> tuple[Array, ...]:
        """Return A's positions where the interval has a corner or a jump."""
        _, end = self._before.extent_m()
        joined = (self._before.reach_m(), self._in_line_m, end)
        return (*self._before.corners_m(side), *(-side * each for each in joined))

    def sloped_edges(self, side: float) -> tuple[tuple[Array, Array], ...]:
        """Return slope and offset in m of a side's edges."""
        return (*self._before.sloped_edges(side), (np.array(1.0), side * self._in_line_m))

    @property
    def _before(self) -> XCrossing:
        return XCrossing(self.a, self.b, self.angle_rad)

    @property
    def _in_line_m(self) -> Array:
        result: Array = 0.5 * (self.a.length_m + self.b.length_m)
        return result


def merging(approaches: Approaches, zone: YCrossing) -> Approaches:
    """Return the approaches on merging paths, with one state of `EVERY`.

    Each ends with a contact, or when the first car is beyond the zone.
    """
    s_a, s_b = -approaches.distance_m[..., 0], -approaches.distance_m[..., 1]
    first, last = zone.extent_m()
    touches = (s_a >= first) & (s_a <= last) & (s_b > zone.first_m(s_a)) & (s_b < zone.last_m(s_a))
    over = touches | (s_a > last)
    ticks = np.where(over.any(axis=1), over.argmax(axis=1), s_a.shape[1])
    crash = touches.any(axis=1)
    return replace(
        approaches,
        outcome=np.where(crash, ApproachOutcome.CRASH, ApproachOutcome.NO_CRASH),
        end_s=ticks * approaches.tick_s,
        tick_s=EVERY * approaches.tick_s,
        distance_m=approaches.distance_m[:, ::EVERY],
        speed_m_s=approaches.speed_m_s[:, ::EVERY],
        acceleration_m_s2=approaches.acceleration_m_s2[:, ::EVERY],
    )
