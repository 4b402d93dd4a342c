"""Where the car has been, in few points: the path history of its BSM (SAE J2945/1, 6.3.2).

The way from each point to the next is straight to within `MOST_ERROR_M`. Whether it still is takes
no look back (the cone of Sklansky and Gonzalez, 1980): each position narrows the directions from
the last point in which all positions so far lie near the line.
"""

import math
from collections import deque
from dataclasses import dataclass

from onboard.kinematics.geodesy import distance_m
from onboard.messages.bsm_safety import FARTHEST_OFFSET_DEG, PathHistory, PathHistoryPoint
from onboard.observations import Position

MOST_ERROR_M = 1.0
LONGEST_CHORD_M = 210.0
LENGTH_M = 200.0
"""So far back the points reach, where the car has come as far."""
MOST_POINTS = 15
OLDEST_S = 600.0
"""An age has room for 655 s."""


@dataclass(slots=True)
class _Cone:
    """Directions from a point, in radians around `axis`."""

    axis: float
    left: float = -math.pi
    right: float = math.pi

    def narrow(self, direction: float, distance: float) -> bool:
        """Take a position; return whether it lies within what those before have left."""
        turn = math.remainder(direction - self.axis, math.tau)
        if not self.left <= turn <= self.right:
            return False
        half = math.asin(min(1.0, MOST_ERROR_M / distance))
        self.left, self.right = max(self.left, turn - half), min(self.right, turn + half)
        return True


class PathHistoryKeeper:
    """Chooses the points as the car drives."""

    def __init__(self) -> None:
        self._points: deque[Position] = deque(maxlen=MOST_POINTS)
        """The newest first."""
        self._last: Position | None = None
        self._cone: _Cone | None = None

    def receive_position(self, position: Position) -> None:
        """Take where the car is now."""
        last = self._last
        if not self._points or last is None:
            self._points.appendleft(position)
        elif not self._is_near_line(position):
            self._points.appendleft(last)
            self._cone = None
            self._is_near_line(position)
        self._last = position

    def history(self, now: float) -> PathHistory | None:
        """Return the points as offsets from the last position; `None` if there is none yet."""
        last = self._last
        if last is None:
            return None
        crumbs: list[PathHistoryPoint] = []
        for point in self._points:
            way_m = _way_m(last, point)
            if way_m < MOST_ERROR_M or now - point.stamp_s > OLDEST_S:
                continue
            crumb = _crumb(point, last, now)
            if crumb is None:
                break
            crumbs.append(crumb)
            if way_m > LENGTH_M:
                break
        return PathHistory(None, None, tuple(crumbs)) if crumbs else None

    def _is_near_line(self, position: Position) -> bool:
        start = self._points[0]
        way_m = _way_m(start, position)
        if way_m <= MOST_ERROR_M:
            return True
        direction = math.atan2(
            math.remainder(position.longitude_deg - start.longitude_deg, 360.0)
            * math.cos(math.radians(start.latitude_deg)),
            position.latitude_deg - start.latitude_deg,
        )
        if self._cone is None:
            self._cone = _Cone(direction)
        return way_m <= LONGEST_CHORD_M and self._cone.narrow(direction, way_m)


def _crumb(point: Position, last: Position, now: float) -> PathHistoryPoint | None:
    """`None` if `point` is farther off than the message can say: behind a tunnel, near a pole."""
    north_deg = point.latitude_deg - last.latitude_deg
    east_deg = math.remainder(point.longitude_deg - last.longitude_deg, 360.0)
    if max(abs(north_deg), abs(east_deg)) > FARTHEST_OFFSET_DEG:
        return None
    has_heights = point.altitude_m is not None and last.altitude_m is not None
    return PathHistoryPoint(
        latitude_offset_deg=north_deg,
        longitude_offset_deg=east_deg,
        elevation_offset_m=point.altitude_m - last.altitude_m if has_heights else None,  # type: ignore[operator]
        age_s=max(0.01, now - point.stamp_s),
    )


def _way_m(one: Position, other: Position) -> float:
    return distance_m(one.latitude_deg, one.longitude_deg, other.latitude_deg, other.longitude_deg)
