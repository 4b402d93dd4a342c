"""The perception core: camera frames to plates, vehicle detections and the lead.

Each frame is checked (`frame_check`) and searched: at fixed periods all of it, otherwise the
regions around tracked vehicles. Detections are associated with tracks (`tracker`), and the lead is
selected among them (`lead`). Networks are handed in (`networks` loads them).
"""

import math
from collections import deque
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from onboard.observations import (
    Discarded,
    ImageBox,
    Lead,
    Plate,
    Sensor,
    SensorLost,
    SensorRecovered,
    VehicleDetection,
)
from onboard.vision import track_report
from onboard.vision.box_model import BoxModel
from onboard.vision.detection import Detection, DetectionKind, SearchPlan, TrackRegion
from onboard.vision.frame_check import FrameCheck
from onboard.vision.free_lane import FreeLane
from onboard.vision.lane import HostLane, LaneMarkingDetector
from onboard.vision.lead import LeadSelector
from onboard.vision.perspective import Perspective, RoadPosition, bounding_box
from onboard.vision.plate_formats import PlateFormats
from onboard.vision.plates import PlateFinder, PlateRecognizer, TextReader
from onboard.vision.rear import RearTracker
from onboard.vision.settings import Calibration, VisionSettings, guessed_calibration
from onboard.vision.syntax import PlateSyntax
from onboard.vision.tags import TagDetector
from onboard.vision.tracker import KEEP_S, Tracker
from onboard.vision.vehicle_detector import VehicleBoxDetector, VehicleDetector
from onboard.vision.vehicle_network import VehicleFinder
from onboard.vision.vehicle_track import VehicleTrack

Event = Plate | Lead | VehicleDetection | Discarded | SensorLost | SensorRecovered
COMPONENT = "vision"
CALIBRATED_SLOPE, GUESSED_SLOPE = 0.04, 0.15
"""Error of heights above the road, as a share of the distance: by pitching and the slope of the
road; and with a camera whose mounting is not calibrated."""
GUESSED_LENS_SIGMA = 0.5
"""Relative sigma of distances and speeds without a calibrated lens: cameras in cars see 35 to 120
degrees, which is 1.8 to 0.33 times the assumed focal length."""
MAX_TRACKED_PER_FRAME = 2
"""Tracks that are searched in one frame; more are searched in turn."""
OTHERS_PERIOD_S = 0.19
"""Time between two searches for a track that is not the lead, or for the plate of a vehicle: five a
second at 15 or 30 frames."""
FREE_S = 0.5
"""Time for which a lane that was seen to be free counts as free."""
FREE_WIDTHS, FREE_WIDTHS_WITH_VEHICLES = 14.0, 3.5
"""Distance in lane widths up to which a lane must look like road to be free (49 m), and the same
with a detector of vehicles, which finds those beyond (12 m)."""
VEHICLE_SIZE = (0.7, 0.6)
"""Width and height of the part of the image that hides the road, in lane widths: 2.4 by 2.1 m."""
REAR_SIZE, REAR_ABOVE = (0.4, 0.27), 0.7
"""Width and height of a vehicle's rear, in lane widths (1.4 by 0.95 m), and the share of the height
that is above the plate."""
INNER_FROM_PX, INNER_REAR = 48.0, 0.9
"""Width of a rear without a plate from which it has enough corners by itself, and the share of its
sides, around its middle, in which no road is seen."""
SMALLEST_PX, LARGEST_PX = 64, 8192
"""Sides of a frame."""


@dataclass(frozen=True, slots=True)
class PerceptionParameters:
    """Periods that are not settings: they were measured on rendered drives and photographs."""

    search_period_s: float = 0.5
    """Between two searches of the whole frame while there is a lead."""
    search_period_without_lead_s: float = 0.2
    """The same while there is none, or of the search for vehicles where they are found as such."""
    read_period_s: float = 0.5
    """Between two readings of a plate; the lead's is read in every frame until it is identified."""
    read_period_identified_s: float = 1.0
    """The same of an identified plate whose last reading agreed."""
    frozen_after_s: float = 0.6
    """Repeats of one image for longer than this are a lost camera."""


