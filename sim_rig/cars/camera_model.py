"""What vision would have said, without drawing pictures: the camera of virtual runs."""

from collections import deque

import numpy as np

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
from onboard.vision.settings import VisionSettings
from sim_rig.cars.camera_track import (
    PLATE_HEIGHT_M,
    PLATE_OVER_ROAD_M,
    PLATE_WIDTH_M,
    CameraTrack,
    plate_width_px,
)
from sim_rig.cars.camera_view import FPS, LENS, CameraView
from sim_rig.rendering.scene import SceneCar

Observation = Plate | Lead | VehicleDetection | SensorLost | SensorRecovered | Discarded

LATENCY_S = 0.025
"""From the moment that the picture shows to what vision says of it; the car stamps it in between,
`STAMP_S` after that moment."""
STAMP_S = 0.010
ENTER, LEAVE = 0.35, 0.55
"""A car is in the own lane up to so many lane widths from its middle."""
BLINK_S = 0.4
"""A lead unseen for so long is not given up for one beyond it."""
GAP_SIGMA, CLOSING_SIGMA_M_S = 0.03, 1.0
"""What vision states of its own errors, roughly."""


class CameraModel:
    """The camera and the vision of one car."""

    def __init__(
        self, view: CameraView, settings: VisionSettings, phase_s: float, rng: np.random.Generator
    ) -> None:
        """Take the first picture at `phase_s`."""
        self._view = view
        self._settings = settings
        self._rng = rng
        self._picture_at = phase_s
        self._changed_at = phase_s
        self._is_lost = False
        self._seen: dict[str, CameraTrack] = {}
        self._tracks = 0
        self._in_lane: set[str] = set()
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
            self._events.append(SensorRecovered(stamp_s, Sensor.CAMERA))
        found = self._find(picture_at, stamp_s)
        lead = self._lead(stamp_s)
        for name, car in found:
            seen = self._seen[name]
            self._events.append(Plate(stamp_s, _box(car), *seen.last_read, is_lead=seen is lead))
            if seen.is_confirmed:
                self._events.append(seen.sensed(stamp_s))
        self._tell(lead, stamp_s)

    def _repeat(self, stamp_s: float) -> None:
        """As `Sight` does: the same picture says nothing, and after a while that it is stuck."""
        silent_s = stamp_s - self._changed_at
        if silent_s <= self._settings.frozen_s:
            self._tell(self._lead(stamp_s), stamp_s)
        elif not self._is_lost:
            self._is_lost = True
            self._events.append(SensorLost(stamp_s, Sensor.CAMERA, silent_s, "frozen"))

    def _find(self, picture_at: float, stamp_s: float) -> list[tuple[str, SceneCar]]:
        """The cars whose plates are found in this picture."""
        found: list[tuple[str, SceneCar]] = []
        nearer: list[SceneCar] = []
        for name, car in self._view.cars(picture_at):
            if (
                not car.is_turned
                and _is_in_picture(car)
                and not any(_hides(other, car) for other in nearer)
            ):
                if name not in self._seen:
                    self._tracks += 1
                    self._seen[name] = CameraTrack(self._tracks, self._settings, self._rng)
                if self._seen[name].look(car, stamp_s):
                    found.append((name, car))
            nearer.append(car)
        return found

    def _lead(self, stamp_s: float) -> CameraTrack | None:
        """The nearest car in the own lane, as vision chooses it; old ones are forgotten."""
        horizon_s = stamp_s - self._settings.keep_s
        for name in [name for name, seen in self._seen.items() if seen.seen_at < horizon_s]:
            del self._seen[name]
        inside = {
            name: seen
            for name, seen in self._seen.items()
            if seen.is_confirmed and abs(seen.right_m) <= self._limit_m(name)
        }
        self._in_lane = set(inside)
        fresh = [seen for seen in inside.values() if stamp_s - seen.seen_at <= BLINK_S]
        return min(fresh or inside.values(), key=lambda seen: seen.gap_m(stamp_s), default=None)

    def _limit_m(self, name: str) -> float:
        share = LEAVE if name in self._in_lane else ENTER
        return share * self._settings.lane_width_m

    def _tell(self, lead: CameraTrack | None, stamp_s: float) -> None:
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
                gap_sigma_m=GAP_SIGMA * gap_m,
                closing_speed_m_s=lead.closing_speed_m_s,
                closing_speed_sigma_m_s=CLOSING_SIGMA_M_S,
            )
        )


def _u_px(car: SceneCar) -> float:
    """Where its plate is, to the right of the middle of the picture."""
    return LENS.focal_x_px * car.lateral_m / car.ahead_m


def _v_px(car: SceneCar) -> float:
    """Where its plate is, below the middle of the picture, for a small pitch."""
    drop_m = LENS.mounting_height_m - PLATE_OVER_ROAD_M
    return LENS.focal_y_px * (drop_m / car.ahead_m - LENS.pitch_rad)


def _is_in_picture(car: SceneCar) -> bool:
    inside_u = abs(_u_px(car)) + plate_width_px(car) / 2 < LENS.width_px / 2
    return inside_u and abs(_v_px(car)) < LENS.height_px / 2


def _hides(nearer: SceneCar, car: SceneCar) -> bool:
    """Whether one car is before the plate of another."""
    if not nearer.is_turned:
        half_px = (LENS.focal_x_px * nearer.width_m / nearer.ahead_m + plate_width_px(car)) / 2
        return abs(_u_px(nearer) - _u_px(car)) < half_px
    corners = nearer.corners()
    if min(ahead for ahead, _ in corners) <= 0.0:
        return False
    u_px = [LENS.focal_x_px * right / ahead for ahead, right in corners]
    half_px = plate_width_px(car) / 2
    return min(u_px) - half_px < _u_px(car) < max(u_px) + half_px


def _box(car: SceneCar) -> ImageBox:
    width_px = plate_width_px(car)
    height_px = width_px if car.tag_id is not None else width_px * PLATE_HEIGHT_M / PLATE_WIDTH_M
    left_px = LENS.principal_x_px + _u_px(car) - width_px / 2
    top_px = LENS.principal_y_px + _v_px(car) - height_px / 2
    return ImageBox(left_px, top_px, width_px, height_px)
