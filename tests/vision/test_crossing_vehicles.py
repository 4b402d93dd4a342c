"""A vehicle that crosses keeps its track; detections are given, at the times of searches."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import pytest
from typing_extensions import override

from onboard.observations import ImageBox, VehicleDetection
from onboard.vision.detection import DetectionKind
from onboard.vision.frames import Image
from onboard.vision.perception import Perception
from onboard.vision.perspective import Perspective, RoadPosition
from onboard.vision.settings import CameraSettings, VisionSettings
from onboard.vision.sized_camera import Networks
from onboard.vision.tracker import Tracker
from onboard.vision.vehicle_finder import VehicleFinder, part_around
from onboard.vision.vehicle_network import VehicleBox, VehicleKind
from sim_rig.rendering.scene import CameraRenderer, Scene
from tests.vision.test_lead import LANE_M, detection

WIDTH_PX, HEIGHT_PX, FOCAL_PX = 640, 360, 550.0
CAMERA = CameraSettings(
    source="given",
    width_px=WIDTH_PX,
    height_px=HEIGHT_PX,
    focal_x_px=FOCAL_PX,
    focal_y_px=FOCAL_PX,
    principal_x_px=WIDTH_PX / 2,
    principal_y_px=HEIGHT_PX / 2,
    mounting_height_m=1.3,
    pitch_rad=0.02,
)
PERSPECTIVE = Perspective(CAMERA)
FPS = 10.0
EDGE_SIGMA = 0.02
"""Of a box's sides, by its height."""
KMH_50 = 13.9
LONG_M, WIDE_M, HIGH_M = 4.5, 1.8, 1.5


@dataclass(frozen=True)
class Car:
    """The middle of its nearest face at time 0, and how it moves in the camera's coordinates."""

    ahead_m: float
    right_m: float
    ahead_m_s: float = 0.0
    right_m_s: float = 0.0
    is_across: bool = True

    def place(self, at_s: float) -> tuple[float, float]:
        return self.ahead_m + self.ahead_m_s * at_s, self.right_m + self.right_m_s * at_s

    def box(self, at_s: float, rng: np.random.Generator) -> ImageBox | None:
        """What of it a detector finds in the picture, if it is a fifth of the car."""
        ahead_m, right_m = self.place(at_s)
        deep_m, broad_m = (WIDE_M, LONG_M) if self.is_across else (LONG_M, WIDE_M)
        if ahead_m < 2.0:
            return None
        corners = [
            RoadPosition(ahead_m + along_m, right_m + across_m, up_m)
            for along_m in (0.0, deep_m)
            for across_m in (-broad_m / 2, broad_m / 2)
            for up_m in (0.0, HIGH_M)
        ]
        pixels = PERSPECTIVE.project_all(corners)
        (left, top), (right, bottom) = pixels.min(axis=0), pixels.max(axis=0)
        whole_px = right - left
        left, top, right, bottom = rng.normal(
            (left, top, right, bottom), EDGE_SIGMA * (bottom - top)
        )
        left, right = max(left, 0.0), min(right, WIDTH_PX)
        top, bottom = max(top, 0.0), min(bottom, HEIGHT_PX)
        if right - left < whole_px / 5 or bottom - top < 8.0:
            return None
        return ImageBox(float(left), float(top), float(right - left), float(bottom - top))


@dataclass
class GivenCars(VehicleFinder):
    """Finds the cars that are in what is searched as a whole, or cut by the picture's border."""

    cars: Sequence[Car]
    at_s: float = 0.0
    searches: int = 0
    rng: np.random.Generator = field(default_factory=lambda: np.random.default_rng(1))

    @override
    def find(
        self, image: Image, rear: ImageBox | None = None, most_scale: float = math.inf
    ) -> list[VehicleBox]:
        self.searches += 1
        size_px = WIDTH_PX, HEIGHT_PX
        part = (0, 0, *size_px) if rear is None else part_around(rear, size_px)
        boxes = [car.box(self.at_s, self.rng) for car in self.cars]
        return [
            VehicleBox(box, None, VehicleKind.CAR, 0.9)
            for box in boxes
            if box is not None and _is_in(box, part)
        ]


