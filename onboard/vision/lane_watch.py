"""The host vehicle's lane in each frame that is searched: its course, and whether it is free."""

import math
from collections.abc import Sequence

import numpy as np

from onboard.observations import ImageBox
from onboard.vision.frame_admission import AdmittedFrame
from onboard.vision.lane import HostLane
from onboard.vision.perspective import Perspective, RoadPosition, bounding_box
from onboard.vision.vehicle_track import VehicleTrack

FREE_S = 0.5
"""Time for which a lane that was seen to be free counts as free."""
FREE_WIDTHS, FREE_WIDTHS_WITH_VEHICLES = 14.0, 3.5
"""Distance in lane widths up to which a lane must look like road to be free (49 m), and the same
with a detector of vehicles, which finds those beyond (12 m)."""
VEHICLE_SIZE = (0.7, 0.6)
"""Width and height of the part of the image that hides the road, in lane widths: 2.4 by 2.1 m."""


class LaneWatch:
    """Follows the lane's markings, and remembers when the lane was seen to be free."""

    def __init__(self, lane_width_m: float, *, finds_vehicles: bool) -> None:
        """Start with a straight lane, of which nothing was seen.

        Args:
            lane_width_m: where no markings are found.
            finds_vehicles: whether vehicles are detected as such.
        """
        self.lane = HostLane(lane_width_m)
        self._lane_width_m = lane_width_m
        self._free_widths = FREE_WIDTHS_WITH_VEHICLES if finds_vehicles else FREE_WIDTHS
        self._free_at = -math.inf
        """Stamp of the last frame in which the lane was seen to be free."""

    def reset(self) -> None:
        """Forget that the lane was free: the next frame is of another drive."""
        self._free_at = -math.inf

    def is_free(self, stamp_s: float) -> bool:
        """Whether the lane was seen to be free shortly before."""
        return stamp_s - self._free_at <= FREE_S

    def receive_frame(
        self,
        frame: AdmittedFrame,
        tracks: Sequence[VehicleTrack],
        lead: VehicleTrack | None,
        *,
        is_searched: bool,
    ) -> None:
        """Look at the lane between the vehicles, if the frame is searched for these.

        Args:
            frame: of the camera.
            tracks: of all vehicles.
            lead: one of them, if there is one.
            is_searched: whether all of the frame is searched for vehicles.
        """
        if is_searched and frame.camera.markings is not None:
            hidden = [self._outline(track, frame.camera.perspective) for track in tracks]
            fit = frame.camera.markings.find(frame.image, hidden, self.lane.path_curvature_1_m)
            self.lane.receive_fit(fit)
            if lead is None and self._sees_free_lane(frame):
                self._free_at = frame.stamp_s
        if frame.may_hide_vehicles:
            self._free_at = -math.inf

    def _sees_free_lane(self, frame: AdmittedFrame) -> bool:
        """Whether the lane looks like road, as far as vehicles are not found by themselves."""
        camera = frame.camera
        if camera.free_lane is None or camera.horizon is None:
            return False
        if not camera.horizon.is_sharp(frame.image, self.lane.shape):
            return False
        free_m = camera.free_lane.free_until_m(frame.image, self.lane.shape)
        return free_m >= self._free_widths * self._lane_width_m

    def _outline(self, track: VehicleTrack, perspective: Perspective) -> ImageBox:
        """Part of the image in which the vehicle may hide the road."""
        lane_m = self._lane_width_m
        ahead_m, right_m = max(track.ahead.position_m, 0.1 * lane_m), track.right.position_m
        half_m, height_m = VEHICLE_SIZE[0] * lane_m / 2, VEHICLE_SIZE[1] * lane_m
        corners = [
            RoadPosition(ahead_m, right_m - half_m, height_m),
            RoadPosition(ahead_m, right_m + half_m, 0.0),
        ]
        return bounding_box(np.asarray(perspective.project_all(corners), np.float32))
