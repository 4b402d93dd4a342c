"""Course of a road in the plane.

x is east, y is north; headings are clockwise from north.
"""

import math
from bisect import bisect_right
from collections.abc import Sequence
from itertools import accumulate, pairwise

Point = tuple[float, float]


class Path:
    """A polyline that goes straight on beyond both ends."""

    def __init__(self, points_m: Sequence[Point]) -> None:
        """`points_m`: at least two points, consecutive ones different."""
        self._points_m = list(points_m)
        lengths_m = [math.dist(one, other) for one, other in pairwise(points_m)]
        self._begins_m = list(accumulate(lengths_m[:-1], initial=0.0))
        self._directions = [
            ((x1 - x0) / length_m, (y1 - y0) / length_m)
            for ((x0, y0), (x1, y1)), length_m in zip(pairwise(points_m), lengths_m, strict=True)
        ]

    def place(self, along_m: float, left_m: float) -> Point:
        """Position `along_m` from the start of the road and `left_m` to its left."""
        index = max(bisect_right(self._begins_m, along_m) - 1, 0)
        (x, y), (dx, dy) = self._points_m[index], self._directions[index]
        on_m = along_m - self._begins_m[index]
        return x + on_m * dx - left_m * dy, y + on_m * dy + left_m * dx


def bent_m(bends: Sequence[tuple[float, float, float]], step_m: float = 1.0) -> list[Point]:
    """Points of a road that begins at the origin eastwards and bends.

    Args:
        bends: start and end along the road and radius of each, in m, positive to the right.
        step_m: distance of the points in bends.
    """
    points, heading, along_m = [(0.0, 0.0)], 0.0, 0.0

    def go_on(length_m: float, turned_rad: float) -> None:
        nonlocal heading
        x, y = points[-1]
        middle = heading + turned_rad / 2
        points.append((x + length_m * math.cos(middle), y + length_m * math.sin(middle)))
        heading += turned_rad

    for from_m, until_m, radius_m in bends:
        if from_m > along_m:
            go_on(from_m - along_m, 0.0)
        steps = max(1, round((until_m - from_m) / step_m))
        for _ in range(steps):
            go_on((until_m - from_m) / steps, -(until_m - from_m) / steps / radius_m)
        along_m = until_m
    go_on(1.0, 0.0)
    return points


def heading_rad(rear: Point, front: Point) -> float:
    """Heading of a car with its bumpers at these positions."""
    return math.atan2(front[0] - rear[0], front[1] - rear[1])
