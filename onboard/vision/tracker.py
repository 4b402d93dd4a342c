"""Which sighting belongs to which car.

Sightings and cars are matched in metres, where the next lane is a lane's width away and a bumper
of the car in front several metres, so that a plate and a tag on one car, or two plates on it, meet
in one track. The best matching over all pairs is an assignment problem (Kuhn 1955).
"""

import math

import numpy as np

from onboard.observations import ImageBox
from onboard.tracking.assignment import cheapest_pairs
from onboard.vision.car_track import CarTrack
from onboard.vision.perspective import bounding_box
from onboard.vision.plate_formats import PlateKinds
from onboard.vision.plate_observation import Cue, Sighting

GATE_SIGMA = 4.0
HEIGHTS = (0.0, 0.5)
"""Of plates over the road, in lane widths: up to 1.75 m, on a van's door."""
UNCONFIRMED_SHARE = 0.4
"""Of the time that a car is kept: what was seen once or twice goes sooner."""
MOMENT_S, PIECE = 0.25, 1.8
"""How long a plate is still about where it was in the picture, and how much wider a whole one is
than the piece of it that a detector finds now and then: no other car, however far away it seems."""
AWAY_S, LENGTH = 0.4, 1.3
"""What is a car's length (4.5 m, in lane widths) from where a car would be that was away for so
long is another one: who turns off shows the car that drove before it."""
ABREAST, BESIDE = 0.1, 0.3
"""Two plates on one car differ by at most this share of their distance, and stand at most so many
lane widths beside each other (1.05 m); two vehicles do not fit there."""
_IMPOSSIBLE = 1e6