def _is_in(box: ImageBox, part: tuple[int, int, int, int]) -> bool:
    left, _, right, _ = part
    is_cut_at_left = left > 0 and box.x_px < left + 2
    return not is_cut_at_left and not (right < WIDTH_PX and box.x_px + box.w_px > right - 2)


def reports(
    duration_s: float, *cars: Car, picture: Callable[[float], Image] | None = None
) -> list[VehicleDetection]:
    """What perception reports of these cars, before an empty road or in given pictures."""
    given, rng = GivenCars(cars), np.random.default_rng(1)
    settings = VisionSettings(tag_dictionary=None, plates=False, vehicles=True)
    perception = Perception(CAMERA, settings, Networks(vehicle_model=given))
    empty = CameraRenderer(CAMERA).draw(Scene(), rng)
    found = []
    for index in range(round(duration_s * FPS)):
        given.at_s = index / FPS
        if picture is None:
            image = empty.copy()
            image[::7, ::5] = rng.integers(256)  # else it would be the same image again
        else:
            image = picture(given.at_s)
        perception.receive_frame(image, given.at_s)
        while (event := perception.next_event()) is not None:
            if isinstance(event, VehicleDetection):
                found.append(event)
    return found


def half_seen_m(ahead_m: float) -> float:
    """Half of the width that the picture shows at this distance."""
    return ahead_m * WIDTH_PX / 2 / FOCAL_PX


@pytest.mark.parametrize("towards", [1.0, -1.0], ids=["to the right", "to the left"])
@pytest.mark.parametrize("ahead_m", [15.0, 30.0, 50.0])
def test_a_crossing_car_is_one_track_from_half_a_second_on(ahead_m: float, towards: float) -> None:
    begins_m = half_seen_m(ahead_m) + LONG_M / 2
    seen_s = 2 * begins_m / KMH_50
    car = Car(ahead_m, -towards * begins_m, right_m_s=towards * KMH_50)

    # A whole search after it appears comes within 0.5 s.
    later = [each for each in reports(seen_s, car) if each.stamp_s >= 1.0]

    assert len({each.track_id for each in later}) == 1
    assert len(later) >= 2.0 * (seen_s - LONG_M / KMH_50 - 1.0)
    for each in later:
        right_m = each.range_m * math.sin(each.bearing_rad)
        seen_share = right_m / (each.range_m * math.cos(each.bearing_rad))
        assert seen_share == pytest.approx(car.place(each.stamp_s)[1] / ahead_m, abs=0.1)


def test_cars_that_cross_behind_each_other_and_towards_each_other_have_a_track_each() -> None:
    cars = [
        Car(30.0, -19.0, right_m_s=KMH_50),
        Car(30.0, -31.0, right_m_s=KMH_50),
        Car(37.0, 20.0, right_m_s=-0.8 * KMH_50),
    ]

    later = [each for each in reports(3.5, *cars) if each.stamp_s >= 1.0]

    assert len({each.track_id for each in later}) == 3
    for track_id in {each.track_id for each in later}:
        bearings = [each.bearing_rad for each in later if each.track_id == track_id]
        assert bearings in (sorted(bearings), sorted(bearings, reverse=True))


@pytest.mark.parametrize("right_m", [3.5, -3.5])
@pytest.mark.parametrize("is_across", [True, False], ids=["across", "along"])
def test_a_parked_car_that_is_passed_has_one_track(right_m: float, *, is_across: bool) -> None:
    seen = reports(3.0, Car(35.0, right_m, ahead_m_s=-8.0, is_across=is_across))

    assert len(seen) >= 4
    assert len({each.track_id for each in seen}) == 1


def test_only_what_shows_no_rear_is_followed_into_the_next_lane() -> None:
    for may_cross, tracks in ((False, 2), (True, 1)):
        tracker = Tracker(LANE_M)
        for index in range(2):
            found = detection(20.0, LANE_M * index, None, DetectionKind.VEHICLE)
            tracker.receive_detections([replace(found, may_cross=may_cross)], 0.3 * index)

        assert len(tracker.tracks) == tracks
