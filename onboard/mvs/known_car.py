"""What the applications read: every known car, and how it is known (the paper's kinematic-info)."""

from dataclasses import dataclass
from enum import StrEnum
from typing import ClassVar

from onboard.mvs.evidence import Provenance


class KnownBy(StrEnum):
    """How the own car knows a car."""

    ITSELF = "itself"
    """It is the own car."""
    RADIO = "radio"
    """It says itself where it is."""
    SEEN = "seen"
    """It has no radio, and the own camera sees it."""
    TOLD = "told"
    """It has no radio, and others tell of it."""


@dataclass(frozen=True, slots=True)
class KnownCar:
    """One car, as it is expected to be at `stamp_s`."""

    kind: ClassVar[str] = "known_car"
    stamp_s: float
    name: str
    """Temporary ID of a car with a radio, in hex; the own car's number for one without."""
    known_by: KnownBy
    state: tuple[float, ...]
    """px, py in m, vx, vy in m/s; east and north in the own car's frame."""
    covariance: tuple[tuple[float, ...], ...]
    """(4, 4), m and s."""
    age_s: float
    """Since it was last measured, or last spoke."""
    provenance: Provenance
    """The measurements in it, each used once; none for a car with a radio."""
    acceleration_m_s2: float | None = None
    """Along its course, if it says so itself."""
    known_for_s: float = 0.0
    """Since a car without a radio was first measured."""
