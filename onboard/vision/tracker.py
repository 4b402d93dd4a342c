"""Association of detections with the tracks of vehicles.

It is done in metres, where the next lane is a lane's width away and the vehicle in front several
metres: a plate and a tag, or two plates, of one vehicle then belong to one track. The best pairs of
detections and tracks are a linear assignment (Kuhn 1955, "The Hungarian method for the assignment
problem").
"""

import math

import numpy as np

from onboard.observations import ImageBox
from onboard.tracking.assignment import cheapest_pairs
from onboard.vision.detection import Detection, DetectionKind
from onboard.vision.perspective import Perspective, RoadPosition, bounding_box
from onboard.vision.plate_formats import PlateFormats
from onboard.vision.vehicle_track import VehicleTrack

GATE_SIGMA = 4.0
"""Half width of the gate around a predicted position."""
KEEP_S = 1.5
"""Time from the last observation of a confirmed vehicle until its track is dropped."""
KEEP_UNREAD_S = 10.0
"""The same from the last detection of a plate, tag or vehicle, while the rear is still tracked."""
MISSED_S = 0.4
"""Time by which a vehicle without a certain text is kept longer than it was detected: what was
detected for a moment only is not kept by optical flow."""
HEIGHTS = (0.0, 0.5)
"""Height of plates over the road, in lane widths: up to 1.75 m, on a van's door."""
TENTATIVE_SHARE = 0.4
"""Share of `KEEP_S` after which a tentative track is dropped."""
SAME_PLACE_S, FRAGMENT_RATIO = 0.25, 1.8
"""Time for which a plate stays at about the same pixels, and the ratio of a whole plate's width
to a fragment of it, as a detector finds now and then. A fragment looks like a plate that is far
away."""
UNOBSERVED_S, VEHICLE_LENGTH = 0.4, 1.3
"""After a track was unobserved for this long, a detection farther than a vehicle's length (4.5 m,
in lane widths) from its prediction is another vehicle: one that turns off uncovers the one before
it."""
SAME_DISTANCE, SAME_VEHICLE_WIDTH = 0.1, 0.3
"""Two plates of one vehicle differ by at most this share of their distance, and are at most so many
lane widths apart sideways (1.05 m); two vehicles do not fit there."""
CONTRADICTED_SIGMA = 2.0
"""Half width of the gate for a plate that is certainly read as another text than the track's: a
misreading is where the vehicle is, another vehicle is not."""
REAR_RIM, VEHICLE_RIM = 0.25, 0.5
"""Shares of a box's sides by which its plate, and the same vehicle a moment later, may be beside it
in the image. Positions in metres do not part them: a sign over the road is as far as a vehicle that
the image's border cuts, and with a guessed lens, far vehicles of all lanes are near each other."""
RIM_PER_S = 1.0
"""Growth of these shares while the track is not observed: it moves on unseen, but not to another
place. Chosen, not fitted."""
BEND_RAD_S, TURN_RAD_S = 0.15, 0.3
"""Turn rate up to which vehicles ahead go along, as in a bend of a road (2 m/s2 at 50 km/h), and
from which they do not, as at a junction or around an obstacle (4 m/s2)."""
_OUTSIDE_GATE = 1e6


