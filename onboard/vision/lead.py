"""Which of the cars in view is the one ahead in the own lane.

A car is in the lane while its middle is: it enters at 0.35 lane widths from the lane's middle and
leaves at 0.55, so that a car on the line does not flap. What is near and straight ahead is in the
way whatever the markings seem to say. The nearest one is the lead. A ghost
lead is worse than a missed one: a car must have been sighted three times, and one that is not
sighted any more gives way to a car that is seen beyond it, through the place where it would be.
"""

from onboard.vision.car_track import CarTrack
from onboard.vision.lane import OwnLane

ENTER, LEAVE = 0.35, 0.55
"""Lane widths from the middle of the lane."""
NEAR, IN_THE_WAY = 5.0, 0.25
"""Lane widths ahead and to the side."""
BLINK_S = 0.4
"""A lead unseen for so long is not given up for one beyond it: detectors miss a frame or two."""


class LeadChoice:
    """Chooses the lead, frame by frame."""

    def __init__(self, lane: OwnLane) -> None:
        self._lane = lane
        self._in_lane: set[int] = set()

    def choose(self, tracks: list[CarTrack], stamp_s: float) -> CarTrack | None:
        """The lead among `tracks`, which were moved to `stamp_s`."""
        inside = [track for track in tracks if track.confirmed and self._is_inside(track)]
        self._in_lane = {track.track_id for track in inside}
        seen = [track for track in inside if stamp_s - track.present_at <= BLINK_S]
        return min(seen or inside, key=lambda track: track.ahead.position_m, default=None)

    def _is_inside(self, track: CarTrack) -> bool:
        ahead_m = track.ahead.position_m
        width_m = self._lane.shape.width_m
        if ahead_m <= NEAR * width_m and abs(track.right.position_m) <= IN_THE_WAY * width_m:
            return True
        offset_m = abs(track.right.position_m - self._lane.shape.middle_m(ahead_m))
        limit = LEAVE if track.track_id in self._in_lane else ENTER
        return offset_m <= limit * width_m
