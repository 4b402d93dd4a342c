"""Measurements and estimates (MEs) of a vehicle without radio, and their provenance.

A measurement is identified by its observer and time. An estimate carries the set of measurements
it was fused from, its *provenance*; two pieces of evidence are independent exactly if their
provenances are disjoint.

Positions are metres east and north in the frame of the vehicle that stores the evidence
(`local_frame.py`); times are whole milliseconds of UTC, the clock that all vehicles share.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from operator import attrgetter
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from onboard.kinematics.arrays import Array, StateArrays, map_state

UNKNOWN_SPEED_SIGMA_M_S = 100.0
"""Speed of a vehicle of which one position is known: no information, with margin."""


MeasurementId = int
"""Observer and time of a measurement in one number, since a tick compares thousands of them: the
temporary ID of the measuring vehicle, as in its BSM, above 48 bits of ms of UTC."""

Provenance = frozenset[MeasurementId]

OBSERVER_BYTES = 4
_STAMP_BITS = 48
_STAMP_MASK = (1 << _STAMP_BITS) - 1


def measurement_id(observer: bytes, stamp_ms: int) -> MeasurementId:
    """Return the number of what an observer (4 bytes) measured at `stamp_ms`."""
    return (int.from_bytes(observer) << _STAMP_BITS) + stamp_ms


def observer_of(identity: MeasurementId) -> bytes:
    """Return the temporary ID of the vehicle that made a measurement."""
    return observer_with_number(identity >> _STAMP_BITS)


def observers_of(provenance: Provenance) -> set[bytes]:
    """Return the temporary IDs of the vehicles that made the measurements."""
    return set(map(observer_with_number, set(observer_numbers_of(provenance))))


def observer_numbers_of(provenance: Provenance) -> list[int]:
    """Return the observer of each measurement as a number, which costs less than the bytes."""
    return [identity >> _STAMP_BITS for identity in provenance]


def observer_with_number(number: int) -> bytes:
    """Return the temporary ID of the observer with a number."""
    return number.to_bytes(OBSERVER_BYTES)


def measured_ms(identity: MeasurementId) -> int:
    """Return the time of a measurement."""
    return identity & _STAMP_MASK


def observers_and_times(provenance: Provenance) -> list[tuple[bytes, int]]:
    """Return the measurements in a provenance, in order."""
    return [
        (observer_with_number(each >> _STAMP_BITS), each & _STAMP_MASK)
        for each in sorted(provenance)
    ]


@dataclass(frozen=True, slots=True, eq=False)
class Measurement:
    """`dm<v, t>` if the host vehicle made it, `im<v, t>` if another vehicle did."""

    id: MeasurementId
    position_m: Array
    """(2) east, north."""
    covariance: Array
    """(2, 2), m^2."""
    provenance: Provenance = field(init=False)
    """The measurement itself."""
    stamp_ms: int = field(init=False)
    """Time of the measurement."""
    oldest_ms: int = field(init=False)
    """The same as `stamp_ms`, as for estimates."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "provenance", frozenset((self.id,)))
        object.__setattr__(self, "stamp_ms", measured_ms(self.id))
        object.__setattr__(self, "oldest_ms", self.stamp_ms)

    def mapped(self, turn: Array, shift: Array) -> Self:
        """Return the measurement in another frame (`LocalFrame.mapping_from`)."""
        return type(self)(self.id, turn @ self.position_m + shift, turn @ self.covariance @ turn.T)


@dataclass(frozen=True, slots=True, eq=False)
class Estimate:
    """`e<v, T>`: position and velocity at the time of the last measurement in T."""

    provenance: Provenance
    """T; never empty."""
    state: Array
    """(4) east, north in m; speed east, north in m/s."""
    covariance: Array
    """(4, 4), m and m/s."""
    stamp_ms: int = 0
    """Last time in T; computed from T if it is 0."""
    oldest_ms: int = 0
    """First time in T; computed with `stamp_ms`."""

    def __post_init__(self) -> None:
        if not self.stamp_ms:
            stamps_ms = [measured_ms(identity) for identity in self.provenance]
            object.__setattr__(self, "stamp_ms", max(stamps_ms))
            object.__setattr__(self, "oldest_ms", min(stamps_ms))

    def mapped(self, turn: Array, shift: Array) -> Self:
        """Return the estimate in another frame (`LocalFrame.mapping_from`)."""
        state, covariance = map_state(self.state, self.covariance, turn, shift)
        return type(self)(self.provenance, state, covariance, self.stamp_ms, self.oldest_ms)

    def with_position_variance(self, added_m2: float) -> Self:
        """Return the estimate with more variance of its position, on either axis."""
        covariance = self.covariance.copy()
        covariance[0, 0] += added_m2
        covariance[1, 1] += added_m2
        return type(self)(self.provenance, self.state, covariance, self.stamp_ms, self.oldest_ms)


