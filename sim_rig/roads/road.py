"""What every source of movement tells the rig: where each car is at a moment.

The scenario's own breakpoints (`breakpoints.py`) are one source; a car-following model or a
recorded trace is another. Nothing in the rig knows which of them it is driving.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol


@dataclass(frozen=True, slots=True)
class CarState:
    """One car at one moment."""

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
        """Between the middles of the two cars, as a radio sees it."""
        return math.hypot(self.x_m - other.x_m, self.y_m - other.y_m)

    def point(self, ahead_m: float, right_m: float) -> tuple[float, float]:
        """East and north of a point that lies so far ahead and to the right of the car's middle."""
        sine, cosine = math.sin(self.heading_rad), math.cos(self.heading_rad)
        return (
            self.x_m + ahead_m * sine + right_m * cosine,
            self.y_m + ahead_m * cosine - right_m * sine,
        )

    def seen_from_front(self, x_m: float, y_m: float) -> tuple[float, float]:
        """How far ahead of the front bumper, and to the right of its middle, a point lies."""
        sine, cosine = math.sin(self.heading_rad), math.cos(self.heading_rad)
        east_m, north_m = x_m - self.x_m, y_m - self.y_m
        return (
            east_m * sine + north_m * cosine - self.length_m / 2,
            east_m * cosine - north_m * sine,
        )


class Road(Protocol):
    """A source of movement. Times are seconds since the scenario began, and never go back."""

    def cars_at(self, at_s: float) -> Mapping[str, CarState]:
        """Every car on the road at `at_s`, by name."""
        ...

    def car_at(self, car: str, at_s: float) -> CarState:
        """One of them."""
        ...