class Tracker:
    """Tracks of the vehicles in view."""

    def __init__(
        self,
        lane_width_m: float,
        *,
        slope: float = 0.04,
        formats: PlateFormats | None = None,
    ) -> None:
        """Start without tracks.

        Args:
            lane_width_m: width of the host vehicle's lane.
            slope: error of heights above the road, as a share of the distance.
            formats: formats of plates; `None` allows all.
        """
        self._formats = formats or PlateFormats()
        self._lane_width_m = lane_width_m
        self._slope = slope
        self._next_id = 1
        self._size_px: tuple[int, int] | None = None
        self._turn_rad_s = 0.0
        self.tracks: list[VehicleTrack] = []

    def receive_size(self, size_px: tuple[int, int]) -> None:
        """Convert the tracks' pixels to those of frames of this width and height."""
        if self._size_px not in (None, size_px):
            for track in self.tracks:
                scaled = track.corners_px * np.divide(size_px, self._size_px)
                track.corners_px = scaled.astype(np.float32)
        self._size_px = size_px

    def turn(self, by_rad: float) -> None:
        """Move all tracks to the left: the vehicle heads so far to the right of the assumed."""
        for track in self.tracks:
            track.right.move(-by_rad * track.ahead.position_m, -by_rad * track.ahead.rate_m_s)

    def receive_turn_rate(self, rate_rad_s: float) -> None:
        """Take the host vehicle's turn rate to the right, as it is in the next frame."""
        share = (abs(rate_rad_s) - BEND_RAD_S) / (TURN_RAD_S - BEND_RAD_S)
        before_rad_s, self._turn_rad_s = self._turn_rad_s, min(max(share, 0.0), 1.0) * rate_rad_s
        for track in self.tracks:
            track.receive_turn(before_rad_s, self._turn_rad_s)

    def follow_crossing(self, perspective: Perspective, stamp_s: float) -> None:
        """Move vehicles that cross the picture to where they are expected in this stamp's frame."""
        for track in self.tracks:
            if (track.is_crossing or self._turn_rad_s) and track.ahead.position_m > 0.0:
                track.follow(perspective, stamp_s)

    def receive_detections(
        self, detections: list[Detection], stamp_s: float
    ) -> list[tuple[Detection, VehicleTrack | None]]:
        """Predict all tracks to `stamp_s` and associate each detection with one, old or new.

        A second plate on one vehicle is associated with no track, and the first keeps its vote.
        """
        for track in self.tracks:
            track.predict(stamp_s)
        on_vehicles = [each for each in detections if self._is_on_a_vehicle(each)]
        pairs: list[tuple[Detection, VehicleTrack | None]] = [
            (detection, None) for detection in detections if detection not in on_vehicles
        ]
        for kind in (DetectionKind.TAG, DetectionKind.PLATE, DetectionKind.VEHICLE):
            # Kind by kind, so that one vehicle can take one detection of each kind.
            pairs += self._associate([s for s in on_vehicles if s.kind is kind], stamp_s)
        self.tracks = [track for track in self.tracks if self._is_kept(track, stamp_s)]
        return pairs

    def drop_beside(self, perspective: Perspective, stamp_s: float) -> None:
        """Drop the tracks that have left the picture at a side: nobody sees where they are."""
        width_px = self._size_px[0] if self._size_px else math.inf
        self.tracks = [
            track
            for track in self.tracks
            if track.observed_at == stamp_s or 0.0 <= _column_px(track, perspective) <= width_px
        ]

    def _is_on_a_vehicle(self, detection: Detection) -> bool:
        """Whether it is at the height of plates on vehicles, and not on a billboard."""
        slack_m = self._slope * detection.position.ahead_m
        lowest_m, highest_m = (share * self._lane_width_m for share in HEIGHTS)
        return lowest_m - slack_m <= detection.position.height_m <= highest_m + slack_m

    def _associate(
        self, detections: list[Detection], stamp_s: float
    ) -> list[tuple[Detection, VehicleTrack | None]]:
        pairs: list[tuple[Detection, VehicleTrack | None]] = []
        taken: set[int] = set()
        if detections and self.tracks:
            costs = np.array([[self._cost(s, t, stamp_s) for t in self.tracks] for s in detections])
            for row, column in cheapest_pairs(costs):
                if costs[row, column] < _OUTSIDE_GATE:
                    track = self.tracks[column]
                    detection = detections[row]
                    if (
                        not track.is_crossing
                        and self._can_have_crossed(detection, track)
                        and not _is_at_same_pixels(detection, track, stamp_s)
                    ):
                        track.cross(stamp_s)
                    track.update(detection, stamp_s)
                    pairs.append((detection, track))
                    taken.add(int(row))
        for index, detection in enumerate(detections):
            if index not in taken:
                is_second = any(
                    self._cost(detection, track, stamp_s) < _OUTSIDE_GATE
                    for _, track in pairs
                    if track is not None
                ) or any(self._is_second_plate(detection, track, stamp_s) for track in self.tracks)
                pairs.append(
                    (detection, None if is_second else self._start_track(detection, stamp_s))
                )
        return pairs

    def _cost(self, detection: Detection, track: VehicleTrack, stamp_s: float) -> float:
        detection = track.with_track_format(detection)
        ahead_m = detection.position.ahead_m - track.ahead.position_m
        right_m = detection.position.right_m - track.right.position_m
        ahead_sigma_m = math.hypot(detection.ahead_sigma_m, track.gap_sigma_m, 0.5)
        right_sigma_m = math.hypot(
            detection.right_sigma_m, track.right.position_sigma_m, 0.04 * self._lane_width_m
        )
        may_cross = track.is_crossing or detection.may_cross
        crossed_m = track.crossed_m(stamp_s) if may_cross else 0.0
        is_at_same_pixels = _is_at_same_pixels(detection, track, stamp_s)
        if not is_at_same_pixels and self._can_have_crossed(detection, track):
            right_sigma_m = math.hypot(right_sigma_m, crossed_m / GATE_SIGMA)
        cost = (ahead_m / ahead_sigma_m) ** 2 + (right_m / right_sigma_m) ** 2
        if is_at_same_pixels:
            return cost
        lane_m = 0.5 * self._lane_width_m
        rim = crossed_m / self._lane_width_m if track.is_crossing else 0.0
        if abs(right_m) > lane_m + crossed_m or _is_beside(detection, track, stamp_s, rim):
            return _OUTSIDE_GATE
        was_unobserved = track.confirmed and stamp_s - track.observed_at > UNOBSERVED_S
        if (
            was_unobserved
            and abs(ahead_m) > VEHICLE_LENGTH * self._lane_width_m + detection.ahead_sigma_m
        ):
            return _OUTSIDE_GATE
        is_contradicted = track.is_contradicted_by(detection)
        gate_sigma = CONTRADICTED_SIGMA if is_contradicted else GATE_SIGMA
        if was_unobserved and is_contradicted:
            return _OUTSIDE_GATE
        if abs(ahead_m) > gate_sigma * ahead_sigma_m or abs(right_m) > gate_sigma * right_sigma_m:
            return _OUTSIDE_GATE
        if detection.kind is track.last.kind:
            height_m = detection.position.height_m - track.last.position.height_m
            cost += (height_m / (0.04 * self._lane_width_m)) ** 2
        return cost

    def _can_have_crossed(self, detection: Detection, track: VehicleTrack) -> bool:
        """Whether it is in another lane than the track, and both may drive across."""
        right_m = abs(detection.position.right_m - track.right.position_m)
        may_cross = track.last.may_cross and detection.may_cross
        return may_cross and right_m > 0.5 * self._lane_width_m

    def _is_second_plate(self, detection: Detection, track: VehicleTrack, stamp_s: float) -> bool:
        """Whether it is a second plate on this vehicle, which was observed a moment ago."""
        if {detection.kind, track.last.kind} != {DetectionKind.PLATE}:
            return False
        if stamp_s - track.observed_at > SAME_PLACE_S:
            return False
        position = track.with_track_format(detection).position
        ahead_m, right_m = track.ahead.position_m, track.right.position_m
        return (
            abs(position.ahead_m - ahead_m) <= SAME_DISTANCE * ahead_m
            and abs(position.right_m - right_m) <= SAME_VEHICLE_WIDTH * self._lane_width_m
        )

    def _start_track(self, detection: Detection, stamp_s: float) -> VehicleTrack:
        track = VehicleTrack(self._next_id, detection, stamp_s, self._formats)
        track.receive_turn(0.0, self._turn_rad_s)
        self._next_id += 1
        self.tracks.append(track)
        return track

    def _is_kept(self, track: VehicleTrack, stamp_s: float) -> bool:
        if track.ahead.position_m <= 0:
            return False
        if not track.confirmed:
            return stamp_s - track.detected_at <= TENTATIVE_SHARE * KEEP_S
        proven_s = math.inf if track.text is not None else MISSED_S + track.detected_s
        return stamp_s - track.observed_at <= min(
            KEEP_S, proven_s
        ) and stamp_s - track.detected_at <= min(KEEP_UNREAD_S, proven_s)


