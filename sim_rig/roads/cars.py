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

    def only(self, which: NDArray[np.intp]) -> "Cars":
        """Some of the cars, by index."""
        return Cars(
            self.at_s,
            tuple(self.names[i] for i in which.tolist()),
            self.middle_m[which],
            self.heading_rad[which],
            self.speed_m_s[which],
            self.acceleration_m_s2[which],
            self.length_m[which],
            self.width_m[which],
        )

    def without(self, name: str) -> "Cars":
        """All but one, whether it is there or not."""
        return self.only(
            np.array([i for i, n in enumerate(self.names) if n != name], dtype=np.intp)
        )

    def joined(self, others: "Cars") -> "Cars":
        """These and others."""
        return Cars(
            self.at_s,
            self.names + others.names,
            np.concatenate([self.middle_m, others.middle_m]),
            np.concatenate([self.heading_rad, others.heading_rad]),
            np.concatenate([self.speed_m_s, others.speed_m_s]),
            np.concatenate([self.acceleration_m_s2, others.acceleration_m_s2]),
            np.concatenate([self.length_m, others.length_m]),
            np.concatenate([self.width_m, others.width_m]),
        )

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
