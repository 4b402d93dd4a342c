"""What is searched in each frame: at fixed periods all of it, otherwise the regions of tracks."""

import math
from collections.abc import Sequence
from dataclasses import replace

from onboard.observations import ImageBox
from onboard.vision.detection import DetectionKind, SearchPlan, TrackRegion
from onboard.vision.frame_admission import AdmittedFrame
from onboard.vision.parameters import PerceptionParameters
from onboard.vision.perspective import bounding_box
from onboard.vision.plate_views import MAX_FRAMES
from onboard.vision.vehicle_track import VehicleTrack

MAX_TRACKED_PER_FRAME = 2
"""Tracks that are searched in one frame; more are searched in turn."""
OTHERS_PERIOD_S = 0.19
"""Time between two searches for a track that is not the lead, or for the plate of a vehicle: five a
second at 15 or 30 frames."""


SEARCH_SHARE, LONGEST_CYCLE_S = 1 / 3, 2.0
"""Share of the time that searches for what is new may take, and the longest time from one of them
to the next: what is followed has the rest of a processor that is slow, or that others have too."""
MAX_REARS_PER_FRAME = 2
"""Rears around which vehicles are searched in one frame, those straight ahead first."""
REAR_PLATES, REAR_SHAPE, PLATE_DOWN = 3.5, 0.85, 0.6
"""Width of a car in European plates, height of its rear by its width, and the plate's place in it,
as a share of the height."""


class SearchSchedule:
    """Plans the searches of one drive after the other."""

    def __init__(self, parameters: PerceptionParameters, *, finds_vehicles: bool) -> None:
        """Start with nothing searched.

        Args:
            parameters: periods.
            finds_vehicles: whether vehicles are detected as such.
        """
        self._parameters = parameters
        self._finds_vehicles = finds_vehicles
        self.reset()

    def reset(self) -> None:
        """Forget what was searched: the next frame is of another drive."""
        self._searched_at = self._vehicles_at = self._rears_at = -math.inf
        self._latest_search: float | None = None
        self._rests_until = -math.inf

    @property
    def searched_all_at(self) -> float:
        """Time of the last search of a whole frame for what is tracked."""
        return self._vehicles_at if self._finds_vehicles else self._searched_at

    def receive_duration(self, took_s: float) -> None:
        """Take how long the last frame took, from its plan on."""
        if self._latest_search is not None:
            cycle_s = min(took_s / SEARCH_SHARE, LONGEST_CYCLE_S)
            self._rests_until = self._latest_search + cycle_s

    def next_plan(
        self,
        frame: AdmittedFrame,
        tracks: list[VehicleTrack],
        lead: VehicleTrack | None,
        entering: Sequence[VehicleTrack] = (),
    ) -> SearchPlan:
        """Regions to search in this frame; marks them as searched.

        Args:
            frame: to search.
            tracks: of all vehicles.
            lead: one of them, if there is one.
            entering: those that come into the lane, of which the texts are needed as soon.
        """
        stamp_s = frame.stamp_s
        urgent = [each for each in (lead, *entering) if each is not None]
        self._latest_search = None
        vehicles = self._vehicle_search(frame, tracks, lead, urgent)
        if frame.is_cut or self._are_plates_due(lead, stamp_s):
            self._searched_at = self._latest_search = stamp_s
            # After a cut, the tracks' regions show something else.
            known = () if frame.is_cut else (self._region(each, urgent, stamp_s) for each in tracks)
            looks_ahead = vehicles.looks_ahead or not self._finds_vehicles
            area = frame.camera.road
            return replace(vehicles, area=area, known=tuple(known), looks_ahead=looks_ahead)
        due = self._due(tracks, urgent, stamp_s)
        regions = tuple(self._region(each, urgent, stamp_s) for each in due)
        for each in due:
            each.searched_at = stamp_s
        return replace(vehicles, tracked=regions)

    def _vehicle_search(
        self,
        frame: AdmittedFrame,
        tracks: list[VehicleTrack],
        lead: VehicleTrack | None,
        urgent: list[VehicleTrack],
    ) -> SearchPlan:
        """What is searched for vehicles: all of the frame, or around the rears that matter."""
        if not self._finds_vehicles:
            return SearchPlan()
        stamp_s = frame.stamp_s
        if frame.is_cut or self._is_due(self._vehicles_at, self._vehicles_period_s(lead), stamp_s):
            self._vehicles_at = self._rears_at = self._latest_search = stamp_s
            return SearchPlan(vehicles=True, finds_vehicles=True, looks_ahead=True)
        if not self._is_due(self._rears_at, self._rears_period_s(lead), stamp_s):
            return SearchPlan(finds_vehicles=True)
        self._rears_at = stamp_s
        unsure = [each for each in tracks if _is_unsure(each, urgent)]
        unsure.sort(key=lambda track: (track not in urgent, abs(track.right.position_m)))
        rears = tuple(_rear(each) for each in unsure[:MAX_REARS_PER_FRAME])
        if rears:
            self._latest_search = stamp_s
        return SearchPlan(rears=rears, finds_vehicles=True, looks_ahead=True)

    def _due(
        self, tracks: list[VehicleTrack], urgent: list[VehicleTrack], stamp_s: float
    ) -> list[VehicleTrack]:
        """The urgent ones in every frame, the lead first, the others in turn."""
        due = [each for each in tracks if stamp_s - each.searched_at >= _period_s(each, urgent)]
        due.sort(
            key=lambda track: (track not in urgent[:1], track not in urgent, track.searched_at)
        )
        return due[:MAX_TRACKED_PER_FRAME]

    def _are_plates_due(self, lead: VehicleTrack | None, stamp_s: float) -> bool:
        """Whether the whole frame is: plates are searched on vehicles in between.

        Where the lead has a plate, the frame is searched for plates and for vehicles in turn.
        """
        parameters = self._parameters
        if not self._finds_vehicles:
            is_free = lead is None
            period_s = (
                parameters.search_period_without_lead_s if is_free else parameters.search_period_s
            )
            return self._is_due(self._searched_at, period_s, stamp_s)
        is_in_turn = not _has_plate(lead) or (
            stamp_s - self._vehicles_at >= parameters.search_period_s
        )
        return is_in_turn and self._is_due(self._searched_at, parameters.seldom_period_s, stamp_s)

    def _is_due(self, latest_s: float, period_s: float, stamp_s: float) -> bool:
        """Whether a period is over, and the pause after the search before, too."""
        return stamp_s - latest_s >= period_s and stamp_s >= self._rests_until

    def _vehicles_period_s(self, lead: VehicleTrack | None) -> float:
        """Between two searches of the whole frame: one without a plate is found by them only."""
        parameters = self._parameters
        return parameters.seldom_period_s if _has_plate(lead) else parameters.search_period_s

    def _rears_period_s(self, lead: VehicleTrack | None) -> float:
        """Between two searches around rears."""
        parameters = self._parameters
        return (
            parameters.search_period_s
            if _has_plate(lead)
            else parameters.search_period_without_lead_s
        )

    def _region(
        self, track: VehicleTrack, urgent: list[VehicleTrack], stamp_s: float
    ) -> TrackRegion:
        return TrackRegion(
            kind=track.last.kind,
            corners_px=track.corners_px,
            region=_around(track, stamp_s),
            was_detected=track.detected_at >= track.searched_at,
            read_text=self._is_to_read(track, urgent, stamp_s),
            views=track.views,
        )

    def _is_to_read(self, track: VehicleTrack, urgent: list[VehicleTrack], stamp_s: float) -> bool:
        """Whether the plate's next reading is due."""
        parameters = self._parameters
        if track.text is None and track in urgent:
            has_all = track.views is not None and track.views.frames >= MAX_FRAMES
            return not has_all or stamp_s - track.read_at >= OTHERS_PERIOD_S
        is_identified = track.text is not None and not track.is_contradicted
        period_s = (
            parameters.read_period_identified_s if is_identified else parameters.read_period_s
        )
        return stamp_s - track.read_at >= period_s


