"""Data association: which piece of evidence belongs to which track.

Among all assignments of evidence to vehicles, at most one piece each and only within gates, the one
of greatest likelihood is taken (least d^2 + ln det S, which keeps an uncertain vehicle from
attracting its neighbours' evidence), after as many pieces as possible are assigned.
"""

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from onboard.kinematics.arrays import Array, StateArrays
from onboard.tracking.assignment import cheapest_pairs
from onboard.tracking.evidence import UNKNOWN_SPEED_SIGMA_M_S
from onboard.tracking.evidence_store import EvidenceBatch
from onboard.tracking.gates import GATE_PROBABILITY, distances, gate, gates, with_speed_prior
from onboard.tracking.track import Track

PRIOR_SPEED_SIGMA_M_S = 20.0
"""Of a vehicle on either axis, where nothing else is known of its speed."""

CERTAIN_M = 0.75
"""Evidence and a track whose positions together are less certain than this (root of the summed
variances) are not associated by position alone: lanes are 3 m apart."""

FARTHEST_INSIDE_M2 = gate(GATE_PROBABILITY, 4) * CERTAIN_M**2
"""Squared distance beyond which no pair is inside the gate and certain: d^2 is at least the squared
distance over the summed variances."""

OVERLAP_M = 1.5
"""Two vehicles cannot have their centres closer than this."""


@dataclass(frozen=True, slots=True, eq=False)
class Comparison:
    """M pieces of evidence compared with N vehicles."""

    inside: NDArray[np.bool_]
    """(M, N) whether the piece may belong to the vehicle."""
    cost: Array
    """(M, N) the higher, the less likely it belongs to the vehicle."""
    squared: Array
    """(M, N) d^2; infinite for pairs that were not compared."""

    def assign(self) -> dict[int, int]:
        """Return the vehicle of each piece that has one."""
        rows = np.flatnonzero(self.inside.any(axis=1))
        if not len(rows):
            return {}
        columns = np.flatnonzero(self.inside.any(axis=0))
        allowed, cost = self.inside[np.ix_(rows, columns)], self.cost[np.ix_(rows, columns)]
        least, most = cost[allowed].min(), cost[allowed].max()
        alone = (most - least + 1) * len(rows)  # more than any other assignment of all pieces
        cost = np.where(allowed, cost - least, 2 * alone)
        is_wide = len(rows) <= len(columns)
        of_few = cost if is_wide else cost.T  # one augmenting path a row
        unassigned = np.full((len(of_few), len(of_few)), alone)
        pairs = [
            (few, many) if is_wide else (many, few)
            for few, many in cheapest_pairs(np.hstack([of_few, unassigned]))
            if many < of_few.shape[1]
        ]
        return {int(rows[row]): int(columns[column]) for row, column in sorted(pairs)}

    def among(self, pieces: slice | None, allowed: NDArray[np.bool_]) -> "Comparison":
        """Return the rows `pieces` (all if `None`), inside gates only where `allowed` too."""
        rows = slice(None) if pieces is None else pieces
        return Comparison(self.inside[rows] & allowed, self.cost[rows], self.squared[rows])

    def narrowed(self, largest: Array) -> "Comparison":
        """Return it with narrower gates: `largest` (M,) is the greatest d^2 inside each."""
        inside = self.inside & (self.squared <= largest[:, None])
        return Comparison(inside, self.cost, self.squared)


def compare(
    evidence: StateArrays,
    vehicles: StateArrays,
    gate_probability: float,
    q: float,
    *,
    max_sigma_m: float = math.inf,
    near: NDArray[np.bool_] | None = None,
) -> Comparison:
    """Compare M pieces of evidence with N vehicles.

    Args:
        evidence: M pieces.
        vehicles: N states.
        gate_probability: share of a vehicle's evidence that its gate lets in.
        q: spectral density of the acceleration noise, m^2/s^3.
        max_sigma_m: pairs whose positions together are less certain than this (root of the summed
            variances) are not inside.
        near: (M, N) pairs that may be inside, all by default; no others are compared.
    """
    if near is None:
        near = np.ones((len(evidence), len(vehicles)), np.bool_)
    rows, columns = np.nonzero(near)
    squared, log_det, variance = np.full(near.shape, np.inf), *np.zeros((2, *near.shape))
    squared[near], log_det[near], variance[near] = distances(evidence[rows], vehicles[columns], q)
    inside = squared <= gates(evidence[:, None], gate_probability)
    inside &= variance <= max_sigma_m**2
    return Comparison(inside, squared + log_det, squared)


class UnassociatedEvidence:
    """M entries under new labels, compared with N tracks and with the M that they may start."""

    def __init__(
        self,
        batch: EvidenceBatch,
        tracks: Sequence[Track],
        vehicles: StateArrays,
        q: float,
    ) -> None:
        """Compare all with all.

        Args:
            batch: M entries.
            tracks: the N existing tracks.
            vehicles: their N states with a speed prior.
            q: spectral density of the acceleration noise, m^2/s^3.
        """
        entries, self._provenances = batch.entries, batch.provenances
        started = entries.with_unknown_speed(UNKNOWN_SPEED_SIGMA_M_S)
        started = with_speed_prior(started, PRIOR_SPEED_SIGMA_M_S)
        self._vehicles = StateArrays.concatenate([vehicles, started])
        self._tracks: list[Track | None] = [*tracks, *[None] * len(batch)]
        self._exists = np.arange(len(self._vehicles)) < len(tracks)
        dt_s = (entries.stamps_ms[:, None] - self._vehicles.stamps_ms) / 1000
        positions = self._vehicles.states[:2, None] + dt_s * self._vehicles.states[2:, None]
        east, north = entries.states[:2, :, None] - positions
        apart_m2 = east * east + north * north
        self._overlapping = apart_m2 <= OVERLAP_M**2
        self._comparison = compare(
            entries,
            self._vehicles,
            GATE_PROBABILITY,
            q,
            max_sigma_m=CERTAIN_M,
            near=apart_m2 <= FARTHEST_INSIDE_M2,
        )
        self._may_match = (self._comparison.inside | self._overlapping).any(axis=1)

    @property
    def vehicles(self) -> StateArrays:
        """The states that evidence is compared with, one for each existing track."""
        return self._vehicles[self._exists]

    def start_track(self, at: int, track: Track) -> None:
        """Note that the entry `at` has started a track."""
        column = at - len(self._provenances)
        self._tracks[column], self._exists[column] = track, True

    def associate(self, entries: range, excluded: Collection[int]) -> dict[int, Track]:
        """Find the tracks of the entries of one report, in which no two are of one vehicle.

        Args:
            entries: which of the M.
            excluded: indices of the tracks that other entries of the report belong to.

        Returns:
            the track of each entry that has one.
        """
        rows = slice(entries.start, entries.stop)
        if not self._may_match[rows].any():
            return {}
        free = self._exists.copy()
        free[list(excluded)] = False
        column_of = self._comparison.among(rows, free).assign()
        free[list(column_of.values())] = False
        # Evidence that shares a measurement with a track has much the same errors, so it belongs to
        # the track if it overlaps it, however uncertain both are: an observer measures several
        # vehicles at a time, but not two in one place.
        for row, column in np.argwhere(self._overlapping[rows] & free).tolist():
            if row in column_of or not free[column]:
                continue
            track = self._tracks[column]
            assert track is not None  # noqa: S101 (only existing tracks are free)
            if track.shares_measurement(self._provenances[entries[row]]):
                column_of[row], free[column] = column, False
        found = {entries[row]: self._tracks[column] for row, column in column_of.items()}
        return {at: track for at, track in found.items() if track is not None}
