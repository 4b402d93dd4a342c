"""The perception core: camera frames to plates, vehicle detections and the lead.

`Perception.receive_frame` is the list of a frame's steps, each of a file of its own: admission
(`frame_admission`), frozen images (`frozen_camera`), the lead's rear (`lead_rear`), how fast the
vehicle turns (`camera_turn`), what impairs the picture (`picture_watch`), what to search
(`search_schedule`), the lane (`lane_watch`), detection (`sized_camera`), association with tracks
(`tracker`), the lead among them (`lead`) and the report (`track_report`).
"""

from collections import deque

import numpy as np
import numpy.typing as npt

from onboard.observations import Curvature, Discarded, ImageBox
from onboard.vision.camera_turn import CameraTurn
from onboard.vision.detection import Detection
from onboard.vision.frame_admission import AdmittedFrame, FrameAdmission
from onboard.vision.frozen_camera import FrozenCamera
from onboard.vision.lane_watch import LaneWatch
from onboard.vision.lead import LeadSelector
from onboard.vision.lead_rear import LeadRear
from onboard.vision.parameters import DEFAULT_PARAMETERS, PerceptionParameters
from onboard.vision.perspective import Perspective, bounding_box
from onboard.vision.picture_watch import PictureWatch
from onboard.vision.search_schedule import SearchSchedule
from onboard.vision.seen import Event
from onboard.vision.settings import Calibration, VisionSettings
from onboard.vision.sized_camera import Networks, SizedCameras
from onboard.vision.track_report import TrackReport
from onboard.vision.tracker import KEEP_S, Tracker
from onboard.vision.vehicle_track import VehicleTrack


