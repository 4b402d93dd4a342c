"""Output of MVS to the applications: every perceived object (the paper's kinematic-info)."""

import math
from collections.abc import Iterable
from dataclasses import dataclass, field
from enum import StrEnum
from typing import ClassVar

from onboard.tracking.evidence import Provenance, observers_and_times


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
    provenance: Provenance = field(metadata={"traced_as": observers_and_times})
    """The measurements in it, each used once; empty for a vehicle with a radio."""
    acceleration_m_s2: float | None = None
    """Along its course, by its BSM."""
    tracked_for_s: float = 0.0
    """Since the first measurement of a vehicle without radio."""
    is_sensed: bool = False
    """Whether own sensors measure it, beside its BSMs or what others share."""
    reporters: frozenset[bytes] = field(default=frozenset(), metadata={"traced": False})
    """Temporary IDs of the vehicles whose footers report a vehicle without radio."""


def remote_offsets_m(
    host: PerceivedObject, perceived: Iterable[PerceivedObject], heading_rad: float
) -> dict[bytes, tuple[float, float, float]]:
    """Return where remote vehicles are relative to the host vehicle.

    Args:
        host: the host vehicle.
        perceived: objects at the same time and in the same frame; only those with BSMs count.
        heading_rad: of the host vehicle, clockwise from north.

    Returns:
        By temporary ID: metres ahead and to the right, and the mean sigma of either.
    """
    sin, cos = math.sin(heading_rad), math.cos(heading_rad)
    offsets_m = {}
    for each in perceived:
        if each.source is not ObjectSource.BSM:
            continue
        east_m, north_m = each.state[0] - host.state[0], each.state[1] - host.state[1]
        of_both = (each.covariance, host.covariance)
        variance = sum(covariance[axis][axis] for covariance in of_both for axis in (0, 1))
        offsets_m[bytes.fromhex(each.name)] = (
            east_m * sin + north_m * cos,
            east_m * cos - north_m * sin,
            math.sqrt(variance / 2.0),
        )
    return offsets_m