def _column_px(track: VehicleTrack, perspective: Perspective) -> float:
    """Column of the picture in which the track is predicted."""
    ahead_m, right_m = track.ahead.position_m, track.right.position_m
    return perspective.project(RoadPosition(ahead_m, right_m, 0.0))[0]


def _is_at_same_pixels(detection: Detection, track: VehicleTrack, stamp_s: float) -> bool:
    """Whether it, or a fragment of it, is where the track's plate was a moment ago."""
    if detection.kind is not track.last.kind or stamp_s - track.observed_at > SAME_PLACE_S:
        return False
    box, last = detection.box, bounding_box(track.corners_px)
    return (
        box.w_px < FRAGMENT_RATIO * last.w_px
        and last.w_px < FRAGMENT_RATIO * box.w_px
        and _one_contains_middle(box, last)
    )


def _is_beside(
    detection: Detection, track: VehicleTrack, stamp_s: float, crossed: float = 0.0
) -> bool:
    """Whether it is elsewhere in the image: a plate not on that vehicle, or another vehicle."""
    kinds = detection.kind, track.last.kind
    if DetectionKind.VEHICLE not in kinds or DetectionKind.TAG in kinds:
        return False
    unseen_rim = RIM_PER_S * max(0.0, stamp_s - track.observed_at - SAME_PLACE_S)
    rear, other = detection.box, bounding_box(track.corners_px)
    if DetectionKind.PLATE not in kinds:
        return not _one_contains_middle(rear, other, rim=VEHICLE_RIM + unseen_rim + crossed)
    if detection.kind is DetectionKind.PLATE:
        rear, other = other, rear
    return not _contains_middle(rear, other, rim=REAR_RIM + unseen_rim)


def _one_contains_middle(one: ImageBox, other: ImageBox, rim: float = 0.0) -> bool:
    """Whether the middle of one of both lies in the other, with such a rim."""
    return _contains_middle(one, other, rim) or _contains_middle(other, one, rim)


def _contains_middle(one: ImageBox, other: ImageBox, rim: float = 0.0) -> bool:
    """Whether the middle of `other` lies in `one`, with a rim as a share of its sides."""
    x, y = other.centre_px
    across_px, along_px = rim * one.w_px, rim * one.h_px
    return (
        one.x_px - across_px <= x <= one.x_px + one.w_px + across_px
        and one.y_px - along_px <= y <= one.y_px + one.h_px + along_px
    )