Evidence = Measurement | Estimate
"""An ME of the paper."""

stamp_ms_of: Callable[[Any], int] = attrgetter("stamp_ms")
"""Sort key of evidence."""


def as_arrays(evidence: Sequence[Evidence]) -> StateArrays:
    """Return N pieces of evidence as arrays."""
    n = len(evidence)
    states, covariances = np.zeros((n, 4)), np.zeros((n, 4, 4))
    has_speed = np.array([isinstance(piece, Estimate) for piece in evidence], dtype=np.float64)
    if estimates := [piece for piece in evidence if isinstance(piece, Estimate)]:
        estimated = has_speed > 0
        states[estimated] = [piece.state for piece in estimates]
        covariances[estimated] = [piece.covariance for piece in estimates]
    if measurements := [piece for piece in evidence if isinstance(piece, Measurement)]:
        measured = has_speed == 0
        states[measured, :2] = [piece.position_m for piece in measurements]
        covariances[measured, :2, :2] = [piece.covariance for piece in measurements]
    stamps_ms = np.array([piece.stamp_ms for piece in evidence], dtype=np.float64)
    return StateArrays(stamps_ms, states.T, covariances.transpose(1, 2, 0), has_speed)


def as_estimate(piece: Evidence) -> Estimate:
    """Return the whole state by one piece of evidence; a position leaves the speed unknown."""
    if isinstance(piece, Estimate):
        return piece
    state, covariance = np.zeros(4), np.eye(4) * UNKNOWN_SPEED_SIGMA_M_S**2
    state[:2], covariance[:2, :2] = piece.position_m, piece.covariance
    return Estimate(piece.provenance, state, covariance)


def piece_of(
    provenance: Provenance, entries: StateArrays, row: int, *, is_measurement: bool
) -> Evidence:
    """Return the entry `row` as evidence.

    Args:
        provenance: of the entry.
        entries: N entries.
        row: index of the entry.
        is_measurement: whether it is one; its range rate is not part of it, since receivers cannot
            check a speed from one measurement.
    """
    state, covariance = entries.states[:, row].copy(), entries.covariances[:, :, row].copy()
    if not is_measurement:
        return Estimate(provenance, state, covariance)
    (identity,) = provenance
    return Measurement(identity, state[:2], covariance[:2, :2])


@dataclass(frozen=True, slots=True, eq=False)
class ProvenanceSpans:
    """Number and times of the measurements in N provenances."""

    counts: Array
    """(N) measurements in each."""
    oldest_ms: Array
    """(N) time of the first measurement."""
    newest_ms: Array
    """(N) time of the last measurement."""
    spreads_s2: Array
    """(N) sums of the squared differences of the times from their mean."""

    def __getitem__(self, rows: Any) -> Self:
        """Return the provenances that numpy's indexing by `rows` selects."""
        return type(self)(
            self.counts[rows], self.oldest_ms[rows], self.newest_ms[rows], self.spreads_s2[rows]
        )

    @classmethod
    def concatenate(cls, parts: Sequence[Self]) -> Self:
        """Return all of `parts`, one after the other."""
        return cls(
            np.concatenate([each.counts for each in parts]),
            np.concatenate([each.oldest_ms for each in parts]),
            np.concatenate([each.newest_ms for each in parts]),
            np.concatenate([each.spreads_s2 for each in parts]),
        )

    @classmethod
    def of(cls, provenances: Sequence[Provenance]) -> Self:
        """Compute them for N provenances, none of them empty."""
        stamps_ms = [each & _STAMP_MASK for provenance in provenances for each in provenance]
        return cls.of_stamps(
            np.array([len(provenance) for provenance in provenances], np.int64),
            np.array(stamps_ms, np.int64),
        )

    @classmethod
    def of_stamps(cls, counts: NDArray[np.int64], stamps_ms: NDArray[np.int64]) -> Self:
        """Compute them for N provenances by the times of their measurements, one after the other.

        Args:
            counts: (N) measurements in each, at least one.
            stamps_ms: (sum of `counts`).
        """
        if not len(counts):
            return cls(np.zeros(0), np.zeros(0), np.zeros(0), np.zeros(0))
        starts = np.cumsum(counts) - counts
        oldest_ms = np.minimum.reduceat(stamps_ms, starts)
        newest_ms = np.maximum.reduceat(stamps_ms, starts)
        ages_ms = (newest_ms.repeat(counts) - stamps_ms).astype(np.float64)
        squares = np.add.reduceat(ages_ms * ages_ms, starts)
        spreads_s2 = (squares - np.add.reduceat(ages_ms, starts) ** 2 / counts) / 1e6
        return cls(
            counts.astype(np.float64),
            oldest_ms.astype(np.float64),
            newest_ms.astype(np.float64),
            spreads_s2,
        )
