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
    """One car at one moment, in the frame of the road."""

    front_m: float
    """Front bumper, along the road."""
    lateral_m: float
    """Middle of the car, across the road, growing to the left; lane 1 is centred at 0."""
    speed_m_s: float
    acceleration_m_s2: float
    length_m: float
    width_m: float
    height_m: float

    @property
    def rear_m(self) -> float:
        """Rear bumper, along the road."""
        return self.front_m - self.length_m

    def distance_m(self, other: "CarState") -> float:
        """Between the middles of the two cars, as a radio sees it."""
        along_m = self.front_m - self.length_m / 2 - (other.front_m - other.length_m / 2)
        return math.hypot(along_m, self.lateral_m - other.lateral_m)


class Road(Protocol):
    """A source of movement. Times are seconds since the scenario began, and never go back."""

    def cars_at(self, at_s: float) -> Mapping[str, CarState]:
        """Every car on the road at `at_s`, by name."""
        ...

    def car_at(self, car: str, at_s: float) -> CarState:
        """One of them."""
        ...
