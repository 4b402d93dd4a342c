"""Measurements and estimates (MEs) of a car without a radio, each knowing what it was made from.

A measurement is known by who made it and when. An estimate carries the set of the measurements
that went into it, its *provenance*; so two pieces of evidence are independent exactly if their
provenances have nothing in common.

Positions are metres east and north in the frame of the car that holds the evidence
(`local_frame.py`), times are whole milliseconds of UTC, the clock that all cars share.
"""

from dataclasses import dataclass
from typing import NamedTuple

from onboard.mvs.kalman import Array


class MeasurementId(NamedTuple):
    """Who measured, and when."""

    observer: bytes
    """Temporary ID of the measuring car, as in its BSM."""
    stamp_ms: int
    """UTC."""


@dataclass(frozen=True, slots=True, eq=False)
class Measurement:
    """`dm<v, t>` if the own car made it, `im<v, t>` if it came over the radio."""

    id: MeasurementId
    position_m: Array
    """(2) east, north."""
    covariance: Array
    """(2, 2), m^2."""

    @property
    def stamp_ms(self) -> int:
        """When it was made."""
        return self.id.stamp_ms

    @property
    def provenance(self) -> frozenset[MeasurementId]:
        """Itself."""
        return frozenset((self.id,))


@dataclass(frozen=True, slots=True, eq=False)
class Estimate:
    """`e<v, T>`: position and velocity at the time of the last measurement in T."""

    provenance: frozenset[MeasurementId]
    """T; never empty."""
    state: Array
    """(4) east, north in m; speed east, north in m/s."""
    covariance: Array
    """(4, 4), m and s."""

    @property
    def stamp_ms(self) -> int:
        """t_j, the last of T."""
        return max(stamp_ms for _, stamp_ms in self.provenance)


Evidence = Measurement | Estimate
"""An ME of the paper."""
