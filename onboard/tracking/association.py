"""Entries under names not yet known: by its place each finds its car, or may begin one."""

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from onboard.kinematics.arrays import Array, StateArrays
from onboard.mvs.settings import AssociationSettings
from onboard.tracking.assignment import cheapest_pairs
from onboard.tracking.evidence import UNKNOWN_SPEED_SIGMA_M_S
from onboard.tracking.evidence_store import EvidenceBatch
from onboard.tracking.gates import distances, gates, with_speed_prior
from onboard.tracking.track import Track


@dataclass(frozen=True, slots=True, eq=False)
class Compared:
    """M pieces held against N cars."""

    inside: NDArray[np.bool_]
    """(M, N) whether the piece may be the car's."""
    cost: Array
    """(M, N) the higher, the less likely it is the car's."""

    def assign(self) -> dict[int, int]:
        """Find the car of each piece that has one."""
        rows = np.flatnonzero(self.inside.any(axis=1))
        if not len(rows):
            return {}
        columns = np.flatnonzero(self.inside.any(axis=0))
        allowed, cost = self.inside[np.ix_(rows, columns)], self.cost[np.ix_(rows, columns)]
        least, most = cost[allowed].min(), cost[allowed].max()
        alone = (most - least + 1) * len(rows)  # dearer than any other assignment of all pieces
        cost = np.where(allowed, cost - least, 2 * alone)
        is_wide = len(rows) <= len(columns)
        of_few = cost if is_wide else cost.T  # one augmenting path a row
        to_nobody = np.full((len(of_few), len(of_few)), alone)
        pairs = [
            (few, many) if is_wide else (many, few)
            for few, many in cheapest_pairs(np.hstack([of_few, to_nobody]))
            if many < of_few.shape[1]
        ]
        return {int(rows[row]): int(columns[column]) for row, column in sorted(pairs)}

    def among(self, pieces: slice, cars: NDArray[np.bool_]) -> "Compared":
        """Some of the pieces, which may be the cars' that are `True` in `cars` (N)."""
        return Compared(self.inside[pieces] & cars, self.cost[pieces])


def compare(
    pieces: StateArrays,
    cars: StateArrays,
    gate_probability: float,
    acceleration_density: float,
    *,
    vaguest_m: float = math.inf,
) -> Compared:
    """Hold M pieces against N cars.

    Args:
        pieces: M.
        cars: N.
        gate_probability: of the evidence of a car, how much its gate lets in.
        acceleration_density: q of the process noise, m^2/s^3.
        vaguest_m: a piece and a car whose places are together less certain than this (root of the
            summed variances) are not matched.
    """
    squared, log_det, variance = distances(pieces[:, None], cars, acceleration_density)
    inside = squared <= gates(pieces[:, None], gate_probability)
    inside &= variance <= vaguest_m**2
    return Compared(inside, squared + log_det)


class UnassociatedEvidence:
    """M entries held at once against N tracks and against the M that they may begin themselves."""

    def __init__(
        self,
        batch: EvidenceBatch,
        tracks: Sequence[Track],
        cars: StateArrays,
        settings: AssociationSettings,
        acceleration_density: float,
    ) -> None:
        """Compare all with all.

        Args:
            batch: the entries.
            tracks: those that are there.
            cars: what evidence of them is compared with.
            settings: gates and distances.
            acceleration_density: q of the process noise, m^2/s^3.
        """
        entries, self._provenances = batch.entries, batch.provenances
        begun = entries.with_any_speed(UNKNOWN_SPEED_SIGMA_M_S)
        begun = with_speed_prior(begun, settings.speed_sigma_m_s)
        self._cars = StateArrays.together([cars, begun])
        self._tracks: list[Track | None] = [*tracks, *[None] * len(batch)]
        self._there = np.arange(len(self._cars)) < len(tracks)
        self._compared = compare(
            entries,
            self._cars,
            settings.gate_probability,
            acceleration_density,
            vaguest_m=settings.certain_m,
        )
        dt_s = (entries.stamps_ms[:, None] - self._cars.stamps_ms) / 1000
        places = self._cars.states[:2, None] + dt_s * self._cars.states[2:, None]
        apart_m = np.hypot(*(entries.states[:2, :, None] - places))
        self._touching = apart_m <= settings.overlap_m

    @property
    def cars(self) -> StateArrays:
        """What evidence is compared with, a column for each track that is there."""
        return self._cars[self._there]

    def begin(self, at: int, track: Track) -> None:
        """Let the entry `at` begin a track."""
        place = at - len(self._provenances)
        self._tracks[place], self._there[place] = track, True

    def tracks_of(self, entries: range, barred: Collection[int]) -> dict[int, Track]:
        """Find the tracks of entries that one teller tells of at once.

        Args:
            entries: which.
            barred: places of tracks that he tells of by their names.

        Returns:
            the track of each entry that has one.
        """
        some = slice(entries.start, entries.stop)
        free = self._there.copy()
        free[list(barred)] = False
        place_of = self._compared.among(some, free).assign()
        free[list(place_of.values())] = False
        # Of two entries that share a measurement the errors are much the same, so they may be vague
        # and are yet known to be of one car if they are in one place. An observer measures several
        # cars at a moment, but not two in one place.
        for row, place in np.argwhere(self._touching[some] & free).tolist():
            if row in place_of or not free[place]:
                continue
            track = self._tracks[place]
            assert track is not None  # noqa: S101 (only what is there is free)
            if track.shares(self._provenances[entries[row]]):
                place_of[row], free[place] = place, False
        found = {entries[row]: self._tracks[place] for row, place in place_of.items()}
        return {at: track for at, track in found.items() if track is not None}
