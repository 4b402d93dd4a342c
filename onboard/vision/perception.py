"""What the camera tells: plates, the car ahead in the own lane, and all cars in view.

The core of the room. Each frame is checked, searched (the whole picture now and then, otherwise
the regions around what is tracked), its sightings are matched to the cars that are tracked, and
the lead is chosen among them.
"""

import math
from collections import deque
from typing import Protocol

import numpy as np
import numpy.typing as npt

from onboard.observations import (
    Discarded,
    ImageBox,
    Lead,
    LeadIdentity,
    Plate,
    Sensor,
    SensorLost,
    SensorRecovered,
    VehicleDetection,
)
from onboard.vision.box_model import BoxModel
from onboard.vision.car_track import CarTrack
from onboard.vision.external_plate_detector import BroughtPlates
from onboard.vision.frame_check import PictureCheck
from onboard.vision.lane import MarkingFinder, OwnLane
from onboard.vision.lead import LeadChoice
from onboard.vision.perspective import Perspective, RoadPosition, bounding_box
from onboard.vision.plate_detector import PlateDetector
from onboard.vision.plate_formats import PlateKinds
from onboard.vision.plate_observation import Cue, Followed, Search, Sighting
from onboard.vision.plate_reader import PlateReader
from onboard.vision.plates import LEAST_TEXT_CONFIDENCE, PlateFinder, Plates, TextReader
from onboard.vision.rear import Rear
from onboard.vision.settings import Calibration, VisionSettings, guessed_calibration
from onboard.vision.syntax import PlateSyntax
from onboard.vision.tags import TagFinder
from onboard.vision.tracker import Tracker
from onboard.vision.vehicle_detector import VehicleDetector

Event = Plate | Lead | VehicleDetection | Discarded | SensorLost | SensorRecovered
ROOM = "vision"
CALIBRATED_SLOPE, GUESSED_SLOPE = 0.04, 0.15
"""How far the car pitches and the road climbs, and how far a camera may be off of which nobody said
how it is mounted: so much, by distance, things may be above and below where they belong."""
GUESSED_LENS_SIGMA = 0.5
"""Of every distance and speed where nobody said what the lens is like, as a share of it: cameras in
cars see 35 to 120 degrees, which is 1.8 to 0.33 times what is guessed."""
MOST_FOLLOWED = 2
"""Cars looked for in one frame; more are looked for in turn."""
OTHERS_EVERY_S = 0.19
"""Who is not the lead is looked for this often, five times a second at 15 or 30 frames."""
CAR_SIZE = (0.7, 0.6)
"""Width and height of what hides the road, in lane widths: 2.4 by 2.1 m."""
REAR_SIZE, REAR_ABOVE = (0.4, 0.27), 0.7
"""What of a car is its rear, in lane widths (1.4 by 0.95 m), and how much of it above the plate."""
SMALLEST_PX, LARGEST_PX = 64, 8192
"""Sides of a picture."""


class Finder(Protocol):
    """Finds one kind of cue."""

    def find(self, image: npt.NDArray[np.uint8], search: Search) -> list[Sighting]:
        """Cues in the picture, where `search` says."""
        ...


