"""What vision would have said, without drawing pictures: the camera of virtual runs.

The model takes the place of picture, JPEG, plate detector and plate reader, with the lens and the
rate of the rig's cameras. From there on it is the car's own vision: tracker, vote over frames and
choice of the lead. Each figure below was measured on the rendered path, and
`tests/sim_rig/test_camera_model.py` holds the model against it.
"""

import math
from collections import deque
from collections.abc import Iterator

import numpy as np

from onboard.observations import (
    Discarded,
    Lead,
    LeadIdentity,
    Plate,
    Sensor,
    SensorBack,
    SensorLost,
)
from onboard.vision.car_track import CarTrack
from onboard.vision.lane import OwnLane
from onboard.vision.lead import LeadChoice
from onboard.vision.perspective import Corners, Place
from onboard.vision.settings import VisionSettings
from onboard.vision.sighting import Cue, Sighting
from onboard.vision.tracker import Tracker
from sim_rig.cars.camera_view import FPS, LENS, CameraView
from sim_rig.picture.scene import SceneCar

Observation = Plate | Lead | SensorLost | SensorBack | Discarded

PLATE_WIDTH_M, PLATE_HEIGHT_M = 0.52, 0.11
PLATE_OVER_ROAD_M = 0.6
LATENCY_S = 0.025
"""From the moment that the picture shows to what vision says of it; the car stamps it in between,
`STAMP_S` after that moment."""
STAMP_S = 0.010

WIDTHS_PX = (20.0, 26.0, 32.0, 40.0, 52.0, 70.0, 110.0)
"""Of the plate in the picture, for the tables below; linear in between, constant outside."""
SEEN = (0.0, 0.9, 1.0, 1.0, 1.0, 1.0, 1.0)
"""Part of the frames in which the plate is found."""
READ = (0.0, 0.0, 0.8, 1.0, 1.0, 1.0, 1.0)
"""Part of the found plates that are read, and rightly."""
CONFIDENCE = (0.0, 0.0, 0.7, 0.9, 0.95, 0.98, 0.98)
"""Of a read plate."""
WIDTH_SIGMA_PX = 0.5
"""Of the found width."""
FARTHEST_M = LENS.focal_x_px * PLATE_WIDTH_M / WIDTHS_PX[0]
LEAST_TAG_PX, TAG_SIGMA_PX = 14.0, 0.15
"""Tags are found and read in every frame if they are wider than this; error of their side."""


class CameraModel:
    """The camera and the vision of one car."""

    def __init__(
        self, view: CameraView, settings: VisionSettings, phase_s: float, rng: np.random.Generator
    ) -> None:
        """Take the first picture at `phase_s`."""
        self._view = view
        self._frozen_s = settings.frozen_s
        self._rng = rng
        self._picture_at = phase_s
        self._changed_at = phase_s
        self._is_lost = False
        self._tracker = Tracker(
            settings.lane_width_m, settings.keep_s, settings.identity_confidence
        )
        self._choice = LeadChoice(OwnLane(settings.lane_width_m))
        self._events: deque[Observation] = deque()

    def get_timer(self) -> float:
        """When vision is done with the next picture."""
        return self._picture_at + LATENCY_S

    def handle_timer(self, now: float) -> None:
        """Say what vision says, if it is time."""
        if now < self.get_timer():
            return
        picture_at, self._picture_at = self._picture_at, self._picture_at + 1 / FPS
        stamp_s = picture_at + STAMP_S
        if self._view.is_dark(picture_at):
            self._events.append(Discarded(stamp_s, "vision", "blank_picture", "mean 0, sigma 0.0"))
        elif self._view.is_frozen(picture_at):
            self._repeat(stamp_s)
        else:
            self._look(picture_at, stamp_s)

    def next_event(self) -> Observation | None:
        """The oldest event not yet taken."""
        return self._events.popleft() if self._events else None

    def _look(self, picture_at: float, stamp_s: float) -> None:
        self._changed_at = stamp_s
        if self._is_lost:
            self._is_lost = False
            self._events.append(SensorBack(stamp_s, Sensor.CAMERA))
        self._show(list(self._sightings(picture_at)), stamp_s)

    def _repeat(self, stamp_s: float) -> None:
        """As `Sight` does: the same picture says nothing, and after a while that it is stuck."""
        silent_s = stamp_s - self._changed_at
        if silent_s <= self._frozen_s:
            self._show([], stamp_s)
        elif not self._is_lost:
            self._is_lost = True
            self._events.append(SensorLost(stamp_s, Sensor.CAMERA, silent_s, "frozen"))

    def _show(self, sightings: list[Sighting], stamp_s: float) -> None:
        pairs = self._tracker.receive_sightings(sightings, stamp_s)
        lead = self._choice.choose(self._tracker.tracks, stamp_s)
        for sighting, track in pairs:
            is_lead = lead is not None and track is lead
            self._events.append(
                Plate(stamp_s, sighting.box, sighting.text, sighting.confidence, is_lead)
            )
        self._events.append(_lead(lead, stamp_s))

    def _sightings(self, picture_at: float) -> Iterator[Sighting]:
        near = [car for car in self._view.scene(picture_at).cars if car.ahead_m < FARTHEST_M]
        cars = sorted(near, key=lambda car: car.ahead_m)
        for index, car in enumerate(cars):
            if _is_in_picture(car) and not any(_hides(nearer, car) for nearer in cars[:index]):
                sighting = self._sighting(car)
                if sighting is not None:
                    yield sighting

    def _sighting(self, car: SceneCar) -> Sighting | None:
        # Always the same number of draws: what one car's plate meets is not another's business.
        found, read = self._rng.random(2)
        noise = self._rng.standard_normal()
        is_tag = car.tag_id is not None
        width_m = car.tag_side_m if is_tag else PLATE_WIDTH_M
        width_px = LENS.focal_x_px * width_m / car.ahead_m
        if found >= (width_px > LEAST_TAG_PX if is_tag else table(SEEN, width_px)):
            return None
        is_read = is_tag or read < table(READ, width_px)
        found_px = width_px + noise * (TAG_SIGMA_PX if is_tag else WIDTH_SIGMA_PX)
        ahead_m = car.ahead_m * width_px / found_px
        # What `Plates` and `TagFinder` say of their own errors.
        sigma = (0.15 if is_tag else math.hypot(0.6, 0.012 * found_px)) / found_px
        return Sighting(
            cue=Cue.TAG if is_tag else Cue.PLATE,
            corners_px=_corners_px(car, found_px),
            place=Place(ahead_m, car.lateral_m * ahead_m / car.ahead_m, PLATE_OVER_ROAD_M),
            ahead_sigma_m=ahead_m * sigma,
            right_sigma_m=math.hypot(width_m, car.lateral_m) * sigma,
            text=_text(car) if is_read else None,
            confidence=(1.0 if is_tag else table(CONFIDENCE, width_px)) if is_read else 0.0,
        )


