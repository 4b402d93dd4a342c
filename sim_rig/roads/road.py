"""State of a car on a scenario's roads, and the interface of its sources.

The breakpoints of a scenario (`breakpoints.py`) are one source.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol


@dataclass(frozen=True, slots=True)
class CarState:
    """State of one car at one time."""

    x_m: float
    """East of the scenario's origin; the middle of the car."""
    y_m: float
    """North of it."""
    heading_rad: float
    """Clockwise from north."""
    elevation_m: float
    """Of the road under it."""
    front_m: float
    """Front bumper, along its road."""
    speed_m_s: float
    acceleration_m_s2: float
    length_m: float
    width_m: float
    height_m: float

    def distance_m(self, other: "CarState") -> float:
        """Distance between the middles of two cars, m."""
        return math.hypot(self.x_m - other.x_m, self.y_m - other.y_m)

    def point(self, ahead_m: float, right_m: float) -> tuple[float, float]:
        """East and north of a point given ahead and to the right of the car's middle, m."""
        sine, cosine = math.sin(self.heading_rad), math.cos(self.heading_rad)
        return (
            self.x_m + ahead_m * sine + right_m * cosine,
            self.y_m + ahead_m * cosine - right_m * sine,
        )

    def seen_from_front(self, x_m: float, y_m: float) -> tuple[float, float]:
        """Position of a point ahead and to the right of the middle of the front bumper, m."""
        sine, cosine = math.sin(self.heading_rad), math.cos(self.heading_rad)
        east_m, north_m = x_m - self.x_m, y_m - self.y_m
        return (
            east_m * sine + north_m * cosine - self.length_m / 2,
            east_m * cosine - north_m * sine,
        )


class Road(Protocol):
    """Source of the cars' states. Times are s since the start of the scenario, in order."""

    def cars_at(self, at_s: float) -> Mapping[str, CarState]:
        """States of all cars at `at_s`, by name."""
        ...

    def car_at(self, car: str, at_s: float) -> CarState:
        """State of one car at `at_s`."""
        ...

    def lane_ahead(
        self, car: str, at_s: float, ahead_m: Sequence[float]
    ) -> Sequence[tuple[float, float]]:
        """Points of the middle of a car's lane, ahead of its front; none for recorded cars."""
        ...


_TURN_S = 0.1


def yaw_rate_rad_s(road: Road, car: str, at_s: float) -> float:
    """How fast a car turns, positive to the left (ISO 8855)."""
    before, after = (road.car_at(car, max(at_s + by_s, 0.0)) for by_s in (-_TURN_S, _TURN_S))
    turned_rad = math.remainder(before.heading_rad - after.heading_rad, math.tau)
    return turned_rad / (2.0 * _TURN_S)
