"""Output of MVS to the applications: every perceived object (the paper's kinematic-info)."""

from dataclasses import dataclass
from enum import StrEnum
from typing import ClassVar

from onboard.tracking.evidence import Provenance


class ObjectSource(StrEnum):
    """How an object is known (ETSI TS 103 324)."""

    HOST = "host"
    """It is the host vehicle."""
    BSM = "bsm"
    """A remote vehicle, by its own BSMs."""
    SENSOR = "sensor"
    """It has no radio; own sensors measure it."""
    SHARED = "shared"
    """It has no radio; footers of others report it."""


@dataclass(frozen=True, slots=True)
class PerceivedObject:
    """One vehicle, predicted to `stamp_s`."""

    kind: ClassVar[str] = "perceived_object"
    stamp_s: float
    name: str
    """Temporary ID of a vehicle with a radio, in hex; the track's number for one without."""
    source: ObjectSource
    state: tuple[float, ...]
    """px, py in m, vx, vy in m/s; east and north in the host vehicle's frame."""
    covariance: tuple[tuple[float, ...], ...]
    """(4, 4), m and m/s."""
    age_s: float
    """Since its last measurement or BSM."""
    provenance: Provenance
    """The measurements in it, each used once; empty for a vehicle with a radio."""
    acceleration_m_s2: float | None = None
    """Along its course, by its BSM."""
    tracked_for_s: float = 0.0
    """Since the first measurement of a vehicle without radio."""
