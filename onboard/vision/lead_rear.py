"""The lead's rear from frame to frame: where it went in the image, and its closing speed.

`rear` tracks any region; this selects the region on the lead, and updates its track.
"""

from onboard.observations import ImageBox
from onboard.vision.detection import DetectionKind
from onboard.vision.frame_admission import AdmittedFrame
from onboard.vision.perspective import Perspective, bounding_box
from onboard.vision.rear import RearTracker
from onboard.vision.vehicle_track import VehicleTrack

REAR_SIZE, REAR_ABOVE = (0.4, 0.27), 0.7
"""Width and height of a vehicle's rear, in lane widths (1.4 by 0.95 m), and the share of the height
that is above the plate."""
INNER_FROM_PX, INNER_REAR = 48.0, 0.9
"""Width of a rear without a plate from which it has enough corners by itself, and the share of its
sides, around its middle, in which no road is seen."""


class LeadRear:
    """Tracks the rear of the lead; another lead, or another size of the frames, begins anew."""

    def __init__(self, lane_width_m: float) -> None:
        """Take the width of the lane, in which sizes are stated."""
        self._lane_width_m = lane_width_m
        self._tracker = RearTracker()
        self._reference: object = None
        """Lead and camera that the reference is of."""

    def track(self, frame: AdmittedFrame, lead: VehicleTrack | None) -> None:
        """Update the lead's track by where its rear is in this frame, and by its scale."""
        if lead is None or self._reference != (lead, frame.camera):
            return
        scale_change = self._tracker.track(frame.image)
        if scale_change is None:
            return
        lead.predict(frame.stamp_s)
        lead.corners_px = scale_change.moved(lead.corners_px)
        position = frame.camera.perspective.locate_upright(lead.corners_px, 1.0)
        lead.receive_scale_change(scale_change, position.right_m / position.ahead_m, frame.stamp_s)

    def set_reference(self, frame: AdmittedFrame, lead: VehicleTrack | None) -> None:
        """Take the lead's rear in this frame as the reference for the next one."""
        if lead is None or lead.observed_at < frame.stamp_s:
            self._reference = None
            return
        self._reference = lead, frame.camera
        lead.rear_tracked_at = frame.stamp_s
        found = bounding_box(lead.corners_px)
        if lead.last.kind is DetectionKind.VEHICLE and found.w_px >= INNER_FROM_PX:
            self._tracker.set_reference(frame.image, _inner(found), None)
        else:
            rear = self._around_plate(found, lead, frame.camera.perspective)
            self._tracker.set_reference(frame.image, rear, found)

    def _around_plate(
        self, plate: ImageBox, lead: VehicleTrack, perspective: Perspective
    ) -> ImageBox:
        lane_px = perspective.width_px(self._lane_width_m, lead.ahead.position_m)
        (x_px, y_px), (width, height) = plate.centre_px, REAR_SIZE
        width_px, height_px = width * lane_px, height * lane_px
        return ImageBox(x_px - width_px / 2, y_px - REAR_ABOVE * height_px, width_px, height_px)


def _inner(rear: ImageBox) -> ImageBox:
    x_px, y_px = rear.centre_px
    width_px, height_px = INNER_REAR * rear.w_px, INNER_REAR * rear.h_px
    return ImageBox(x_px - width_px / 2, y_px - height_px / 2, width_px, height_px)
