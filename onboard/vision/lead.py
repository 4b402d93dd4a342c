"""Which of the cars in view is the one ahead in the own lane.

A car is in the lane while its middle is: it enters at 0.35 lane widths from the lane's middle and
leaves at 0.55, so that a car on the line does not flap. What is near and straight ahead is in the
way whatever the markings seem to say. The nearest one is the lead.

A ghost lead is worse than a missed one: a car must have been sighted three times, and one that is
not sighted any more gives way to a car that is seen beyond it, through the place where it would be.
While the own car turns, parked cars sweep through where it points, and none of them stays there.
"""

import math

from onboard.vision.car_track import CarTrack
from onboard.vision.lane import OwnLane

ENTER, LEAVE = 0.35, 0.55
"""Lane widths from the middle of the lane."""
NEAR, IN_THE_WAY = 5.0, 0.25
"""Lane widths ahead and to the side."""
SIDEWAYS_M_S2, SURELY = 3.5, 1.5
"""In the time in which this would bring it from lane to lane (1 s on a road), what came into the
lane does not leave it again, but for so many sigmas: what does only sweeps past."""
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
        ahead_m, right_m = track.ahead.position_m, track.right.position_m
        width_m = self._lane.shape.width_m
        offset_m = self._offset_m(ahead_m, right_m)
        if track.track_id in self._in_lane:
            return abs(offset_m) <= LEAVE * width_m or self._is_in_the_way(ahead_m, right_m)
        soon_s = math.sqrt(width_m / SIDEWAYS_M_S2)
        then_m = self._offset_m(
            max(0.0, ahead_m + soon_s * track.ahead.rate_m_s),
            right_m + soon_s * track.right.rate_m_s,
        )
        surely_m = abs(then_m) + SURELY * soon_s * track.right.rate_sigma_m_s
        return surely_m <= LEAVE * width_m and (
            abs(offset_m) <= ENTER * width_m or self._is_in_the_way(ahead_m, right_m)
        )

    def _offset_m(self, ahead_m: float, right_m: float) -> float:
        """To the right of the lane's middle."""
        return right_m - self._lane.shape.middle_m(ahead_m)

    def _is_in_the_way(self, ahead_m: float, right_m: float) -> bool:
        width_m = self._lane.shape.width_m
        return ahead_m <= NEAR * width_m and abs(right_m) <= IN_THE_WAY * width_m
