"""Model of camera and perception for virtual runs, without rendering."""

import math
from collections import deque
from typing import Protocol

import numpy as np

from onboard.observations import (
    Curvature,
    Discarded,
    Lead,
    LeadIdentity,
    Plate,
    Sensor,
    SensorLost,
    SensorRecovered,
    VehicleDetection,
)
from onboard.vision.detection import DetectionKind
from onboard.vision.lane import HostLane, LaneShape
from onboard.vision.parameters import DEFAULT_PARAMETERS
from onboard.vision.settings import Calibration, VisionSettings
from onboard.vision.tracker import KEEP_S
from sim_rig.cars.camera_projection import CameraProjection
from sim_rig.cars.camera_track import CameraTrack
from sim_rig.cars.camera_view import FPS, LENS
from sim_rig.cars.plate_readings import PlateReadings
from sim_rig.rendering.scene import SceneCar

Observation = Plate | Lead | VehicleDetection | SensorLost | SensorRecovered | Discarded

LATENCY_S = 0.025
"""Delay from the exposure of an image to its observations."""
STAMP_S = 0.010
"""Delay from the exposure of an image to its stamp."""
ENTER, LEAVE = 0.35, 0.55
"""Lateral offset, in lane widths, below which a car enters the host's lane, and above which it
leaves it."""
BLINK_S = 0.4
"""A lead without a detection for this long is still preferred to a farther car."""
CLOSING_SIGMA_M_S = 1.0
"""Typical sigma that perception reports."""


class View(Protocol):
    """The scene in front of a camera; times are s since the start of the run."""

    def cars(self, at_s: float) -> list[tuple[str, SceneCar]]:
        """Cars ahead with their names, the nearest first; called once per frame."""
        ...

    def marked_lane(self, at_s: float) -> LaneShape | None:
        """The host's lane by its lines; `None` without lines."""
        ...

    def is_dark(self, at_s: float) -> bool:
        """Whether the images are black."""
        ...

    def is_frozen(self, at_s: float) -> bool:
        """Whether the camera repeats its last image."""
        ...


