"""Entries under names not yet known: by its place each finds its car, or may begin one."""

from collections.abc import Collection, Sequence

import numpy as np

from onboard.mvs.association import compare, with_speed_prior
from onboard.mvs.fusion import UNKNOWN_SPEED_SIGMA_M_S
from onboard.mvs.kinematics import Kinematics
from onboard.mvs.settings import AssociationSettings
from onboard.mvs.shared_entries import EvidenceBatch
from onboard.mvs.track import Track


class UnassociatedEvidence:
    """M entries held at once against N tracks and against the M that they may begin themselves."""

    def __init__(
        self,
        batch: EvidenceBatch,
        tracks: Sequence[Track],
        cars: Kinematics,
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
        self._cars = Kinematics.together([cars, begun])
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
    def cars(self) -> Kinematics:
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
