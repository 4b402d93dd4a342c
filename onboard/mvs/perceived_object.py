"""What the applications read: every known car, and how it is known (the paper's kinematic-info)."""

from dataclasses import dataclass
from enum import StrEnum
from typing import ClassVar

from onboard.tracking.evidence import Provenance


class ObjectSource(StrEnum):
    """How the own car knows a car."""

    HOST = "host"
    """It is the own car."""
    BSM = "bsm"
    """It says itself where it is."""
    SENSOR = "sensor"
    """It has no radio, and the own camera sees it."""
    SHARED = "shared"
    """It has no radio, and others tell of it."""


@dataclass(frozen=True, slots=True)
class PerceivedObject:
    """One car, as it is expected to be at `stamp_s`."""

    kind: ClassVar[str] = "perceived_object"
    stamp_s: float
    name: str
    """Temporary ID of a car with a radio, in hex; the own car's number for one without."""
    source: ObjectSource
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
    tracked_for_s: float = 0.0
    """Since a car without a radio was first measured."""