class CameraModel:
    """Camera and perception of one car."""

    def __init__(
        self,
        view: View,
        settings: VisionSettings,
        phase_s: float,
        rng: np.random.Generator,
        lens: Calibration = LENS,
        *,
        rate_hz: float = FPS,
    ) -> None:
        """Take the first image at `phase_s`.

        Args:
            view: the scene ahead of the car.
            settings: settings of the car's vision.
            phase_s: time of the first image, s.
            rng: source of the errors.
            lens: of the camera.
            rate_hz: images a second.
        """
        self._rate_hz = rate_hz
        self._view = view
        self._settings = settings
        self._rng = rng
        self._image_at = phase_s
        self._changed_at = phase_s
        self._is_lost = False
        self._projection = CameraProjection(lens)
        self._tracks_by_name: dict[str, CameraTrack] = {}
        self._plates_by_name: dict[str, PlateReadings] = {}
        self._track_count = 0
        self._in_lane: set[str] = set()
        self._lane = HostLane(settings.lane_width_m)
        self._searched_at = -math.inf
        self._events: deque[Observation] = deque()

    def receive_curvature(self, curvature: Curvature | None) -> None:
        """Take the curvature of the car's path, as perception does."""
        self._lane.receive_curvature(curvature)

    def get_timer(self) -> float:
        """Return when the observations of the next image are due."""
        return self._image_at + LATENCY_S

    def handle_timer(self, now: float) -> None:
        """Add the observations of the next image, if it is due."""
        if now < self.get_timer():
            return
        image_at, self._image_at = self._image_at, self._image_at + 1 / self._rate_hz
        stamp_s = image_at + STAMP_S
        if self._view.is_dark(image_at):
            self._events.append(Discarded(stamp_s, "vision", "blank_frame", "mean 0, sigma 0.0"))
        elif self._view.is_frozen(image_at):
            self._repeat(stamp_s)
        else:
            self._process(image_at, stamp_s)

    def next_event(self) -> Observation | None:
        """Return the oldest observation not yet taken; `None` if there is none."""
        return self._events.popleft() if self._events else None

    def _process(self, image_at: float, stamp_s: float) -> None:
        self._changed_at = stamp_s
        if self._is_lost:
            self._is_lost = False
            self._events.append(SensorRecovered(stamp_s, Sensor.CAMERA))
        found = self._detected(image_at, stamp_s)
        if stamp_s - self._searched_at >= DEFAULT_PARAMETERS.search_period_s - 0.5 / self._rate_hz:
            self._searched_at = stamp_s
            self._lane.receive_fit(self._view.marked_lane(image_at))
        lead = self._lead(stamp_s)
        for name, car in found:
            track = self._tracks_by_name[name]
            if track.kind is not DetectionKind.VEHICLE:
                box, is_lead = self._projection.box(car), track is lead
                self._events.append(Plate(stamp_s, box, *track.last_read, is_lead=is_lead))
            if track.is_confirmed:
                self._events.append(track.detection(stamp_s))
        self._report_lead(lead, stamp_s)

    def _repeat(self, stamp_s: float) -> None:
        """Handle a repeated image as perception does: no detections, and later a lost camera."""
        silent_s = stamp_s - self._changed_at
        if silent_s <= DEFAULT_PARAMETERS.frozen_after_s:
            self._report_lead(self._lead(stamp_s), stamp_s)
        elif not self._is_lost:
            self._is_lost = True
            self._events.append(SensorLost(stamp_s, Sensor.CAMERA, silent_s, "frozen"))

    def _detected(self, image_at: float, stamp_s: float) -> list[tuple[str, SceneCar]]:
        """Return the cars that are detected in this image."""
        found: list[tuple[str, SceneCar]] = []
        nearer: list[SceneCar] = []
        for name, car in self._view.cars(image_at):
            if (
                not car.is_turned
                and self._projection.is_in_image(car)
                and not any(self._projection.occludes(other, car) for other in nearer)
                and self._track(name).update(car, stamp_s) is not None
            ):
                found.append((name, car))
            nearer.append(car)
        return found

    def _track(self, name: str) -> CameraTrack:
        if name not in self._tracks_by_name:
            if name not in self._plates_by_name:
                self._plates_by_name[name] = PlateReadings(self._rng, self._rate_hz)
            self._track_count += 1
            self._tracks_by_name[name] = CameraTrack(
                self._track_count,
                self._plates_by_name[name],
                self._projection,
                self._rng,
                self._rate_hz,
                finds_rears=self._settings.detects_vehicles,
            )
        return self._tracks_by_name[name]

    def _lead(self, stamp_s: float) -> CameraTrack | None:
        """Return the track of the lead as perception selects it, after dropping expired tracks."""
        horizon_s = stamp_s - KEEP_S
        for name in [
            name for name, track in self._tracks_by_name.items() if track.seen_at < horizon_s
        ]:
            del self._tracks_by_name[name]
        inside = {
            name: track
            for name, track in self._tracks_by_name.items()
            if track.is_confirmed
            and abs(self._offset_m(track, stamp_s)) <= self._limit_m(name, track, stamp_s)
        }
        self._in_lane = set(inside)
        fresh = [track for track in inside.values() if stamp_s - track.seen_at <= BLINK_S]
        return min(fresh or inside.values(), key=lambda track: track.gap_m(stamp_s), default=None)

    def _offset_m(self, track: CameraTrack, stamp_s: float) -> float:
        """Distance to the right of the lane's middle."""
        return track.right_m - self._lane.shape.middle_m(track.gap_m(stamp_s))

    def _limit_m(self, name: str, track: CameraTrack, stamp_s: float) -> float:
        lane_m = self._settings.lane_width_m
        if name not in self._in_lane:
            return ENTER * lane_m
        return LEAVE * lane_m + self._lane.path_sigma_m(track.gap_m(stamp_s))

    def _report_lead(self, lead: CameraTrack | None, stamp_s: float) -> None:
        if lead is None:
            self._events.append(Lead(stamp_s, LeadIdentity.NO_LEAD))
            return
        gap_m = lead.gap_m(stamp_s)
        self._events.append(
            Lead(
                stamp_s=stamp_s,
                identity=LeadIdentity.UNKNOWN if lead.text is None else LeadIdentity.KNOWN,
                text=lead.text,
                gap_m=gap_m,
                gap_sigma_m=lead.gap_sigma_stated * gap_m,
                closing_speed_m_s=lead.closing_speed_m_s,
                closing_speed_sigma_m_s=CLOSING_SIGMA_M_S,
                track_id=lead.track_id,
                candidates=lead.candidates,
            )
        )
