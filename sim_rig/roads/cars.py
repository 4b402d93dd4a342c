"""State of all cars on the plane, and the interface of its sources."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from sim_rig.roads.road import CarState

Array = NDArray[np.float64]
Guests = Callable[[float], Mapping[str, CarState]]
"""States of cars that a source of traffic does not drive, by time in s; empty before they come."""


def no_guests(_at_s: float) -> Mapping[str, CarState]:
    """Return none."""
    return {}


@dataclass(frozen=True, slots=True, eq=False)
class Cars:
    """N cars at one time. x is east, y is north; headings are counter-clockwise from east."""

    at_s: float
    names: tuple[str, ...]
    """(N,), all different."""
    middle_m: Array
    """(N, 2)"""
    heading_rad: Array
    """(N,), also of standing cars."""
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
        """Index of a car in the arrays; `None` if it is absent."""
        return self.names.index(name) if name in self.names else None

    def only(self, which: NDArray[np.intp]) -> "Cars":
        """Select cars by index."""
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
        """All cars but one, which may be absent."""
        return self.only(
            np.array([i for i, n in enumerate(self.names) if n != name], dtype=np.intp)
        )

    def joined(self, others: "Cars") -> "Cars":
        """These and other cars."""
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
        """Predict the cars by `seconds`, straight on, and never backwards."""
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
    """Source of the cars' motion on the plane."""

    def cars_at(self, at_s: float) -> Cars:
        """All cars present at `at_s`, s since the start; times are in order."""
        ...

    def close(self) -> None:
        """Release what it holds; nothing by default."""
        return