class Perception:
    """From frames to observations."""

    def __init__(
        self,
        calibration: Calibration | None,
        settings: VisionSettings,
        *,
        finder: PlateFinder | None = None,
        reader: TextReader | None = None,
    ) -> None:
        """Load what the settings ask for.

        Args:
            calibration: the camera's; `None` guesses one, and distances are rough.
            settings: what to look for.
            finder: finds plates, in the place of the detector that comes with the package.
            reader: reads them, in the place of the reader that comes with the package.
        """
        self._settings = settings
        self._calibration = calibration
        self._check = PictureCheck()
        self._finders: list[Finder] = []
        self._size_px = (0, 0)
        self._syntax = PlateSyntax(settings.plate_patterns)
        if settings.plates:
            self._finder = finder or _plate_finder(settings)
            self._reader = reader or PlateReader(syntax=self._syntax)
        if settings.vehicle_model is not None:
            self._vehicle_model = BoxModel(settings.vehicle_model, "vision.vehicle_model")
        self._kinds = PlateKinds(settings.plate_width_m)
        is_placed = calibration is not None and calibration.is_placed
        self._slope = CALIBRATED_SLOPE if is_placed else GUESSED_SLOPE
        has_lens = calibration is not None and calibration.has_lens
        self._lens_sigma = 0.0 if has_lens else GUESSED_LENS_SIGMA
        self._tracker = Tracker(
            settings.lane_width_m,
            settings.keep_s,
            settings.keep_unread_s,
            settings.identity_confidence,
            slope=self._slope,
            kinds=self._kinds,
        )
        self._lane = OwnLane(settings.lane_width_m)
        self._choice = LeadChoice(self._lane)
        self._markings: MarkingFinder | None = None
        self._road: ImageBox | None = None
        self._stamp_s = -math.inf
        self._searched_at = -math.inf
        self._changed_at = -math.inf
        """When it last saw something new."""
        self._frozen = False
        self._lead: CarTrack | None = None
        self._rear = Rear()
        self._events: deque[Event] = deque()

    def next_event(self) -> Event | None:
        """The oldest event not yet taken."""
        return self._events.popleft() if self._events else None

    def forget(self) -> None:
        """What comes next shows another place and time."""
        self._check = PictureCheck()
        self._stamp_s = self._searched_at = -math.inf
        self._forget_cars()

    def _forget_cars(self) -> None:
        self._tracker.tracks.clear()
        self._lead, self._rear = None, Rear()

    def receive_frame(self, image: npt.NDArray[np.uint8], stamp_s: float) -> None:
        """Look at one frame, (h, w, 3) uint8 BGR; an empty array is one that did not decode."""
        if stamp_s <= self._stamp_s:
            self._discard(stamp_s, "old_picture", f"not after {self._stamp_s:.3f} s")
            return
        verdict = self._check.look(image)
        if verdict.fault is not None:
            self._discard(stamp_s, verdict.fault, verdict.detail)
            return
        if not self._fit(image.shape[1], image.shape[0]):
            self._discard(stamp_s, "picture_size", self._unlike(image.shape[1], image.shape[0]))
            return
        self._stamp_s = stamp_s
        if verdict.is_repeat:
            self._receive_repeat(stamp_s)
            return
        if stamp_s - self._changed_at > self._settings.keep_s:
            self._forget_cars()  # who comes to be there meanwhile may be another
        self._changed_at = stamp_s
        if self._frozen:
            self._frozen = False
            self._events.append(SensorRecovered(stamp_s, Sensor.CAMERA))
        self._follow_rear(image, stamp_s)
        sightings = self._look(image, stamp_s, everywhere=verdict.is_cut)
        self._show(self._tracker.receive_sightings(sightings, stamp_s), stamp_s)
        self._remember_rear(image, stamp_s)

    def _receive_repeat(self, stamp_s: float) -> None:
        """The same picture again says nothing new, and after a while that the camera is stuck."""
        silent_s = stamp_s - self._changed_at
        if silent_s <= self._settings.frozen_s:
            self._show(self._tracker.receive_sightings([], stamp_s), stamp_s)
        elif not self._frozen:
            self._frozen = True
            self._events.append(SensorLost(stamp_s, Sensor.CAMERA, silent_s, "frozen"))

    def _discard(self, stamp_s: float, reason: str, detail: str) -> None:
        self._events.append(Discarded(stamp_s, ROOM, reason, detail))

    def _follow_rear(self, image: npt.NDArray[np.uint8], stamp_s: float) -> None:
        """Where the lead's rear is now, and how it grew."""
        lead = self._lead
        growth = self._rear.follow(image)
        if lead is None or growth is None:
            return
        lead.predict(stamp_s)
        lead.corners_px = growth.moved(lead.corners_px)
        place = self._perspective.locate_upright(lead.corners_px, 1.0)
        lead.receive_growth(growth, place.right_m / place.ahead_m, stamp_s)

    def _remember_rear(self, image: npt.NDArray[np.uint8], stamp_s: float) -> None:
        """The lead's rear as it is now, for the next frame."""
        lead = self._lead
        if lead is None or lead.present_at < stamp_s:
            self._rear = Rear()
            return
        lead.followed_at = stamp_s
        lane_px = self._perspective.width_px(self._settings.lane_width_m, lead.ahead.position_m)
        width_px, height_px = REAR_SIZE[0] * lane_px, REAR_SIZE[1] * lane_px
        plate = bounding_box(lead.corners_px)
        x_px, y_px = plate.centre_px
        left_px, top_px = x_px - width_px / 2, y_px - REAR_ABOVE * height_px
        self._rear.remember(image, ImageBox(left_px, top_px, width_px, height_px), plate)

    def _look(
        self, image: npt.NDArray[np.uint8], stamp_s: float, *, everywhere: bool
    ) -> list[Sighting]:
        search = self._search(stamp_s, everywhere=everywhere)
        if search.followed is None and self._markings is not None:
            cars = [self._whole_car(track) for track in self._tracker.tracks]
            self._lane.receive_fit(self._markings.find(image, cars))
        return [sighting for finder in self._finders for sighting in finder.find(image, search)]

    def _whole_car(self, track: CarTrack) -> ImageBox:
        """Where the picture shows the car and not the road; generously."""
        lane_m = self._settings.lane_width_m
        ahead_m, right_m = max(track.ahead.position_m, 0.1 * lane_m), track.right.position_m
        half_m, height_m = CAR_SIZE[0] * lane_m / 2, CAR_SIZE[1] * lane_m
        corners = [
            RoadPosition(ahead_m, right_m - half_m, height_m),
            RoadPosition(ahead_m, right_m + half_m, 0.0),
        ]
        return bounding_box(np.asarray(self._perspective.project_all(corners), np.float32))

    def _search(self, stamp_s: float, *, everywhere: bool) -> Search:
        """Where to look in this frame."""
        settings = self._settings
        period_s = (
            settings.search_without_lead_every_s if self._lead is None else settings.search_every_s
        )
        if everywhere or stamp_s - self._searched_at >= period_s:
            self._searched_at = stamp_s
            if everywhere:  # a cut: nothing is where it was
                return Search(self._road)
            read = (t for t in self._tracker.tracks if not self._is_to_read(t, stamp_s))
            return Search(
                self._road, read_already=tuple(bounding_box(track.corners_px) for track in read)
            )
        # The lead in every frame, the others in turn.
        due = (
            track
            for track in self._tracker.tracks
            if track is self._lead
            or not track.confirmed
            or stamp_s - track.looked_at >= OTHERS_EVERY_S
        )
        order = sorted(due, key=lambda track: (track is not self._lead, track.looked_at))
        return Search(
            followed=tuple(self._follow(track, stamp_s) for track in order[:MOST_FOLLOWED])
        )

    def _follow(self, track: CarTrack, stamp_s: float) -> Followed:
        was_seen = track.seen_at >= track.looked_at
        read_again = self._is_to_read(track, stamp_s)
        track.looked_at = stamp_s
        return Followed(
            track.last.cue, track.corners_px, _around(track, stamp_s), was_seen, read_again
        )

    def _is_to_read(self, track: CarTrack, stamp_s: float) -> bool:
        """The lead until it is known; then, and the others, now and then."""
        settings = self._settings
        if track.text is None and track is self._lead:
            return True
        is_known = track.text is not None and not track.is_doubted
        period_s = settings.read_known_every_s if is_known else settings.read_every_s
        return stamp_s - track.read_at >= period_s

    def _unlike(self, width_px: int, height_px: int) -> str:
        asked = self._calibration
        shape = f", calibrated for {asked.width_px} x {asked.height_px}" if asked else ""
        return f"{width_px} x {height_px} px{shape}"

    def _fit(self, width_px: int, height_px: int) -> bool:
        """Have the lens fit the size of the pictures; whether it can."""
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
        settings = self._settings
        perspective = self._perspective = Perspective(calibration)
        if self._calibration is not None:
            self._markings = MarkingFinder(perspective, settings.lane_width_m)
            self._road = _below_horizon(perspective, self._slope, width_px, height_px)
        self._finders.clear()
        if settings.tag_dictionary is not None:
            tags = TagFinder(settings.tag_dictionary, settings.tag_side_m, perspective)
            self._finders.append(tags)
        if settings.plates:
            plates = Plates(self._finder, self._reader, self._syntax, perspective, self._kinds)
            self._finders.append(plates)
        if settings.vehicle_model is not None:
            model = settings.vehicle_model
            self._finders.append(VehicleDetector(self._vehicle_model, model, perspective))
        return True

    def _scale_tracks(self, width_px: int, height_px: int) -> None:
        """What is followed is where it was, in pixels of another size; nothing grew by that."""
        self._rear = Rear()
        for track in self._tracker.tracks:
            scaled = track.corners_px * np.divide((width_px, height_px), self._size_px)
            track.corners_px = scaled.astype(np.float32)

    def _show(self, pairs: list[tuple[Sighting, CarTrack | None]], stamp_s: float) -> None:
        lead = self._choice.choose(self._tracker.tracks, stamp_s)
        if lead is not self._lead:
            self._lead, self._rear = lead, Rear()
        for sighting, track in pairs:
            if sighting.cue is not Cue.VEHICLE:
                is_lead = lead is not None and track is lead
                self._events.append(_plate(sighting, track, stamp_s, is_lead=is_lead))
        for track in self._tracker.tracks:
            if track.confirmed and track.seen_at == stamp_s:
                self._events.append(_sensed_car(track, stamp_s, self._lens_sigma))
        self._events.append(_lead(lead, stamp_s, self._lens_sigma))