def table(values: tuple[float, ...], width_px: float) -> float:
    """One of the tables above, at a width."""
    return float(np.interp(width_px, WIDTHS_PX, values))


def _text(car: SceneCar) -> str | None:
    return car.plate if car.tag_id is None else f"TAG{car.tag_id}"


def _u_px(car: SceneCar) -> float:
    """Where its plate is, to the right of the middle of the picture."""
    return LENS.focal_x_px * car.lateral_m / car.ahead_m


def _v_px(car: SceneCar) -> float:
    """Where its plate is, below the middle of the picture, for a small pitch."""
    drop_m = LENS.mounting_height_m - PLATE_OVER_ROAD_M
    return LENS.focal_y_px * (drop_m / car.ahead_m - LENS.pitch_rad)


def _is_in_picture(car: SceneCar) -> bool:
    half_plate_px = LENS.focal_x_px * PLATE_WIDTH_M / 2 / car.ahead_m
    inside_u = abs(_u_px(car)) + half_plate_px < LENS.width_px / 2
    return inside_u and abs(_v_px(car)) < LENS.height_px / 2


def _hides(nearer: SceneCar, car: SceneCar) -> bool:
    """Whether the back of one car is before the plate of another."""
    half_px = LENS.focal_x_px * (nearer.width_m / nearer.ahead_m + PLATE_WIDTH_M / car.ahead_m) / 2
    return abs(_u_px(nearer) - _u_px(car)) < half_px


def _corners_px(car: SceneCar, width_px: float) -> Corners:
    u_px = LENS.principal_x_px + _u_px(car)
    v_px = LENS.principal_y_px + _v_px(car)
    height_px = width_px * PLATE_HEIGHT_M / PLATE_WIDTH_M
    left, right = u_px - width_px / 2, u_px + width_px / 2
    top, bottom = v_px - height_px / 2, v_px + height_px / 2
    return np.array([(left, top), (right, top), (right, bottom), (left, bottom)], np.float32)


def _lead(track: CarTrack | None, stamp_s: float) -> Lead:
    if track is None:
        return Lead(stamp_s, LeadIdentity.NO_LEAD)
    return Lead(
        stamp_s=stamp_s,
        identity=LeadIdentity.UNKNOWN if track.text is None else LeadIdentity.KNOWN,
        text=track.text,
        gap_m=track.ahead.position_m,
        gap_sigma_m=track.gap_sigma_m,
        closing_speed_m_s=-track.ahead.rate_m_s,
        closing_speed_sigma_m_s=track.ahead.rate_sigma_m_s,
    )
