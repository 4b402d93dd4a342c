"""Path history of the BSM: past positions in few points (SAE J2945/1).

The path between two points is straight to within `MAX_ERROR_M`. The test needs no stored positions
(cone algorithm of Sklansky and Gonzalez, 1980): each position narrows the cone of directions from
the last point in which all positions since lie near a line.
"""

import math
from collections import deque
from dataclasses import dataclass

from onboard.kinematics.geodesy import distance_m
from onboard.messages.bsm_safety import MAX_OFFSET_DEG, PathHistory, PathHistoryPoint
from onboard.observations import Position

MAX_ERROR_M = 1.0
"""Allowable error of the path between two points (SAE J2945/1)."""
MAX_CHORD_M = 210.0
"""Greatest distance of two points (SAE J2945/1)."""
LENGTH_M = 200.0
"""Distance that the points cover at least, once it has been driven (SAE J2945/1)."""
MAX_POINTS = 15
"""Points in a BSM (SAE J2945/1)."""
MAX_POINT_AGE_S = 600.0
"""Greatest age of a point; the field holds up to 655 s."""


@dataclass(slots=True)
class _Cone:
    """Directions from a point, in rad relative to `axis`."""

    axis: float
    left: float = -math.pi
    right: float = math.pi

    def narrow(self, direction: float, range_m: float) -> bool:
        """Narrow the cone by a position; return whether the position is in it.

        Args:
            direction: of the position from the point, in rad.
            range_m: of the position from the point, in m.
        """
        turn = math.remainder(direction - self.axis, math.tau)
        if not self.left <= turn <= self.right:
            return False
        half = math.asin(min(1.0, MAX_ERROR_M / range_m))
        self.left, self.right = max(self.left, turn - half), min(self.right, turn + half)
        return True


class PathHistoryKeeper:
    """Selects the points from the positions of the host vehicle."""

    def __init__(self) -> None:
        self._points: deque[Position] = deque(maxlen=MAX_POINTS)
        """Newest first."""
        self._last: Position | None = None
        self._cone: _Cone | None = None

    def receive_position(self, position: Position) -> None:
        """Take the newest position."""
        last = self._last
        if not self._points or last is None:
            self._points.appendleft(position)
        elif not self._extend_line(position):
            self._points.appendleft(last)
            self._cone = None
            self._extend_line(position)
        self._last = position

    def history(self, now: float) -> PathHistory | None:
        """Return the points as offsets from the last position; `None` without positions."""
        last = self._last
        if last is None:
            return None
        points: list[PathHistoryPoint] = []
        for point in self._points:
            apart_m = _distance_between_m(last, point)
            if apart_m < MAX_ERROR_M or now - point.stamp_s > MAX_POINT_AGE_S:
                continue
            encoded = _offset_point(point, last, now)
            if encoded is None:
                break
            points.append(encoded)
            if apart_m > LENGTH_M:
                break
        return PathHistory(None, None, tuple(points)) if points else None

    def _extend_line(self, position: Position) -> bool:
        """Extend the line from the newest point to a position; return whether it stays near all."""
        start = self._points[0]
        apart_m = _distance_between_m(start, position)
        if apart_m <= MAX_ERROR_M:
            return True
        direction = math.atan2(
            math.remainder(position.longitude_deg - start.longitude_deg, 360.0)
            * math.cos(math.radians(start.latitude_deg)),
            position.latitude_deg - start.latitude_deg,
        )
        if self._cone is None:
            self._cone = _Cone(direction)
        return apart_m <= MAX_CHORD_M and self._cone.narrow(direction, apart_m)


def _offset_point(point: Position, last: Position, now: float) -> PathHistoryPoint | None:
    """Return `point` relative to `last`; `None` beyond the range of the fields.

    That happens after a tunnel or near a pole.
    """
    north_deg = point.latitude_deg - last.latitude_deg
    east_deg = math.remainder(point.longitude_deg - last.longitude_deg, 360.0)
    if max(abs(north_deg), abs(east_deg)) > MAX_OFFSET_DEG:
        return None
    has_altitudes = point.altitude_m is not None and last.altitude_m is not None
    return PathHistoryPoint(
        latitude_offset_deg=north_deg,
        longitude_offset_deg=east_deg,
        elevation_offset_m=point.altitude_m - last.altitude_m if has_altitudes else None,  # type: ignore[operator]
        age_s=max(0.01, now - point.stamp_s),
    )


def _distance_between_m(one: Position, other: Position) -> float:
    return distance_m(one.latitude_deg, one.longitude_deg, other.latitude_deg, other.longitude_deg)
