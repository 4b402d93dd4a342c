"""All cars without a radio: whose evidence is whose, who is new, who is gone, who was someone else.

A car is what its evidence says, and nothing besides. Evidence grows old and is dropped, and with
the last of it the car is forgotten.
"""

from collections.abc import Iterator, Sequence

import numpy as np

from onboard.mvs.association import Kinematics, assign, with_speed_prior
from onboard.mvs.evidence import Estimate, Evidence, MeasurementId
from onboard.mvs.fusion import fuse
from onboard.mvs.kalman import Array
from onboard.mvs.settings import MvsSettings
from onboard.mvs.track import Held, Track

_RADIO_REMEMBERED_MS = 500
"""So long a car stays recognised as one with a radio after it last matched."""


class Tracks:
    """Holds the tracks; times are ms of UTC."""

    def __init__(self, settings: MvsSettings) -> None:
        self._settings = settings
        self._tracks: list[Track] = []
        self._last_number = 0
        self._compared: Kinematics | None = None
        """What new evidence is compared with; `None` if a track has changed since."""

    def __iter__(self) -> Iterator[Track]:
        return iter(self._tracks)

    def __len__(self) -> int:
        return len(self._tracks)

    def receive(
        self, pieces: Sequence[Evidence], teller: bytes, now_ms: int, *, is_own: bool = False
    ) -> int:
        """Give each piece to the car that it belongs to, or let it be a new car.

        No two estimates in `pieces` are of the same car, and no two measurements of the same
        observer and moment; these are assigned together.

        Returns:
            how many would have been one new car too many.
        """
        together: dict[MeasurementId | None, list[Held]] = {}
        for piece in pieces:
            key = None if isinstance(piece, Estimate) else piece.id
            together.setdefault(key, []).append(Held(piece, teller, now_ms))
        return sum(self._assign(group, is_own) for group in together.values())

    def refresh(self, now_ms: int) -> None:
        """Forget what is old, choose the evidence of each car anew, and fuse it."""
        settings, belief = self._settings, self._settings.belief
        memory_ms, unseen_ms = round(settings.memory_s * 1000), round(settings.unseen_s * 1000)
        settled_ms = round(settings.settled_s * 1000)
        for track in self._tracks:
            track.forget(now_ms - memory_ms, belief.estimates_per_car, belief.evidence_per_car)
        self._tracks = [
            track for track in self._tracks if now_ms - track.last_measured_ms <= unseen_ms
        ]
        for track in self._tracks:
            track.choose()
            track.settle(now_ms - settled_ms)
        estimates = fuse([track.used for track in self._tracks], settings.acceleration_density)
        for track, estimate in zip(self._tracks, estimates, strict=True):
            track.estimate = estimate
            track.is_confirmed |= track.moments() >= settings.confirmed_by
        self._compared = None
        self._join_doubles(now_ms)

    def recognise(self, ids: Sequence[bytes], reported: Kinematics, now_ms: int) -> None:
        """Find the tracks that are cars with a radio, or the own car.

        Args:
            ids: of those cars.
            reported: what they say of themselves.
            now_ms: UTC.
        """
        settings = self._settings.association
        offset = np.zeros((4, 4, 1))
        offset[:2, :2, 0] = settings.radio_offset_sigma_m**2 * np.eye(2)
        cars = Kinematics(
            reported.stamps_ms, reported.states, reported.covariances + offset, reported.has_speed
        )
        probability = settings.recognition_probability
        found = {car: row for row, car in self._found(cars, probability).items()}
        apart = _apart_m(reported.positions_m(now_ms), self._comparison().positions_m(now_ms))
        for at, track in enumerate(self._tracks):
            row = found.get(at)
            if row is None and len(ids) and apart[:, at].min() <= settings.overlap_m:
                row = int(apart[:, at].argmin())
            if row is not None:
                track.radio_id, track.radio_until_ms = ids[row], now_ms + _RADIO_REMEMBERED_MS
            elif now_ms > track.radio_until_ms:
                track.radio_id = None

    def map_to(self, turn: Array, shift: Array) -> None:
        """Bring everything into another frame (`LocalFrame.mapping_from`)."""
        for track in self._tracks:
            track.map_to(turn, shift)
        self._compared = None

    def _assign(self, group: Sequence[Held], is_own: bool) -> int:
        pieces = Kinematics.of([held.piece for held in group])
        found = self._found(pieces, self._settings.association.gate_probability)
        refused = 0
        for row, held in enumerate(group):
            if row in found:
                self._tracks[found[row]].add(held)
            elif self._has_room(held.teller, is_own):
                self._last_number += 1
                q = self._settings.acceleration_density
                self._tracks.append(Track(self._last_number, held, q))
                self._compared = None
            else:
                refused += 1
        return refused

    def _has_room(self, teller: bytes, is_own: bool) -> bool:
        """What others tell of leaves room for what the own camera sees."""
        belief = self._settings.belief
        if is_own:
            return len(self._tracks) < belief.cars
        first_told = sum(track.first_teller == teller for track in self._tracks)
        return (
            len(self._tracks) < belief.cars - belief.cars_per_sender
            and first_told < belief.cars_per_sender
        )

    def _found(self, pieces: Kinematics, gate_probability: float) -> dict[int, int]:
        q = self._settings.acceleration_density
        return assign(pieces, self._comparison(), gate_probability, q)

    def _comparison(self) -> Kinematics:
        if self._compared is None:
            cars = Kinematics.of([track.estimate for track in self._tracks])
            sigma_m_s = self._settings.association.speed_sigma_m_s
            covariances = with_speed_prior(cars.covariances, sigma_m_s)
            self._compared = Kinematics(cars.stamps_ms, cars.states, covariances, cars.has_speed)
        return self._compared

    def _join_doubles(self, now_ms: int) -> None:
        """Join tracks that stand in each other's place, unless they were seen side by side."""
        overlap_m = self._settings.association.overlap_m
        cars = self._comparison()
        places = cars.positions_m(now_ms)
        variances = cars.covariances[0, 0] + cars.covariances[1, 1]
        near = np.triu(_apart_m(places, places) < overlap_m, k=1)
        near &= variances[:, None] + variances < 2 * overlap_m**2
        gone = set()
        for first, second in np.argwhere(near).tolist():
            one, other = self._tracks[first], self._tracks[second]
            if first not in gone and second not in gone and not one.was_seen_beside(other):
                one.take_over(other)
                gone.add(second)
        if gone:
            self._tracks = [track for at, track in enumerate(self._tracks) if at not in gone]
            self._compared = None


def _apart_m(some: Array, others: Array) -> Array:
    """Distances (M, N) between places (2, M) and (2, N)."""
    apart: Array = np.hypot(*(some[:, :, None] - others[:, None, :]))
    return apart
