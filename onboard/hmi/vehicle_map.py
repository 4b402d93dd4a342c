"""Positions of the vehicles on the driver's map: ahead of and to the right of the host vehicle."""

import math
from collections.abc import Collection, Iterator, Sequence

from onboard.hmi.driver_view import VehicleOnMap
from onboard.observations import VehicleDetection
from onboard.tracking.perceived_object import ObjectSource, PerceivedObject

RANGE_M = 150.0
"""Largest distance on the map."""
MOST_VEHICLES = 24
"""On the map, the nearest ones; more cannot be read at a glance."""
MINIMUM_SPEED_M_S = 1.0
"""Below this speed the direction of a velocity is noise."""


class VehicleMap:
    """Places vehicles around the host vehicle; without its position, only the camera's."""

    def __init__(self, length_m: float) -> None:
        """Start without a position.

        Args:
            length_m: of the host vehicle; other vehicles' lengths are unknown and taken as equal.
        """
        self._length_m = length_m
        self._host: PerceivedObject | None = None
        self._heading_rad: float | None = None

    def receive_host_vehicle(self, host: PerceivedObject | None) -> None:
        """Store the host vehicle, `None` without a position. Stopped, it keeps its heading."""
        self._host = host
        if host is not None and math.hypot(host.state[2], host.state[3]) >= MINIMUM_SPEED_M_S:
            self._heading_rad = math.atan2(host.state[2], host.state[3])

    def vehicles(
        self,
        objects: Sequence[PerceivedObject],
        detections: Sequence[VehicleDetection],
        in_alarm: Collection[str] = (),
    ) -> list[VehicleOnMap]:
        """Return the vehicles on the map, nearest first.

        Args:
            objects: perceived objects in the frame of the host vehicle's position.
            detections: of the camera's last frame; used without a position only, since otherwise
                `objects` include them.
            in_alarm: names of the objects of present alarms.
        """
        placed = (
            self._placed(objects, in_alarm)
            if self._host is not None
            else self._detected(detections)
        )
        near = [each for each in placed if math.hypot(each.ahead_m, each.right_m) <= RANGE_M]
        near.sort(key=lambda each: math.hypot(each.ahead_m, each.right_m))
        return near[:MOST_VEHICLES]

    def right_m(self, each: PerceivedObject) -> float | None:
        """Return how far to the right an object is; `None` without position or heading."""
        return next((placed.right_m for placed in self._placed((each,))), None)

    def _detected(self, detections: Sequence[VehicleDetection]) -> Iterator[VehicleOnMap]:
        for each in detections:
            ahead_m = each.range_m * math.cos(each.bearing_rad) + self._length_m
            right_m = each.range_m * math.sin(each.bearing_rad)
            yield VehicleOnMap(ahead_m, right_m, None, ObjectSource.SENSOR)

    def _placed(
        self, objects: Sequence[PerceivedObject], in_alarm: Collection[str] = ()
    ) -> Iterator[VehicleOnMap]:
        host, heading_rad = self._host, self._heading_rad
        if host is None or heading_rad is None:
            return
        sin, cos = math.sin(heading_rad), math.cos(heading_rad)
        for each in objects:
            east_m, north_m = each.state[0] - host.state[0], each.state[1] - host.state[1]
            relative_heading_rad = None
            if math.hypot(each.state[2], each.state[3]) >= MINIMUM_SPEED_M_S:
                relative_heading_rad = math.atan2(each.state[2], each.state[3]) - heading_rad
            yield VehicleOnMap(
                east_m * sin + north_m * cos,
                east_m * cos - north_m * sin,
                relative_heading_rad,
                each.source,
                each.name in in_alarm,
            )
