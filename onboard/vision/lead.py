"""Selection of the lead: the nearest vehicle in the host vehicle's lane.

A vehicle enters the lane when its middle is within 0.35 lane widths of the lane's middle, and
leaves it beyond 0.55, so that one on the line does not toggle; as far as the vehicle's path is
uncertain, later. A vehicle that is near and straight
ahead is in the lane whatever the markings say.

A false lead is worse than a missed one: only confirmed tracks count, whose detections were where a
moving body would be and whose box is as wide as a vehicle's at its gap, and a track that is no
longer observed gives way to an observed one behind it. One that only optical flow holds gives way
to one that is found within a vehicle's length: it is the same vehicle. What stays on its pixels is
none. Where vehicles are found as such, a plate counts only on one of them. In bends, parked
vehicles pass through the lane; they are excluded by their sideways speed.
"""

import math

from onboard.vision.lane import HostLane
from onboard.vision.tracker import VEHICLE_LENGTH
from onboard.vision.vehicle_track import VehicleTrack

ENTER_LANE_WIDTHS, LEAVE_LANE_WIDTHS = 0.35, 0.55
"""Distance from the lane's middle at which a vehicle enters and leaves it, in lane widths."""
NEAR_LANE_WIDTHS, STRAIGHT_AHEAD_LANE_WIDTHS = 5.0, 0.25
"""Distance ahead and to the side within which a vehicle is always in the lane, in lane widths."""
NEAREST_LANE_WIDTHS = 0.3
"""Least distance of a lead in lane widths: 1 m, where the bonnet is."""
LEAD_SLACK = 4.0
"""Factor on the inconsistency up to which what is in the lane stays a body: with 1, two of 37 leads
of the labelled clips are lost, with 2, a rendered lead in a drive with darkened frames."""
SIZE_RATIOS = 0.6, 1.7
"""Least and largest size of a vehicle's boxes at their gaps, by the usual one of its kind: a
tractor taken for a car is 1.4 times as wide, a small car taken for a truck 0.7. Not fitted."""
LANE_CHANGE_M_S2, LATERAL_SIGMAS = 3.5, 1.5
"""Acceleration that crosses one lane in the time ahead for which a vehicle must stay in the lane to
enter it (1 s on a road), and the sigmas of its lateral speed that are added against entering."""
MAX_MISSED_S = 0.4
"""A lead that was missed for less than this is kept: detectors miss a frame or two."""


class LeadSelector:
    """Selects the lead, with the hysteresis of the lane's border."""

    def __init__(self, lane: HostLane, *, needs_vehicle: bool = False) -> None:
        """Start without a lead.

        Args:
            lane: the host vehicle's.
            needs_vehicle: whether a plate counts only on a vehicle that is found as such.
        """
        self._lane = lane
        self._needs_vehicle = needs_vehicle
        self._in_lane: set[int] = set()

    def select(self, tracks: list[VehicleTrack], stamp_s: float) -> VehicleTrack | None:
        """The lead among `tracks`, all predicted to `stamp_s`, if there is one."""
        inside = [
            track for track in tracks if self._is_settled(track, stamp_s) and self._is_inside(track)
        ]
        self._in_lane = {track.track_id for track in inside}
        observed = [track for track in inside if stamp_s - track.observed_at <= MAX_MISSED_S]
        nearest = min(observed or inside, key=_ahead_m, default=None)
        if nearest is None or stamp_s - nearest.detected_at <= MAX_MISSED_S:
            return nearest
        length_m = VEHICLE_LENGTH * self._lane.shape.width_m + nearest.ahead.position_sigma_m
        same = (each for each in observed if _ahead_m(each) <= _ahead_m(nearest) + length_m)
        found = (each for each in same if stamp_s - each.detected_at <= MAX_MISSED_S)
        return min(found, key=_ahead_m, default=nearest)

    def has_candidate(self, tracks: list[VehicleTrack], stamp_s: float) -> bool:
        """Whether a track other than a lead is in the lane: it may become one, or passes through.

        What is not surely a vehicle is in the lane up to the distance at which a lead leaves it.
        """
        return any(
            track.track_id not in self._in_lane
            and not track.is_still_in_picture(stamp_s)
            and abs(self._offset_m(track.ahead.position_m, track.right.position_m))
            <= self._lane.shape.width_m
            * (ENTER_LANE_WIDTHS if self._is_settled(track, stamp_s) else LEAVE_LANE_WIDTHS)
            for track in tracks
        )

    def entering(self, tracks: list[VehicleTrack]) -> list[VehicleTrack]:
        """Tracks beside the lane that are in it a second later, as far as their motion is known."""
        leave_m = LEAVE_LANE_WIDTHS * self._lane.shape.width_m
        return [
            track
            for track in tracks
            if track.track_id not in self._in_lane and self._later_bound_m(track) <= leave_m
        ]

    def is_vehicle(self, track: VehicleTrack, stamp_s: float) -> bool:
        """Whether it is a vehicle, wherever it is, and not something that looks like a plate."""
        return (
            track.confirmed
            and (not self._needs_vehicle or track.has_vehicle)
            and not track.is_still_in_picture(stamp_s)
        )

    def _is_settled(self, track: VehicleTrack, stamp_s: float) -> bool:
        """Whether it is surely a vehicle, and its motion is known."""
        is_far_enough = track.ahead.position_m >= NEAREST_LANE_WIDTHS * self._lane.shape.width_m
        slack = LEAD_SLACK if track.track_id in self._in_lane else 1.0
        return (
            self.is_vehicle(track, stamp_s)
            and is_far_enough
            and track.is_consistent(slack)
            and SIZE_RATIOS[0] <= track.size_ratio <= SIZE_RATIOS[1]
        )

    def _is_inside(self, track: VehicleTrack) -> bool:
        ahead_m, right_m = track.ahead.position_m, track.right.position_m
        width_m = self._lane.shape.width_m
        offset_m = self._offset_m(ahead_m, right_m)
        if track.track_id in self._in_lane:
            leave_m = LEAVE_LANE_WIDTHS * width_m + self._lane.path_sigma_m(ahead_m)
            return abs(offset_m) <= leave_m or self._is_straight_ahead(ahead_m, right_m)
        return self._later_bound_m(track) <= LEAVE_LANE_WIDTHS * width_m and (
            abs(offset_m) <= ENTER_LANE_WIDTHS * width_m
            or self._is_straight_ahead(ahead_m, right_m)
        )

    def _later_bound_m(self, track: VehicleTrack) -> float:
        """Distance from the lane's middle after the time of a lane change, at most."""
        ahead_s = math.sqrt(self._lane.shape.width_m / LANE_CHANGE_M_S2)
        offset_m = self._offset_m(
            max(0.0, track.ahead.position_m + ahead_s * track.ahead.rate_m_s),
            track.right.position_m + ahead_s * track.right.rate_m_s,
        )
        return abs(offset_m) + LATERAL_SIGMAS * ahead_s * track.right.rate_sigma_m_s

    def _offset_m(self, ahead_m: float, right_m: float) -> float:
        """Distance to the right of the lane's middle."""
        return right_m - self._lane.shape.middle_m(ahead_m)

    def _is_straight_ahead(self, ahead_m: float, right_m: float) -> bool:
        width_m = self._lane.shape.width_m
        return (
            ahead_m <= NEAR_LANE_WIDTHS * width_m
            and abs(right_m) <= STRAIGHT_AHEAD_LANE_WIDTHS * width_m
        )


def _ahead_m(track: VehicleTrack) -> float:
    return track.ahead.position_m
