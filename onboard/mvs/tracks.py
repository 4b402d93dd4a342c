"""All cars without a radio: whose evidence is whose, who is new, who is gone, who was someone else.

A car is what its evidence says, and nothing besides. Evidence grows old and is dropped, and with
the last of it the car is forgotten.

Whoever tells of a car, the own camera included, calls it the same every time. So what has been
found to be one car goes on by its name, as long as it fits there. A name that is new is assigned by
its place only where that leaves no doubt; otherwise it begins a track of its own, which joins
another when both are known well enough to say that they are one.
"""

from collections.abc import Iterator, Sequence
from itertools import groupby

import numpy as np

from onboard.mvs.association import are_inside, assign, distances, gates, with_speed_prior
from onboard.mvs.fusion import fuse
from onboard.mvs.kalman import Array
from onboard.mvs.kinematics import Kinematics
from onboard.mvs.settings import MvsSettings
from onboard.mvs.told import Batch
from onboard.mvs.track import OWN, Held, Name, Track

_RADIO_REMEMBERED_MS = 500
"""So long a car stays recognised as one with a radio after it last matched."""


_NEAR_M = 4.0
"""Tracks farther from each other than this are told of as two cars, however vague they are."""


class Tracks:
    """Holds the tracks; times are ms of UTC."""

    def __init__(self, settings: MvsSettings) -> None:
        self._settings = settings
        self._tracks: list[Track] = []
        self._named: dict[Name, Track] = {}
        self._last_number = 0
        self._compared: Kinematics | None = None
        """What evidence is compared with, a column for each track; `None` before it is needed."""

    def __iter__(self) -> Iterator[Track]:
        return iter(self._tracks)

    def __len__(self) -> int:
        return len(self._tracks)

    def receive(self, batch: Batch) -> list[int]:
        """Give each entry to the car that it belongs to, or let it be a new car.

        Returns:
            the rows that would have been one new car too many.
        """
        names = list(zip(batch.tellers, batch.cars, strict=True))
        place_of = {track.number: at for at, track in enumerate(self._tracks)}
        rows = [row for row, name in enumerate(names) if name in self._named]
        places = [place_of[self._named[names[row]].number] for row in rows]
        strangers = set(range(len(batch))) - set(rows)
        barred: dict[tuple[bytes, int], set[int]] = {}
        if rows:
            association, q = self._settings.association, self._settings.acceleration_density
            fitting = are_inside(
                batch.entries[rows],
                self._comparison()[places],
                association.gate_probability,
                q,
            )
            for row, place, fits in zip(rows, places, fitting.tolist(), strict=True):
                if fits:
                    self._add(self._tracks[place], batch, row)
                    said = batch.tellers[row], batch.received_ms[row]
                    barred.setdefault(said, set()).add(place)
                else:
                    self._unname(names[row])
                    strangers.add(row)
        refused: list[int] = []
        at_once = groupby(
            sorted(strangers), key=lambda row: (batch.tellers[row], batch.received_ms[row])
        )
        for said, group in at_once:
            refused += self._assign(batch, list(group), frozenset(barred.get(said, ())))
        return refused

    def refresh(self, now_ms: int) -> None:
        """Forget what is old, choose the evidence of each car anew, and fuse it."""
        settings, belief = self._settings, self._settings.belief
        memory_ms, unseen_ms = round(settings.memory_s * 1000), round(settings.unseen_s * 1000)
        settled_ms = round(settings.settled_s * 1000)
        self._tracks = [track for track in self._tracks if now_ms - track.last_ms <= unseen_ms]
        for track in self._tracks:
            track.forget(now_ms - memory_ms, belief.estimates_per_car, belief.evidence_per_car)
        # An estimate goes by its oldest measurement, so a car may lose all before it is unseen.
        self._tracks = [track for track in self._tracks if track.pieces]
        for track in self._tracks:
            track.choose()
            track.settle(now_ms - settled_ms)
        estimates = fuse([track.used for track in self._tracks], settings.acceleration_density)
        for track, estimate in zip(self._tracks, estimates, strict=True):
            track.estimate = estimate
            track.is_confirmed = track.is_confirmed or track.moments() >= settings.confirmed_by
        self._compared = None
        self._tell_apart(now_ms)
        self._named = {name: track for track in self._tracks for name in track.names}

    def recognise(self, ids: Sequence[bytes], reported: Kinematics, now_ms: int) -> None:
        """Find the tracks that are cars with a radio, or the own car.

        Args:
            ids: of those cars.
            reported: what they say of themselves.
            now_ms: UTC.
        """
        settings, q = self._settings.association, self._settings.acceleration_density
        offset = np.zeros((4, 4, 1))
        offset[:2, :2, 0] = settings.radio_offset_sigma_m**2 * np.eye(2)
        cars = Kinematics(
            reported.stamps_ms, reported.states, reported.covariances + offset, reported.has_speed
        )
        found = assign(cars, self._comparison(), settings.recognition_probability, q)
        radio_of = {track: row for row, track in found.items()}
        apart = _apart_m(reported.places_m(now_ms), self._comparison().places_m(now_ms))
        for at, track in enumerate(self._tracks):
            row = radio_of.get(at)
            if row is None and len(ids) and apart[:, at].min() <= settings.overlap_m:
                row = int(apart[:, at].argmin())
            if row is not None:
                track.radio_id, track.radio_until_ms = ids[row], now_ms + _RADIO_REMEMBERED_MS
            elif now_ms > track.radio_until_ms:
                track.radio_id = None

    def clear(self) -> None:
        """Forget all cars, but give none of their numbers to another."""
        self._tracks.clear()
        self._named.clear()
        self._compared = None

    def map_to(self, turn: Array, shift: Array) -> None:
        """Bring everything into another frame (`LocalFrame.mapping_from`)."""
        for track in self._tracks:
            track.map_to(turn, shift)
        self._compared = None

    def _add(self, track: Track, batch: Batch, row: int) -> None:
        teller = batch.tellers[row]
        track.names[teller, batch.cars[row]] = batch.received_ms[row]
        if batch.entries.has_speed[row] == 0 or not track.has(batch.provenances[row]):
            track.add(Held(batch.piece(row), teller, batch.received_ms[row]))

    def _unname(self, name: Name) -> None:
        track = self._named.pop(name, None)
        if track is not None:
            track.names.pop(name, None)

    def _assign(self, batch: Batch, rows: list[int], barred: frozenset[int]) -> list[int]:
        """Find the cars of entries that one teller tells of at once, under names not yet known."""
        association, q = self._settings.association, self._settings.acceleration_density
        entries = batch.entries[rows]
        found = assign(
            entries,
            self._comparison(),
            association.gate_probability,
            q,
            vaguest_m=association.certain_m,
            barred=barred,
        )
        found = self._sharing(batch, rows, barred, found) | found
        refused, begun = [], []
        for at, row in enumerate(rows):
            name = batch.tellers[row], batch.cars[row]
            if at in found:
                track = self._tracks[found[at]]
                self._add(track, batch, row)
            elif self._has_room(batch.tellers[row]):
                self._last_number += 1
                held = Held(batch.piece(row), batch.tellers[row], batch.received_ms[row])
                track = Track(self._last_number, held)
                track.names[name] = held.received_ms
                self._tracks.append(track)
                begun.append(track)
            else:
                refused.append(row)
                continue
            self._named[name] = track
        if begun:
            self._compared = Kinematics.together([self._comparison(), self._as_compared(begun)])
        return refused

    def _sharing(
        self, batch: Batch, rows: list[int], barred: frozenset[int], found: dict[int, int]
    ) -> dict[int, int]:
        """Find cars by a measurement that has been told of them already.

        Of two entries that share a measurement the errors are much the same, so they may be vague
        and are yet known to be of one car if they are in one place. An observer measures several
        cars at a moment, but not two in one place.
        """
        cars, taken = self._comparison(), barred | set(found.values())
        if not len(cars):
            return {}
        entries = batch.entries[rows]
        dt_s = (entries.stamps_ms[:, None] - cars.stamps_ms) / 1000
        places = cars.states[:2, None] + dt_s * cars.states[2:, None]
        apart = np.hypot(*(entries.states[:2, :, None] - places))
        sharing: dict[int, int] = {}
        for at, place in np.argwhere(apart <= self._settings.association.overlap_m).tolist():
            if at in found or at in sharing or place in taken:
                continue
            if self._tracks[place].shares(batch.provenances[rows[at]]):
                sharing[at] = place
                taken |= {place}
        return sharing

    def _has_room(self, teller: bytes) -> bool:
        """What others tell of leaves room for what the own camera sees."""
        belief = self._settings.belief
        if teller == OWN:
            return len(self._tracks) < belief.cars
        first_told = sum(track.first_teller == teller for track in self._tracks)
        return (
            len(self._tracks) < belief.cars - belief.cars_per_sender
            and first_told < belief.cars_per_sender
        )

    def _comparison(self) -> Kinematics:
        if self._compared is None:
            self._compared = self._as_compared(self._tracks)
        return self._compared

    def _as_compared(self, tracks: Sequence[Track]) -> Kinematics:
        cars = Kinematics.of([track.estimate for track in tracks])
        covariances = with_speed_prior(cars.covariances, self._settings.association.speed_sigma_m_s)
        return Kinematics(cars.stamps_ms, cars.states, covariances, cars.has_speed)

    def _tell_apart(self, now_ms: int) -> None:
        """Join tracks that are one car, and say which are known as a car of their own.

        Two tracks in each other's place are one car, unless they were seen side by side. Two that
        might be one, but are not known well enough to say so, are not told of as two: the one that
        the own camera sees is told of, or else the better placed one, whatever a liar says.
        """
        settings, association = self._settings, self._settings.association
        q = settings.acceleration_density
        cars = self._comparison()
        apart = _apart_m(places := cars.places_m(now_ms), places)
        variances = _variances(cars, now_ms, q)
        near = np.argwhere(np.triu(apart < _NEAR_M, k=1))
        doubles: list[set[int]] = [set() for _ in self._tracks]
        gone: set[int] = set()
        if len(near):
            one, other = cars[near[:, 0]], cars[near[:, 1]]
            squared, _, variance = distances(one, other, q)
            compatible = squared <= gates(one, association.gate_probability)
            close = apart[near[:, 0], near[:, 1]] <= association.overlap_m
            for (i, j), fits, touches, spread in zip(
                near.tolist(), compatible.tolist(), close.tolist(), variance.tolist(), strict=True
            ):
                if not (fits or touches) or i in gone or j in gone:
                    continue
                first, second = self._tracks[i], self._tracks[j]
                if first.was_seen_beside(second):
                    continue
                age_s = (now_ms - max(first.first_ms, second.first_ms)) / 1000
                certain = spread <= (association.certain_m * (1.0 + 4.0 * age_s)) ** 2
                if touches and (certain or first.shares_with(second)):
                    first.take_over(second)
                    gone.add(j)
                elif fits and first.is_confirmed and second.is_confirmed:
                    doubles[i].add(j)
                    doubles[j].add(i)
        # The first to be told of hides its doubles; who is hidden itself hides nobody.
        told: set[int] = set()
        for at in sorted(
            set(range(len(cars))) - gone,
            key=lambda at: (not self._tracks[at].is_seen, variances[at]),
        ):
            track = self._tracks[at]
            well_placed = variances[at] <= settings.vaguest_known_m**2
            track.is_known = bool(
                track.is_confirmed and well_placed and told.isdisjoint(doubles[at])
            )
            if track.is_known:
                told.add(at)
        if gone:
            self._tracks = [track for at, track in enumerate(self._tracks) if at not in gone]
            kept = [at for at in range(len(cars)) if at not in gone]
            self._compared = cars[kept]


def _apart_m(some: Array, others: Array) -> Array:
    """Distances (M, N) between places (2, M) and (2, N)."""
    apart: Array = np.hypot(*(some[:, :, None] - others[:, None, :]))
    return apart


def _variances(cars: Kinematics, now_ms: int, q: float) -> Array:
    """How well N places are known at `now_ms`: the traces of their covariances, m^2."""
    dt, p = (now_ms - cars.stamps_ms) / 1000, cars.covariances
    grown: Array = (
        p[0, 0]
        + p[1, 1]
        + dt * (2 * (p[0, 2] + p[1, 3]) + dt * (p[2, 2] + p[3, 3]))
        + 2 * q * np.abs(dt) ** 3 / 3
    )
    return grown