class Tracker:
    """The cars in view."""

    def __init__(
        self,
        lane_width_m: float,
        keep_s: float,
        keep_unread_s: float,
        identity_confidence: float,
        *,
        slope: float = 0.04,
        kinds: PlateKinds | None = None,
    ) -> None:
        """Watch an empty road.

        Args:
            lane_width_m: of the lane.
            keep_s: how long a car is kept that is not there any more.
            keep_unread_s: how long one of which only the rear is.
            identity_confidence: share of the votes that a text needs.
            slope: how far the car pitches and the road climbs against what was calibrated.
            kinds: of plates; `None`: all that are known.
        """
        self._kinds = kinds or PlateKinds()
        self._lane_width_m = lane_width_m
        self._keep_s = keep_s
        self._keep_unread_s = keep_unread_s
        self._identity_confidence = identity_confidence
        self._slope = slope
        self._next_id = 1
        self.tracks: list[CarTrack] = []

    def receive_sightings(
        self, sightings: list[Sighting], stamp_s: float
    ) -> list[tuple[Sighting, CarTrack | None]]:
        """Move all tracks to `stamp_s` and give each sighting to one, old or new.

        A second plate on one car belongs to none: two cars are never in one place, and the car goes
        on being known by the plate that it was known by.
        """
        for track in self.tracks:
            track.predict(stamp_s)
        on_cars = [sighting for sighting in sightings if self._is_on_a_car(sighting)]
        pairs: list[tuple[Sighting, CarTrack | None]] = [
            (sighting, None) for sighting in sightings if sighting not in on_cars
        ]
        for cue in (Cue.TAG, Cue.PLATE, Cue.VEHICLE):
            # Cue by cue, so that one car can take one of each.
            pairs += self._match([s for s in on_cars if s.cue is cue], stamp_s)
        self.tracks = [track for track in self.tracks if self._is_kept(track, stamp_s)]
        return pairs

    def _is_on_a_car(self, sighting: Sighting) -> bool:
        """Whether it is as high over the road as plates on cars are, and not on a billboard."""
        slack_m = self._slope * sighting.place.ahead_m
        lowest_m, highest_m = (share * self._lane_width_m for share in HEIGHTS)
        return lowest_m - slack_m <= sighting.place.height_m <= highest_m + slack_m

    def _match(
        self, sightings: list[Sighting], stamp_s: float
    ) -> list[tuple[Sighting, CarTrack | None]]:
        pairs: list[tuple[Sighting, CarTrack | None]] = []
        taken: set[int] = set()
        if sightings and self.tracks:
            costs = np.array([[self._cost(s, t, stamp_s) for t in self.tracks] for s in sightings])
            for row, column in cheapest_pairs(costs):
                if costs[row, column] < _IMPOSSIBLE:
                    track = self.tracks[column]
                    track.update(sightings[row], stamp_s)
                    pairs.append((sightings[row], track))
                    taken.add(int(row))
        for index, sighting in enumerate(sightings):
            if index not in taken:
                doubled = any(
                    self._cost(sighting, track, stamp_s) < _IMPOSSIBLE
                    for _, track in pairs
                    if track is not None
                ) or any(self._is_beside(sighting, track, stamp_s) for track in self.tracks)
                pairs.append((sighting, None if doubled else self._begin(sighting, stamp_s)))
        return pairs

    def _cost(self, sighting: Sighting, track: CarTrack, stamp_s: float) -> float:
        sighting = track.if_of_its_kind(sighting)
        ahead_m = sighting.place.ahead_m - track.ahead.position_m
        right_m = sighting.place.right_m - track.right.position_m
        ahead_sigma_m = math.hypot(sighting.ahead_sigma_m, track.gap_sigma_m, 0.5)
        right_sigma_m = math.hypot(
            sighting.right_sigma_m, track.right.position_sigma_m, 0.04 * self._lane_width_m
        )
        cost = (ahead_m / ahead_sigma_m) ** 2 + (right_m / right_sigma_m) ** 2
        if self._is_in_its_place(sighting, track, stamp_s):
            return cost
        if abs(right_m) > 0.5 * self._lane_width_m:
            return _IMPOSSIBLE
        is_back = track.confirmed and stamp_s - track.present_at > AWAY_S
        if is_back and abs(ahead_m) > LENGTH * self._lane_width_m + sighting.ahead_sigma_m:
            return _IMPOSSIBLE
        if abs(ahead_m) > GATE_SIGMA * ahead_sigma_m or abs(right_m) > GATE_SIGMA * right_sigma_m:
            return _IMPOSSIBLE
        if sighting.cue is track.last.cue:
            height_m = sighting.place.height_m - track.last.place.height_m
            cost += (height_m / (0.04 * self._lane_width_m)) ** 2
        return cost

    def _is_in_its_place(self, sighting: Sighting, track: CarTrack, stamp_s: float) -> bool:
        """Whether the picture shows it, or a piece of it, where this car's was a moment ago."""
        if sighting.cue is not track.last.cue or stamp_s - track.present_at > MOMENT_S:
            return False
        box, last = sighting.box, bounding_box(track.corners_px)
        return (
            box.w_px < PIECE * last.w_px
            and last.w_px < PIECE * box.w_px
            and (_holds(box, last) or _holds(last, box))
        )

    def _is_beside(self, sighting: Sighting, track: CarTrack, stamp_s: float) -> bool:
        """Whether it is a second plate on this car, which was there a moment ago."""
        if {sighting.cue, track.last.cue} != {Cue.PLATE}:
            return False
        if stamp_s - track.present_at > MOMENT_S:
            return False
        place = track.if_of_its_kind(sighting).place
        ahead_m, right_m = track.ahead.position_m, track.right.position_m
        return (
            abs(place.ahead_m - ahead_m) <= ABREAST * ahead_m
            and abs(place.right_m - right_m) <= BESIDE * self._lane_width_m
        )

    def _begin(self, sighting: Sighting, stamp_s: float) -> CarTrack:
        track = CarTrack(self._next_id, sighting, stamp_s, self._identity_confidence, self._kinds)
        self._next_id += 1
        self.tracks.append(track)
        return track

    def _is_kept(self, track: CarTrack, stamp_s: float) -> bool:
        if track.ahead.position_m <= 0:
            return False
        if not track.confirmed:
            return stamp_s - track.seen_at <= UNCONFIRMED_SHARE * self._keep_s
        return (
            stamp_s - track.present_at <= self._keep_s
            and stamp_s - track.seen_at <= self._keep_unread_s
        )


def _holds(one: ImageBox, other: ImageBox) -> bool:
    """Whether the middle of `other` lies in `one`."""
    x, y = other.centre_px
    return one.x_px <= x <= one.x_px + one.w_px and one.y_px <= y <= one.y_px + one.h_px
