"""Cars around, as the driver sees them: ahead and to the right of the own car."""

import math
from collections.abc import Collection, Iterator, Sequence

from onboard.hmi.driver_view import VehicleOnMap
from onboard.mvs.perceived_object import ObjectSource, PerceivedObject
from onboard.observations import VehicleDetection

RANGE_M = 150.0
"""What is farther away is not on the map."""
MOST_CARS = 24
"""The nearest; more cannot be read at a glance, whoever tells of them."""
MOVES_M_S = 1.0
"""Slower, a course over ground is noise."""


class VehicleMap:
    """Places cars on the map. Without an own position only the own camera tells."""

    def __init__(self, length_m: float) -> None:
        """`length_m` of the own car, and taken for others, of which nobody knows it."""
        self._length_m = length_m
        self._heading_rad: float | None = None

    def place(
        self,
        own: PerceivedObject | None,
        cars: Sequence[PerceivedObject],
        seen: Sequence[VehicleDetection],
        in_alarm: Collection[str] = (),
    ) -> list[VehicleOnMap]:
        """Map positions, the nearest first.

        Args:
            own: the own car; `None` without a position.
            cars: the others, in the same frame.
            seen: by the own camera, in its last picture; only of use without a position, since
                `cars` has them too.
            in_alarm: names of the cars that an alarm is about.
        """
        placed = self._seen(seen) if own is None else self._known(own, cars, in_alarm)
        near = [car for car in placed if math.hypot(car.ahead_m, car.right_m) <= RANGE_M]
        return sorted(near, key=lambda car: math.hypot(car.ahead_m, car.right_m))[:MOST_CARS]

    def right_m(self, own: PerceivedObject | None, car: PerceivedObject) -> float | None:
        """How far to the right a car is; `None` where nobody can say."""
        placed = [] if own is None else list(self._known(own, (car,)))
        return placed[0].right_m if placed else None

    def _seen(self, seen: Sequence[VehicleDetection]) -> Iterator[VehicleOnMap]:
        for car in seen:
            ahead_m = car.range_m * math.cos(car.bearing_rad) + self._length_m
            right_m = car.range_m * math.sin(car.bearing_rad)
            yield VehicleOnMap(ahead_m, right_m, None, ObjectSource.SENSOR)

    def _known(
        self, own: PerceivedObject, cars: Sequence[PerceivedObject], in_alarm: Collection[str] = ()
    ) -> Iterator[VehicleOnMap]:
        if math.hypot(own.state[2], own.state[3]) >= MOVES_M_S:
            self._heading_rad = math.atan2(own.state[2], own.state[3])
        if self._heading_rad is None:
            return
        sin, cos = math.sin(self._heading_rad), math.cos(self._heading_rad)
        for car in cars:
            east_m, north_m = car.state[0] - own.state[0], car.state[1] - own.state[1]
            turned_rad = None
            if math.hypot(car.state[2], car.state[3]) >= MOVES_M_S:
                turned_rad = math.atan2(car.state[2], car.state[3]) - self._heading_rad
            yield VehicleOnMap(
                east_m * sin + north_m * cos,
                east_m * cos - north_m * sin,
                turned_rad,
                car.source,
                car.name in in_alarm,
            )