def _has_plate(lead: VehicleTrack | None) -> bool:
    """Whether it is followed by its plate or tag."""
    return lead is not None and lead.last.kind is not DetectionKind.VEHICLE


def _is_unsure(track: VehicleTrack, urgent: list[VehicleTrack]) -> bool:
    """Whether it is not known to be a vehicle, or matters and is found as one only."""
    if track.last.kind is DetectionKind.TAG:
        return False
    is_urgent = track in urgent and track.text is None
    return is_urgent or not track.confirmed or track.is_crossing_unsettled


def _rear(track: VehicleTrack) -> ImageBox:
    """The rear of a track's vehicle; around a plate, that of a common car."""
    box = bounding_box(track.corners_px)
    if track.last.kind is DetectionKind.VEHICLE:
        return box
    width_px, height_px = REAR_PLATES * box.w_px, REAR_SHAPE * REAR_PLATES * box.w_px
    x_px, y_px = box.centre_px
    return ImageBox(x_px - width_px / 2, y_px - PLATE_DOWN * height_px, width_px, height_px)


def _period_s(track: VehicleTrack, urgent: list[VehicleTrack]) -> float:
    """Time between two searches for a track; vehicles are found in all of the image only."""
    is_urgent = track in urgent or not track.confirmed
    is_urgent &= track.last.kind is not DetectionKind.VEHICLE
    return 0.0 if is_urgent else OTHERS_PERIOD_S


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