def _plate_finder(settings: VisionSettings) -> PlateFinder:
    own = PlateDetector()
    if settings.plate_model is None:
        return own
    return BroughtPlates(BoxModel(settings.plate_model, "vision.plate_model"), own)


def _below_horizon(
    perspective: Perspective, slope: float, width_px: int, height_px: int
) -> ImageBox:
    """Where plates can be: on the road's side of a line a little above the horizon."""
    _, horizon_px = perspective.project(RoadPosition(1e6, 0.0, 0.0))
    top_px = float(np.clip(horizon_px - slope * perspective.width_px(1.0, 1.0), 0, height_px / 2))
    # The detector shrinks it by 2 and 8: whole multiples are averaged many times faster.
    rows_px = min(8 * math.ceil((height_px - top_px) / 8), height_px)
    return ImageBox(0.0, height_px - rows_px, width_px, rows_px)


def _around(track: CarTrack, stamp_s: float) -> ImageBox:
    """Where the track's plate is looked for: three plates wide and high, and more when unseen."""
    box = bounding_box(track.corners_px)
    reach_px = box.w_px * (1.0 + 2.0 * (stamp_s - track.present_at)) + 12.0
    return ImageBox(
        box.x_px - reach_px, box.y_px - reach_px, box.w_px + 2 * reach_px, box.h_px + 2 * reach_px
    )