DEFAULT_PARAMETERS = PerceptionParameters()


@dataclass(frozen=True, slots=True)
class Networks:
    """The networks to run; `None` leaves that kind of detection out."""

    plate_finder: PlateFinder | None = None
    plate_reader: TextReader | None = None
    vehicle_model: VehicleFinder | BoxModel | None = None


class Detector(Protocol):
    """Detects vehicles by one kind of feature: plate, tag or whole vehicle."""

    def find(self, image: npt.NDArray[np.uint8], plan: SearchPlan) -> list[Detection]:
        """Detections in an (h, w, 3) BGR image, in the regions of `plan`."""
        ...


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
            networks: loaded from what `settings` name.
            parameters: periods and timeouts.
        """
        self._settings = settings
        self._parameters = parameters
        self._networks = networks
        self._calibration = calibration
        self._frame_check = FrameCheck()
        self._detectors: list[Detector] = []
        self._size_px = (0, 0)
        self._syntax = PlateSyntax(settings.plate_patterns)
        self._formats = PlateFormats(settings.plate_width_m)
        has_mounting = calibration is not None and calibration.has_mounting
        self._slope = CALIBRATED_SLOPE if has_mounting else GUESSED_SLOPE
        has_lens = calibration is not None and calibration.has_lens
        self._lens_sigma = 0.0 if has_lens else GUESSED_LENS_SIGMA
        self._tracker = Tracker(settings.lane_width_m, slope=self._slope, formats=self._formats)
        self._lane = HostLane(settings.lane_width_m)
        self._finds_vehicles = networks.vehicle_model is not None
        self._lead_selector = LeadSelector(self._lane, needs_vehicle=self._finds_vehicles)
        self._markings: LaneMarkingDetector | None = None
        self._free_lane: FreeLane | None = None
        self._free_at = -math.inf
        """Stamp of the last frame in which the lane was seen to be free."""
        self._road: ImageBox | None = None
        self._stamp_s = -math.inf
        self._searched_at = self._vehicles_at = -math.inf
        self._changed_at = -math.inf
        """Stamp of the last frame that was no repeat."""
        self._frozen = False
        self._lead: VehicleTrack | None = None
        self._rear = RearTracker()
        self._events: deque[Event] = deque()

    def next_event(self) -> Event | None:
        """The oldest event not yet taken."""
        return self._events.popleft() if self._events else None

    def reset(self) -> None:
        """Drop all tracks and stamps: the next frame is of another drive."""
        self._frame_check = FrameCheck()
        self._stamp_s = self._searched_at = self._vehicles_at = self._free_at = -math.inf
        self._drop_tracks()

    def _drop_tracks(self) -> None:
        self._tracker.tracks.clear()
        self._lead, self._rear = None, RearTracker()

    def receive_frame(self, image: npt.NDArray[np.uint8], stamp_s: float) -> None:
        """Process one frame, (h, w, 3) uint8 BGR; an empty array is one that did not decode."""
        if stamp_s <= self._stamp_s:
            self._discard(stamp_s, "old_frame", f"not after {self._stamp_s:.3f} s")
            return
        verdict = self._frame_check.check(image)
        if verdict.fault is not None:
            self._discard(stamp_s, verdict.fault, verdict.detail)
            return
        if not self._adapt_to_size(image.shape[1], image.shape[0]):
            self._discard(stamp_s, "frame_size", self._size_detail(image.shape[1], image.shape[0]))
            return
        self._stamp_s = stamp_s
        if verdict.is_repeat:
            self._receive_repeat(stamp_s)
            return
        if stamp_s - self._changed_at > KEEP_S:
            self._drop_tracks()  # other vehicles may have taken their positions meanwhile
        self._changed_at = stamp_s
        if self._frozen:
            self._frozen = False
            self._events.append(SensorRecovered(stamp_s, Sensor.CAMERA))
        self._track_rear(image, stamp_s)
        detections = self._detect(image, stamp_s, everywhere=verdict.is_cut)
        if verdict.has_sky_below:
            self._free_at = -math.inf
        pairs = self._tracker.receive_detections(detections, stamp_s)
        for track in self._tracker.tracks:
            if track.observed_at == stamp_s:
                box = bounding_box(track.corners_px)
                track.still_in_picture.receive_frame(image, box, stamp_s)
        self._report(pairs, stamp_s)
        self._set_rear_reference(image, stamp_s)

    def _receive_repeat(self, stamp_s: float) -> None:
        """Report the predicted lead, and after `frozen_after_s` the loss of the camera."""
        silent_s = stamp_s - self._changed_at
        if silent_s <= self._parameters.frozen_after_s:
            self._report(self._tracker.receive_detections([], stamp_s), stamp_s)
        elif not self._frozen:
            self._frozen = True
            self._events.append(SensorLost(stamp_s, Sensor.CAMERA, silent_s, "frozen"))

    def _discard(self, stamp_s: float, reason: str, detail: str) -> None:
        self._events.append(Discarded(stamp_s, COMPONENT, reason, detail))

    def _track_rear(self, image: npt.NDArray[np.uint8], stamp_s: float) -> None:
        """Update the lead's track by where its rear is in this frame, and by its scale."""
        lead = self._lead
        scale_change = self._rear.track(image)
        if lead is None or scale_change is None:
            return
        lead.predict(stamp_s)
        lead.corners_px = scale_change.moved(lead.corners_px)
        position = self._perspective.locate_upright(lead.corners_px, 1.0)
        lead.receive_scale_change(scale_change, position.right_m / position.ahead_m, stamp_s)

    def _set_rear_reference(self, image: npt.NDArray[np.uint8], stamp_s: float) -> None:
        """Take the lead's rear in this frame as the reference for the next one."""
        lead = self._lead
        if lead is None or lead.observed_at < stamp_s:
            self._rear = RearTracker()
            return
        lead.rear_tracked_at = stamp_s
        found = bounding_box(lead.corners_px)
        x_px, y_px = found.centre_px
        is_bare = lead.last.kind is DetectionKind.VEHICLE
        if is_bare and found.w_px >= INNER_FROM_PX:
            width_px, height_px = INNER_REAR * found.w_px, INNER_REAR * found.h_px
            inner = ImageBox(x_px - width_px / 2, y_px - height_px / 2, width_px, height_px)
            self._rear.set_reference(image, inner, None)
            return
        lane_px = self._perspective.width_px(self._settings.lane_width_m, lead.ahead.position_m)
        width_px, height_px = REAR_SIZE[0] * lane_px, REAR_SIZE[1] * lane_px
        left_px, top_px = x_px - width_px / 2, y_px - REAR_ABOVE * height_px
        self._rear.set_reference(image, ImageBox(left_px, top_px, width_px, height_px), found)

    def _detect(
        self, image: npt.NDArray[np.uint8], stamp_s: float, *, everywhere: bool
    ) -> list[Detection]:
        plan = self._next_plan(stamp_s, everywhere=everywhere)
        if plan.has_vehicles and self._markings is not None:
            vehicles = [self._vehicle_outline(track) for track in self._tracker.tracks]
            self._lane.receive_fit(self._markings.find(image, vehicles))
            if self._lead is None and self._sees_free_lane(image):
                self._free_at = stamp_s
        return [found for detector in self._detectors for found in detector.find(image, plan)]

    def _sees_free_lane(self, image: npt.NDArray[np.uint8]) -> bool:
        """Whether the lane looks like road, as far as vehicles are not found by themselves."""
        if self._free_lane is None:
            return False
        needed = FREE_WIDTHS_WITH_VEHICLES if self._finds_vehicles else FREE_WIDTHS
        free_m = self._free_lane.free_until_m(image, self._lane.shape)
        return free_m >= needed * self._settings.lane_width_m

    def _vehicle_outline(self, track: VehicleTrack) -> ImageBox:
        """Part of the image in which the vehicle may hide the road."""
        lane_m = self._settings.lane_width_m
        ahead_m, right_m = max(track.ahead.position_m, 0.1 * lane_m), track.right.position_m
        half_m, height_m = VEHICLE_SIZE[0] * lane_m / 2, VEHICLE_SIZE[1] * lane_m
        corners = [
            RoadPosition(ahead_m, right_m - half_m, height_m),
            RoadPosition(ahead_m, right_m + half_m, 0.0),
        ]
        return bounding_box(np.asarray(self._perspective.project_all(corners), np.float32))

    def _next_plan(self, stamp_s: float, *, everywhere: bool) -> SearchPlan:
        """Regions to search in this frame; marks them as searched."""
        if everywhere or stamp_s - self._searched_at >= self._search_period_s:
            self._searched_at = self._vehicles_at = stamp_s
            if everywhere:  # after a cut the tracks' regions show something else
                return SearchPlan(self._road, vehicles=self._finds_vehicles)
            known = tuple(self._region(track, stamp_s) for track in self._tracker.tracks)
            return SearchPlan(self._road, known=known, vehicles=self._finds_vehicles)
        has_vehicles = stamp_s - self._vehicles_at >= self._vehicles_period_s
        if has_vehicles:
            self._vehicles_at = stamp_s
        # The lead in every frame, the others in turn.
        due = (
            track
            for track in self._tracker.tracks
            if stamp_s - track.searched_at >= self._period_s(track)
        )
        order = sorted(due, key=lambda track: (track is not self._lead, track.searched_at))
        return SearchPlan(
            tracked=tuple(
                self._next_region(track, stamp_s) for track in order[:MAX_TRACKED_PER_FRAME]
            ),
            vehicles=has_vehicles,
        )

    @property
    def _search_period_s(self) -> float:
        """Between two searches of the whole frame: plates are searched on vehicles in between."""
        if self._lead is None and not self._finds_vehicles:
            return self._parameters.search_period_without_lead_s
        return self._parameters.search_period_s

    @property
    def _vehicles_period_s(self) -> float:
        """Between two searches for vehicles: one without a plate is found by them only."""
        has_plate = self._lead is not None and self._lead.last.kind is not DetectionKind.VEHICLE
        if has_plate or not self._finds_vehicles:
            return self._search_period_s
        return self._parameters.search_period_without_lead_s

    def _period_s(self, track: VehicleTrack) -> float:
        """Time between two searches for a track; vehicles are found in all of the image only."""
        is_urgent = track is self._lead or not track.confirmed
        is_urgent &= track.last.kind is not DetectionKind.VEHICLE
        return 0.0 if is_urgent else OTHERS_PERIOD_S

    def _next_region(self, track: VehicleTrack, stamp_s: float) -> TrackRegion:
        region = self._region(track, stamp_s)
        track.searched_at = stamp_s
        return region

    def _region(self, track: VehicleTrack, stamp_s: float) -> TrackRegion:
        return TrackRegion(
            kind=track.last.kind,
            corners_px=track.corners_px,
            region=_around(track, stamp_s),
            was_detected=track.detected_at >= track.searched_at,
            read_text=self._is_to_read(track, stamp_s),
            views=track.views,
        )

    def _is_to_read(self, track: VehicleTrack, stamp_s: float) -> bool:
        """Whether the plate's next reading is due."""
        parameters = self._parameters
        if track.text is None and track is self._lead:
            return True
        is_identified = track.text is not None and not track.is_contradicted
        period_s = (
            parameters.read_period_identified_s if is_identified else parameters.read_period_s
        )
        return stamp_s - track.read_at >= period_s

    def _size_detail(self, width_px: int, height_px: int) -> str:
        expected = self._calibration
        shape = f", calibrated for {expected.width_px} x {expected.height_px}" if expected else ""
        return f"{width_px} x {height_px} px{shape}"

    def _adapt_to_size(self, width_px: int, height_px: int) -> bool:
        """Scale the calibration to the size of the frames; `False` where that is impossible."""
        if (width_px, height_px) == self._size_px:
            return True
        if not SMALLEST_PX <= min(width_px, height_px) <= max(width_px, height_px) <= LARGEST_PX:
            return False
        calibration = (
            self._calibration.for_size(width_px, height_px)
            if self._calibration is not None
            else guessed_calibration(width_px, height_px)
        )
        if calibration is None:
            return False
        self._scale_tracks(width_px, height_px)
        self._size_px = (width_px, height_px)
        perspective = self._perspective = Perspective(calibration)
        if self._calibration is not None:
            self._markings = LaneMarkingDetector(perspective, self._settings.lane_width_m)
            if self._calibration.has_mounting:
                self._free_lane = FreeLane(perspective, self._settings.lane_width_m)
            self._road = _below_horizon(perspective, self._slope, width_px, height_px)
        self._detectors = self._detectors_for(perspective)
        return True

    def _detectors_for(self, perspective: Perspective) -> list[Detector]:
        settings, networks = self._settings, self._networks
        detectors: list[Detector] = []
        if settings.tag_dictionary is not None:
            tags = TagDetector(settings.tag_dictionary, settings.tag_side_m, perspective)
            detectors.append(tags)
        if networks.plate_finder is not None and networks.plate_reader is not None:
            plates = PlateRecognizer(
                networks.plate_finder,
                networks.plate_reader,
                self._syntax,
                perspective,
                self._formats,
            )
            detectors.append(plates)
        if isinstance(networks.vehicle_model, VehicleFinder):
            detectors.append(VehicleDetector(networks.vehicle_model, perspective))
        elif networks.vehicle_model is not None and settings.vehicle_model is not None:
            every_n_frames = settings.vehicle_model.every_n_frames
            detectors.append(
                VehicleBoxDetector(networks.vehicle_model, every_n_frames, perspective)
            )
        return detectors

    def _scale_tracks(self, width_px: int, height_px: int) -> None:
        """Convert the tracks' pixels to the new size; that is no change of scale of a rear."""
        self._rear = RearTracker()
        for track in self._tracker.tracks:
            scaled = track.corners_px * np.divide((width_px, height_px), self._size_px)
            track.corners_px = scaled.astype(np.float32)

    def _report(self, pairs: list[tuple[Detection, VehicleTrack | None]], stamp_s: float) -> None:
        lead = self._lead_selector.select(self._tracker.tracks, stamp_s)
        if lead is not self._lead:
            self._lead, self._rear = lead, RearTracker()
        for detection, track in pairs:
            if detection.kind is not DetectionKind.VEHICLE:
                is_lead = lead is not None and track is lead and lead.has_settled
                self._events.append(track_report.plate(detection, track, stamp_s, is_lead=is_lead))
        for track in self._tracker.tracks:
            if track.confirmed and track.detected_at == stamp_s:
                self._events.append(
                    track_report.vehicle_detection(track, stamp_s, self._lens_sigma)
                )
        if lead is not None and lead.has_settled:
            self._events.append(track_report.lead(lead, stamp_s, self._lens_sigma))
            return
        is_free = (
            lead is None
            and stamp_s - self._free_at <= FREE_S
            and not self._lead_selector.has_candidate(self._tracker.tracks, stamp_s)
        )
        self._events.append(track_report.without_lead(stamp_s, is_free=is_free))


def _below_horizon(
    perspective: Perspective, slope: float, width_px: int, height_px: int
) -> ImageBox:
    """Part of the image in which plates can be: below a line a little above the horizon."""
    _, horizon_px = perspective.project(RoadPosition(1e6, 0.0, 0.0))
    top_px = float(np.clip(horizon_px - slope * perspective.width_px(1.0, 1.0), 0, height_px / 2))
    # The detector shrinks it by 2 and 8: whole multiples are averaged many times faster.
    rows_px = min(8 * math.ceil((height_px - top_px) / 8), height_px)
    return ImageBox(0.0, height_px - rows_px, width_px, rows_px)


def _around(track: VehicleTrack, stamp_s: float) -> ImageBox:
    """Region of a track's plate: a plate's width to each side, wider the older its observation.

    That of a vehicle without a plate is its rear.
    """
    box = bounding_box(track.corners_px)
    if track.last.kind is DetectionKind.VEHICLE:
        return box
    reach_px = box.w_px * (1.0 + 2.0 * (stamp_s - track.observed_at)) + 12.0
    return ImageBox(
        box.x_px - reach_px, box.y_px - reach_px, box.w_px + 2 * reach_px, box.h_px + 2 * reach_px
    )
