"""All cars without a radio: which evidence is of which car, and which cars are new or the same.

A track holds nothing but its evidence. Evidence expires, and a track that has none left is dropped.

Every observer, the own camera included, has a name of its own for a car and keeps to it. Evidence
under a name that has been matched goes to the same track for as long as it fits there. A new name
is matched by its place only where that leaves no doubt; otherwise it begins a track of its own,
which is joined with another when both are known well enough to say that they are one car.
"""

from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from itertools import accumulate, groupby

import numpy as np

from onboard.kinematics.arrays import Array, StateArrays
from onboard.mvs.settings import MvsSettings
from onboard.tracking.association import UnassociatedEvidence, compare
from onboard.tracking.evidence import as_arrays
from onboard.tracking.evidence_store import OWN, EvidenceBatch, EvidenceStore, StoredEvidence
from onboard.tracking.fusion import choose_and_fuse
from onboard.tracking.gates import are_inside, distances, gates, with_speed_prior
from onboard.tracking.track import Name, Track

_RADIO_REMEMBERED_MS = 500
"""For this long a track counts as a car with a radio after it last matched one."""

_PLACE_HOLDS_MS = 500
"""For this long a car with a radio is taken to be where its last BSM foretells: 1 m off, if it
brakes hard."""

_ENTRIES_AT_ONCE = 64
"""Compared with all cars together: many enough for arrays to pay, few enough for hostile ones."""
_NEAR_M = 8.0
"""Tracks farther apart than this count as two cars, however vague they are. Errors of two observers
that stay from picture to picture can place one car this far apart."""

_Said = tuple[bytes, int]
"""A report: who tells, and when it was received."""


