"""All cars on the plane at one moment, and what every source of movement tells."""

from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Cars:
    """N cars at one moment. x is east, y is north; headings turn counter-clockwise from east."""

    at_s: float
    names: tuple[str, ...]
    """(N), each once."""
    middle_m: Array
    """(N, 2)"""
    heading_rad: Array
    """(N); where the bonnet points, also of a car that stands."""
    speed_m_s: Array
    """(N), along the heading; never negative."""
    acceleration_m_s2: Array
    """(N), along the heading."""
    length_m: Array
    """(N)"""
    width_m: Array
    """(N)"""

    def __len__(self) -> int:
        return len(self.names)

    @property
    def ahead(self) -> Array:
        """(N, 2) unit vectors along the headings."""
        return np.stack([np.cos(self.heading_rad), np.sin(self.heading_rad)], axis=1)

    @property
    def velocity_m_s(self) -> Array:
        """(N, 2), east and north."""
        velocity: Array = self.speed_m_s[:, None] * self.ahead
        return velocity

    def index(self, name: str) -> int | None:
        """Where a car stands in the arrays; `None` if it is not there."""
        return self.names.index(name) if name in self.names else None

    def moved_on(self, seconds: float) -> "Cars":
        """The same cars a moment later: straight on, and never backwards."""
        if seconds == 0.0:
            return self
        speed = np.maximum(self.speed_m_s + self.acceleration_m_s2 * seconds, 0.0)
        way_m = (self.speed_m_s + speed) / 2.0 * seconds
        return replace(
            self,
            at_s=self.at_s + seconds,
            middle_m=self.middle_m + way_m[:, None] * self.ahead,
            speed_m_s=speed,
        )


class Traffic(Protocol):
    """A source of movement on the plane."""

    def cars_at(self, at_s: float) -> Cars:
        """Every car that is there `at_s` seconds after the beginning; times never go back."""
        ...