class Perception:
    """Camera frames in, observations out."""

    def __init__(
        self,
        calibration: Calibration | None,
        settings: VisionSettings,
        networks: Networks,
        parameters: PerceptionParameters = DEFAULT_PARAMETERS,
    ) -> None:
        """Start without tracks.

        Args:
            calibration: of the camera; `None` assumes a lens of 60 degrees, and distances are
                rough.
            settings: what to detect.
            networks: loaded from what `settings` name (`onboard.vision.networks`).
            parameters: periods and timeouts.
        """
        lane_m, finds_vehicles = settings.lane_width_m, networks.finds_vehicles
        self._cameras = cameras = SizedCameras(calibration, settings, networks)
        self._admission = FrameAdmission(cameras)
        self._frozen_camera = FrozenCamera(parameters.frozen_after_s)
        self._picture_watch = PictureWatch(lane_m, has_mounting=cameras.has_mounting)
        self._camera_turn = CameraTurn()
        self._rear = LeadRear(lane_m)
        self._schedule = SearchSchedule(parameters, finds_vehicles=finds_vehicles)
        self._lane_watch = LaneWatch(lane_m, finds_vehicles=finds_vehicles)
        self._tracker = Tracker(lane_m, slope=cameras.slope, formats=cameras.formats)
        self._lead_selector = LeadSelector(self._lane_watch.lane, needs_vehicle=finds_vehicles)
        self._track_report = TrackReport(cameras.lens_sigma)
        self._lead: VehicleTrack | None = None
        self._newest: tuple[float, Perspective] | None = None
        """Stamp and perspective of the newest frame that was looked at."""
        self._events: deque[Event] = deque()

    def next_event(self) -> Event | None:
        """The oldest event not yet taken."""
        return self._events.popleft() if self._events else None

    def reset(self) -> None:
        """Drop all tracks and stamps: the next frame is of another drive."""
        self._cameras.reset()
        self._admission.reset()
        self._camera_turn.reset()
        self._picture_watch.reset()
        self._schedule.reset()
        self._lane_watch.reset()
        self._drop_tracks()

    def receive_curvature(self, curvature: Curvature | None) -> None:
        """Take the curvature of the vehicle's path: the lead is the vehicle on it."""
        self._lane_watch.lane.receive_curvature(curvature)

    def receive_duration(self, took_s: float) -> None:
        """Take how long the last frame took: after a search that took long, the next one waits."""
        self._schedule.receive_duration(took_s)

    def receive_frame(self, image: npt.NDArray[np.uint8], stamp_s: float) -> None:
        """Process one frame, (h, w, 3) uint8 BGR; an empty array is one that did not decode."""
        self._newest = None
        admitted = self._admission.admit(image, stamp_s)
        if isinstance(admitted, Discarded):
            self._events.append(admitted)
            return
        self._tracker.receive_size(admitted.camera.size_px)
        if admitted.is_repeat:
            self._receive_repeat(stamp_s)
        else:
            self._receive_new_image(admitted)

    @property
    def vehicles(self) -> tuple[ImageBox, ...]:
        """Where vehicles are in the newest frame, found in it or since all of one was searched.

        The plate or tag of each, or else its rear.
        """
        if self._newest is None:
            return ()
        stamp_s, perspective = self._newest
        return tuple(
            track.box_at(stamp_s, perspective)
            for track in self._tracker.tracks
            if self._lead_selector.is_vehicle(track, stamp_s)
            and track.observed_at >= self._schedule.searched_all_at
        )

    def _receive_repeat(self, stamp_s: float) -> None:
        """Report the predicted lead, or that the camera is lost."""
        self._events += self._frozen_camera.receive_repeat(stamp_s)
        if not self._frozen_camera.is_lost(stamp_s):
            self._report(self._tracker.receive_detections([], stamp_s), stamp_s)

    def _receive_new_image(self, frame: AdmittedFrame) -> None:
        if self._frozen_camera.silent_s(frame.stamp_s) > KEEP_S:
            self._drop_tracks()  # other vehicles may have taken their positions meanwhile
        self._events += self._frozen_camera.receive_new_image(frame.stamp_s)
        self._rear.track(frame, self._lead)
        self._camera_turn.receive_frame(frame)
        self._tracker.receive_turn_rate(self._camera_turn.rate_rad_s)
        self._tracker.follow_crossing(frame.camera.perspective, frame.stamp_s)
        tracks = self._tracker.tracks
        vehicles = [bounding_box(track.corners_px) for track in tracks]
        entering = self._lead_selector.entering(tracks)
        plan = self._schedule.next_plan(frame, tracks, self._lead, entering)
        self._lane_watch.receive_frame(frame, tracks, self._lead, is_searched=plan.looks_ahead)
        detections = frame.camera.detect(frame.image, plan)
        legibility = max((each.confidence for each in detections if each.was_read), default=0.0)
        self._events += self._picture_watch.receive_frame(frame, vehicles, legibility)
        pairs = self._tracker.receive_detections(detections, frame.stamp_s)
        self._tracker.drop_beside(frame.camera.perspective, frame.stamp_s)
        for track in self._tracker.tracks:
            track.receive_image(frame.image, frame.stamp_s)
        self._report(pairs, frame.stamp_s)
        self._newest = frame.stamp_s, frame.camera.perspective
        self._rear.set_reference(frame, self._lead)
        if turn_rad := self._picture_watch.take_turn_rad():
            self._cameras.turn(turn_rad)
            self._tracker.turn(turn_rad)

    def _report(self, pairs: list[tuple[Detection, VehicleTrack | None]], stamp_s: float) -> None:
        """Select the lead, and report it and all else that is seen."""
        tracks = self._tracker.tracks
        self._lead = lead = self._lead_selector.select(tracks, stamp_s)
        self._track_report.picture_sigma = self._picture_watch.range_sigma
        self._track_report.bearing_sigma_rad = self._picture_watch.bearing_sigma_rad
        self._events += self._track_report.plates(pairs, lead, stamp_s)
        found = [
            track
            for track in tracks
            if track.detected_at == stamp_s and self._lead_selector.is_vehicle(track, stamp_s)
        ]
        self._events += self._track_report.vehicle_detections(found, stamp_s)
        may_be_free = lead is None and not self._lead_selector.has_candidate(tracks, stamp_s)
        is_free = may_be_free and self._lane_watch.is_free(stamp_s) and self._picture_watch.is_clear
        self._events.append(self._track_report.lead(lead, stamp_s, is_free=is_free))

    def _drop_tracks(self) -> None:
        self._tracker.tracks.clear()
        self._lead = None