class Tracks:
    """Holds the tracks; times are ms of UTC."""

    def __init__(self, settings: MvsSettings) -> None:
        self._settings = settings
        self._tracks: list[Track] = []
        self._named: dict[Name, Track] = {}
        self._last_number = 0
        self._shelf = EvidenceStore()
        self._compared: StateArrays | None = None
        """What evidence is compared with, a column for each track; `None` before it is needed."""

    def __iter__(self) -> Iterator[Track]:
        return iter(self._tracks)

    def __len__(self) -> int:
        return len(self._tracks)

    def receive(self, batch: EvidenceBatch) -> list[int]:
        """Give each entry to the car that it belongs to, or let it be a new car.

        Returns:
            the rows that would have been one new car too many.
        """
        shelved = self._shelf.put(batch.entries)
        strangers, told_of = self._assign_named(batch, shelved)
        sayings = [
            (list(rows), told_of[said])
            for said, rows in groupby(
                strangers, key=lambda row: (batch.tellers[row], batch.received_ms[row])
            )
        ]
        refused: list[int] = []
        while sayings:
            entries = accumulate(len(saying) for saying, _ in sayings)
            together = max(1, sum(so_far <= _ENTRIES_AT_ONCE for so_far in entries))
            refused += self._assign_strangers(batch, shelved, sayings[:together])
            sayings = sayings[together:]
        return refused

    def refresh(self, now_ms: int) -> None:
        """Forget what is old, choose the evidence of each car anew, and fuse it."""
        settings, belief = self._settings, self._settings.footer_validation
        memory_ms, unseen_ms = round(settings.memory_s * 1000), round(settings.unseen_s * 1000)
        settled_ms = round(settings.settled_s * 1000)
        self._tracks = [track for track in self._tracks if now_ms - track.last_ms <= unseen_ms]
        for track in self._tracks:
            track.forget(now_ms - memory_ms, belief.estimates_per_car, belief.evidence_per_car)
        # An estimate goes by its oldest measurement, so a car may lose all before it is unseen.
        self._tracks = [track for track in self._tracks if track.held]
        choose_and_fuse(self._tracks, self._shelf, now_ms, settings.acceleration_density)
        for track in self._tracks:
            track.settle(now_ms - settled_ms)
            track.is_confirmed = track.is_confirmed or track.moments() >= settings.confirmed_by
        self._compared = None
        self._tell_apart(now_ms)
        self._named = {name: track for track in self._tracks for name in track.names}
        self._tidy()

    def recognise(self, ids: Sequence[bytes], reported: StateArrays, now_ms: int) -> None:
        """Find the tracks that are cars with a radio, or the own car.

        A track that only others report, and the own camera does not see, is matched only where the
        two overlap: whoever reports it has told it apart from the cars with a radio beside it. The
        own car is matched in either case.

        Args:
            ids: of those cars, the own one first.
            reported: what they say of themselves.
            now_ms: UTC.
        """
        settings, q = self._settings.association, self._settings.acceleration_density
        offset = np.zeros((4, 4, 1))
        offset[:2, :2, 0] = settings.radio_offset_sigma_m**2 * np.eye(2)
        cars = StateArrays(
            reported.stamps_ms, reported.states, reported.covariances + offset, reported.has_speed
        )
        apart = _apart_m(reported.places_m(now_ms), self._comparison().places_m(now_ms))
        silent = now_ms - reported.stamps_ms > _PLACE_HOLDS_MS
        silent[:1] = False
        apart[silent] = np.inf
        eligible = apart <= settings.overlap_m
        eligible |= np.array([track.is_seen for track in self._tracks], dtype=bool)
        eligible[:1] = True
        compared = compare(cars, self._comparison(), settings.recognition_probability, q)
        compared.inside[:] &= eligible
        radio_of = {track: row for row, track in compared.assign().items()}
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
        self._shelf.map_to(turn, shift)
        for track in self._tracks:
            track.estimate = track.estimate.mapped(turn, shift)
        self._compared = None

    def _tidy(self) -> None:
        """Drop from the shelf what no track holds any more."""
        if self._shelf.is_due(sum(len(track.evidence) + len(track.settled) for track in self)):
            held = {held for track in self for held in (*track.held, *track.chosen)}
            self._shelf.keep([each.row for each in held])
            for row, each in enumerate(held):
                each.row = row

    def _add(self, track: Track, batch: EvidenceBatch, row: int, shelved: int) -> None:
        track.call((batch.tellers[row], batch.cars[row]), batch.received_ms[row])
        if track.wants(batch.provenances[row], is_firsthand=batch.firsthand[row]):
            track.add(self._held(batch, row, shelved))

    def _held(self, batch: EvidenceBatch, row: int, shelved: int) -> StoredEvidence:
        """An entry as evidence; its numbers stand in the row `shelved` of the shelf."""
        return StoredEvidence(
            batch.provenances[row],
            int(batch.spans.newest_ms[row]),
            int(batch.spans.oldest_ms[row]),
            not batch.entries.has_speed[row],
            batch.firsthand[row],
            batch.tellers[row],
            batch.received_ms[row],
            self._shelf,
            shelved,
        )

    def _unname(self, name: Name) -> None:
        track = self._named.pop(name, None)
        if track is not None and name in track.names:
            track.uncall([name])

    def _assign_named(
        self, batch: EvidenceBatch, shelved: int
    ) -> tuple[list[int], defaultdict[_Said, set[int]]]:
        """Give entries under known names to their tracks, as long as they fit there.

        Args:
            batch: entries.
            shelved: where the first of them stands on the shelf.

        Returns:
            the rows under new names, in order; of each report, the places of the tracks that its
            other rows are of.
        """
        told_of: defaultdict[_Said, set[int]] = defaultdict(set)
        names = list(zip(batch.tellers, batch.cars, strict=True))
        named = [row for row, name in enumerate(names) if name in self._named]
        strangers = [row for row, name in enumerate(names) if name not in self._named]
        if not named:
            return strangers, told_of
        association, q = self._settings.association, self._settings.acceleration_density
        place_of = {track.number: at for at, track in enumerate(self._tracks)}
        places = [place_of[self._named[names[row]].number] for row in named]
        cars = self._comparison()[places]
        fitting = are_inside(batch.entries[named], cars, association.gate_probability, q)
        for row, place, fits in zip(named, places, fitting.tolist(), strict=True):
            if fits:
                self._add(self._tracks[place], batch, row, shelved + row)
                told_of[batch.tellers[row], batch.received_ms[row]].add(place)
            else:
                self._unname(names[row])
                strangers.append(row)
        return sorted(strangers), told_of

    def _assign_strangers(
        self, batch: EvidenceBatch, shelved: int, sayings: Sequence[tuple[list[int], set[int]]]
    ) -> list[int]:
        """Match entries under new names with tracks, or begin tracks for them.

        Args:
            batch: entries.
            shelved: where the first of them stands on the shelf.
            sayings: of each report, the rows under new names, and the places of the tracks that its
                other rows are of: no two rows of a report are one car.

        Returns:
            the rows that found no room.
        """
        settings = self._settings
        rows = [row for saying, _ in sayings for row in saying]
        strangers = UnassociatedEvidence(
            batch.rows(rows),
            self._tracks,
            self._comparison(),
            settings.association,
            settings.acceleration_density,
        )
        first_told = Counter(track.first_teller for track in self._tracks)
        refused = []
        at = 0
        for saying, barred in sayings:
            found = strangers.tracks_of(range(at, at + len(saying)), barred)
            for row in saying:
                teller, name = batch.tellers[row], (batch.tellers[row], batch.cars[row])
                if (track := found.get(at)) is not None:
                    self._add(track, batch, row, shelved + row)
                elif self._has_room(teller, first_told[teller]):
                    track = self._begin(name, self._held(batch, row, shelved + row))
                    strangers.begin(at, track)
                    first_told[teller] += 1
                else:
                    refused.append(row)
                if track is not None:
                    self._named[name] = track
                at += 1
        self._compared = strangers.cars
        return refused

    def _begin(self, name: Name, first: StoredEvidence) -> Track:
        self._last_number += 1
        track = Track(self._last_number, first)
        track.call(name, first.received_ms)
        self._tracks.append(track)
        return track

    def _has_room(self, teller: bytes, first_told: int) -> bool:
        """Whether a track may be begun; some room is kept for what the own camera sees."""
        belief = self._settings.footer_validation
        if teller == OWN:
            return len(self._tracks) < belief.cars
        return (
            len(self._tracks) < belief.cars - belief.cars_per_sender
            and first_told < belief.cars_per_sender
        )

    def _comparison(self) -> StateArrays:
        if self._compared is None:
            cars = as_arrays([track.estimate for track in self._tracks])
            sigma_m_s = self._settings.association.speed_sigma_m_s
            self._compared = with_speed_prior(cars, sigma_m_s)
        return self._compared

    def _tell_apart(self, now_ms: int) -> None:
        """Join tracks that are one car, and say which are known as a car of their own."""
        cars = self._comparison()
        joined, doubles = self._join(cars, now_ms)
        kept = [at for at in range(len(cars)) if at not in joined]
        self._choose_known(cars, kept, doubles, now_ms)
        if joined:
            self._tracks = [self._tracks[at] for at in kept]
            self._compared = cars[kept]

    def _join(self, cars: StateArrays, now_ms: int) -> tuple[set[int], list[set[int]]]:
        """Let tracks take over those that are the same car.

        Two tracks in each other's place are one car, unless they were seen side by side.

        Returns:
            places of the tracks that have been taken over; for each track the places of those that
            might be the same car, but are not known well enough to say so.
        """
        association, q = self._settings.association, self._settings.acceleration_density
        apart = _apart_m(places := cars.places_m(now_ms), places)
        near = np.argwhere(np.triu(apart < _NEAR_M, k=1))
        joined: set[int] = set()
        doubles: list[set[int]] = [set() for _ in self._tracks]
        if not len(near):
            return joined, doubles
        one, other = cars[near[:, 0]], cars[near[:, 1]]
        squared, _, variance = distances(one, other, q)
        compatible = squared <= gates(one, association.gate_probability)
        close = apart[near[:, 0], near[:, 1]] <= association.overlap_m
        maybe_one = compatible | close
        for (i, j), fits, touches, spread in zip(
            near[maybe_one].tolist(),
            compatible[maybe_one].tolist(),
            close[maybe_one].tolist(),
            variance[maybe_one].tolist(),
            strict=True,
        ):
            if i in joined or j in joined:
                continue
            first, second = self._tracks[i], self._tracks[j]
            if first.was_seen_beside(second):
                continue
            age_s = (now_ms - max(first.first_ms, second.first_ms)) / 1000
            certain = spread <= (association.certain_m * (1.0 + 4.0 * age_s)) ** 2
            if touches and (certain or first.shares_with(second)):
                first.take_over(second)
                joined.add(j)
            elif fits and first.is_confirmed and second.is_confirmed:
                doubles[i].add(j)
                doubles[j].add(i)
        return joined, doubles

    def _choose_known(
        self, cars: StateArrays, kept: Sequence[int], doubles: Sequence[set[int]], now_ms: int
    ) -> None:
        """Of the tracks in the places `kept` that might be one car, tell of one only.

        That is the one that the own camera sees, or else the better placed one, whatever a liar
        says. Each that is told of hides its doubles; one that is hidden hides nobody.
        """
        variances = _variances(cars, now_ms, self._settings.acceleration_density)
        told: set[int] = set()
        for at in sorted(kept, key=lambda at: (not self._tracks[at].is_seen, variances[at])):
            track = self._tracks[at]
            well_placed = variances[at] <= self._settings.vaguest_known_m**2
            track.is_known = bool(
                track.is_confirmed and well_placed and told.isdisjoint(doubles[at])
            )
            if track.is_known:
                told.add(at)


def _apart_m(some: Array, others: Array) -> Array:
    """Distances (M, N) between places (2, M) and (2, N)."""
    apart: Array = np.hypot(*(some[:, :, None] - others[:, None, :]))
    return apart


def _variances(cars: StateArrays, now_ms: int, q: float) -> Array:
    """How well N places are known at `now_ms`: the traces of their covariances, m^2."""
    dt, p = (now_ms - cars.stamps_ms) / 1000, cars.covariances
    grown: Array = (
        p[0, 0]
        + p[1, 1]
        + dt * (2 * (p[0, 2] + p[1, 3]) + dt * (p[2, 2] + p[3, 3]))
        + 2 * q * np.abs(dt) ** 3 / 3
    )
    return grown
