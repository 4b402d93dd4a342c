"""Measurements and estimates (MEs) of a car without a radio, each knowing what it was made from.

A measurement is known by who made it and when. An estimate carries the set of the measurements
that went into it, its *provenance*; so two pieces of evidence are independent exactly if their
provenances have nothing in common.

Positions are metres east and north in the frame of the car that holds the evidence
(`local_frame.py`), times are whole milliseconds of UTC, the clock that all cars share.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import lru_cache
from operator import attrgetter
from typing import Any, NamedTuple, Self

import numpy as np

from onboard.mvs.kalman import Array


class MeasurementId(NamedTuple):
    """Who measured, and when."""

    observer: bytes
    """Temporary ID of the measuring car, as in its BSM."""
    stamp_ms: int
    """UTC."""


measurement_id = lru_cache(maxsize=1 << 14)(MeasurementId)
"""The same object every time: a measurement is named in many estimates."""

Provenance = frozenset[MeasurementId]


@dataclass(frozen=True, slots=True, eq=False)
class Measurement:
    """`dm<v, t>` if the own car made it, `im<v, t>` if it came over the radio."""

    id: MeasurementId
    position_m: Array
    """(2) east, north."""
    covariance: Array
    """(2, 2), m^2."""
    provenance: Provenance = field(init=False)
    """Itself."""
    stamp_ms: int = field(init=False)
    """When it was made."""
    oldest_ms: int = field(init=False)
    """The same."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "provenance", frozenset((self.id,)))
        object.__setattr__(self, "stamp_ms", self.id.stamp_ms)
        object.__setattr__(self, "oldest_ms", self.id.stamp_ms)

    def mapped(self, turn: Array, shift: Array) -> Self:
        """The same in another frame (`LocalFrame.mapping_from`)."""
        return type(self)(self.id, turn @ self.position_m + shift, turn @ self.covariance @ turn.T)


@dataclass(frozen=True, slots=True, eq=False)
class Estimate:
    """`e<v, T>`: position and velocity at the time of the last measurement in T."""

    provenance: Provenance
    """T; never empty."""
    state: Array
    """(4) east, north in m; speed east, north in m/s."""
    covariance: Array
    """(4, 4), m and s."""
    stamp_ms: int = 0
    """The last time in T; looked up there if it is not given."""
    oldest_ms: int = 0
    """The first time in T, as well."""

    def __post_init__(self) -> None:
        if not self.stamp_ms:
            stamps_ms = [stamp_ms for _, stamp_ms in self.provenance]
            object.__setattr__(self, "stamp_ms", max(stamps_ms))
            object.__setattr__(self, "oldest_ms", min(stamps_ms))

    def mapped(self, turn: Array, shift: Array) -> Self:
        """The same in another frame (`LocalFrame.mapping_from`)."""
        state, covariance = map_state(self.state, self.covariance, turn, shift)
        return type(self)(self.provenance, state, covariance, self.stamp_ms, self.oldest_ms)


Evidence = Measurement | Estimate
"""An ME of the paper."""

stamp_ms_of: Callable[[Any], int] = attrgetter("stamp_ms")
"""To put evidence in order."""


def map_state(state: Array, covariance: Array, turn: Array, shift: Array) -> tuple[Array, Array]:
    """State (4) and covariance (4, 4) in another frame (`LocalFrame.mapping_from`)."""
    both = turn_of_state(turn)
    mapped = both @ state
    mapped[:2] += shift
    return mapped, both @ covariance @ both.T


def turn_of_state(turn: Array) -> Array:
    """The turn (4, 4) of position and velocity."""
    both = np.zeros((4, 4))
    both[:2, :2] = both[2:, 2:] = turn
    return both