def _plate(sighting: Sighting, track: CarTrack | None, stamp_s: float, *, is_lead: bool) -> Plate:
    text, confidence = sighting.text, sighting.confidence
    if track is not None:
        text, confidence = track.text_of(sighting)
    if confidence < LEAST_TEXT_CONFIDENCE:
        text, confidence = None, 0.0
    return Plate(stamp_s, sighting.box, text, confidence, is_lead)


def _sensed_car(track: CarTrack, stamp_s: float, lens_sigma: float) -> VehicleDetection:
    ahead_m, right_m = track.ahead.position_m, track.right.position_m
    range_m, bearing_rad = math.hypot(ahead_m, right_m), math.atan2(right_m, ahead_m)
    return VehicleDetection(
        stamp_s=stamp_s,
        track_id=track.track_id,
        range_m=range_m,
        range_sigma_m=_told_sigma_m(track, range_m, lens_sigma),
        bearing_rad=bearing_rad,
        bearing_sigma_rad=math.hypot(
            track.right.position_sigma_m / range_m, lens_sigma * bearing_rad
        ),
        text=track.text,
    )


def _lead(track: CarTrack | None, stamp_s: float, lens_sigma: float) -> Lead:
    if track is None:
        return Lead(stamp_s, LeadIdentity.NO_LEAD)
    text, ahead = track.text, track.ahead
    return Lead(
        stamp_s=stamp_s,
        identity=LeadIdentity.UNKNOWN if text is None else LeadIdentity.KNOWN,
        text=text,
        gap_m=ahead.position_m,
        gap_sigma_m=_told_sigma_m(track, ahead.position_m, lens_sigma),
        closing_speed_m_s=-ahead.rate_m_s,
        closing_speed_sigma_m_s=math.hypot(ahead.rate_sigma_m_s, lens_sigma * ahead.rate_m_s),
    )


def _told_sigma_m(track: CarTrack, distance_m: float, lens_sigma: float) -> float:
    """With what is wrong with all distances to this car, or in this drive, by one factor."""
    return math.hypot(track.gap_sigma_m, track.size_sigma * distance_m, lens_sigma * distance_m)
