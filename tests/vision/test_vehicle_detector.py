"""Distance of vehicles by the shipped detector: by width, ground contact, and both."""

import math
from dataclasses import replace

import numpy as np
import pytest
from typing_extensions import override

from onboard.observations import ImageBox
from onboard.vision.detection import Detection, SearchPlan
from onboard.vision.perspective import Perspective, RoadPosition
from onboard.vision.settings import CameraSettings
from onboard.vision.vehicle_detector import LONG_SHAPE, WIDTHS_M, VehicleDetector
from onboard.vision.vehicle_finder import VehicleFinder, overlap
from onboard.vision.vehicle_network import VehicleBox, VehicleKind
from sim_rig.rendering.scene import CameraRenderer, Scene, SceneCar
from tests.vision.drive import CAMERA

_PERSPECTIVE = Perspective(CAMERA)
_IMAGE = np.zeros((CAMERA.height_px, CAMERA.width_px, 3), np.uint8)


class _Finder(VehicleFinder):
    """Finds what it is told."""

    def __init__(self, vehicles: list[VehicleBox]) -> None:
        self.vehicles = vehicles
        self.most_scale = math.inf

    @override
    def find(
        self, image: np.ndarray, rear: ImageBox | None = None, most_scale: float = math.inf
    ) -> list[VehicleBox]:
        self.most_scale = most_scale
        return self.vehicles


def _vehicle(
    ahead_m: float,
    right_m: float = 0.0,
    *,
    kind: VehicleKind = VehicleKind.CAR,
    height_m: float = 1.5,
    side_m: float = 0.0,
) -> VehicleBox:
    """A vehicle as wide as its kind is, and so much of its side to the left of its rear."""
    half_m = WIDTHS_M[kind][0] / 2
    corners = [
        RoadPosition(ahead_m, right_m - half_m, height_m),
        RoadPosition(ahead_m, right_m + half_m, 0.0),
        RoadPosition(ahead_m, right_m - half_m - side_m, 0.0),
    ]
    (end_left, top), (right, bottom), (left, _) = _PERSPECTIVE.project_all(corners).tolist()
    left, top = max(left, 0.0), max(top, 0.0)
    right, bottom = min(right, CAMERA.width_px), min(bottom, CAMERA.height_px)
    box = ImageBox(left, top, right - left, bottom - top)
    return VehicleBox(box, (end_left, right), kind, 0.9)


def _detected(vehicle: VehicleBox) -> Detection:
    detector = VehicleDetector(_Finder([vehicle]), _PERSPECTIVE)
    (found,) = detector.find(_IMAGE, SearchPlan(vehicles=True))
    return found


@pytest.mark.parametrize("kind", list(VehicleKind))
@pytest.mark.parametrize("ahead_m", [8.0, 20.0, 60.0])
def test_a_vehicle_of_common_width_is_where_it_is(kind: VehicleKind, ahead_m: float) -> None:
    found = _detected(_vehicle(ahead_m, 1.0, kind=kind))
    assert found.position.ahead_m == pytest.approx(ahead_m, rel=0.02)
    assert found.position.right_m == pytest.approx(1.0, abs=0.05)
    assert 0.02 * ahead_m < found.ahead_sigma_m < 0.4 * ahead_m


def test_only_the_rear_counts_of_a_vehicle_beside() -> None:
    found = _detected(_vehicle(15.0, -3.5, side_m=1.5))
    assert found.position.ahead_m == pytest.approx(15.0, rel=0.02)
    assert found.position.right_m == pytest.approx(-3.5, abs=0.05)


def test_a_high_vehicle_is_as_low_as_plates_are() -> None:
    found = _detected(_vehicle(20.0, kind=VehicleKind.TRUCK, height_m=4.0))
    assert found.position.height_m == pytest.approx(1.0, abs=0.2)


def test_the_sigma_is_larger_where_the_side_is_seen() -> None:
    rear, side = _detected(_vehicle(20.0)), _detected(_vehicle(20.0, side_m=3.5))
    assert side.ahead_sigma_m > rear.ahead_sigma_m
    assert abs(side.position.ahead_m - 20.0) < 1.5 * side.ahead_sigma_m


def test_a_long_box_without_a_known_rear_shows_the_side() -> None:
    rear, side = (
        replace(vehicle, end_px=None) for vehicle in (_vehicle(20.0), _vehicle(20.0, side_m=1.5))
    )
    assert _detected(side).ahead_sigma_m > _detected(rear).ahead_sigma_m
    assert _detected(rear).position.ahead_m == pytest.approx(20.0, rel=0.02)
    assert _detected(side).position.ahead_m == pytest.approx(20.0, rel=0.15)


@pytest.mark.parametrize("kind", [VehicleKind.CAR, VehicleKind.VAN])
def test_a_box_that_is_hardly_longer_than_a_rear_is_about_as_far(kind: VehicleKind) -> None:
    """A lead leapt from 16 to 29 m when the height of its box shrank by a pixel."""
    seen = replace(_vehicle(20.0, kind=kind), end_px=None)
    rear, longer = (
        _detected(replace(seen, box=replace(seen.box, h_px=seen.box.w_px / shape)))
        for shape in (LONG_SHAPE - 0.05, LONG_SHAPE + 0.05)
    )
    assert abs(longer.position.ahead_m - rear.position.ahead_m) < 2.0 * rear.ahead_sigma_m


def test_width_says_little_at_the_border_of_the_image() -> None:
    whole, cut = _vehicle(6.0), _vehicle(6.0, -3.5)
    assert cut.box.x_px == 0.0
    assert _detected(cut).ahead_sigma_m > _detected(whole).ahead_sigma_m


@pytest.mark.parametrize("ahead_m", [2.5, 3.0, 3.5, 4.0])
def test_gaps_to_rears_that_fill_the_image_are_as_uncertain_as_they_are_wrong(
    ahead_m: float,
) -> None:
    camera = CameraSettings(source="rendered", focal_x_px=1108.0, focal_y_px=1108.0)
    renderer, rng = CameraRenderer(camera), np.random.default_rng(2)
    detector = VehicleDetector(VehicleFinder(), Perspective(camera))
    in_sigmas = []
    for _ in range(4):
        blue, green, red = (int(level) for level in rng.integers(20, 220, 3))
        car = SceneCar(ahead_m, colour_bgr=(blue, green, red), height_m=rng.uniform(1.4, 1.8))
        found = detector.find(renderer.draw(Scene((car,)), rng), SearchPlan(vehicles=True))
        largest = max(found, key=lambda each: each.box.w_px)
        in_sigmas.append((largest.position.ahead_m - ahead_m) / largest.ahead_sigma_m)
    assert np.mean(np.square(in_sigmas)) < 2.5


@pytest.mark.parametrize("pitch_rad", [0.02, 0.04])
def test_a_camera_that_is_pitched_otherwise_does_not_bring_a_far_vehicle_near(
    pitch_rad: float,
) -> None:
    """The lower edge alone would say 39 and 26 m."""
    far = _vehicle(100.0)
    lower = replace(far.box, y_px=far.box.y_px + pitch_rad * CAMERA.focal_y_px)
    found = _detected(replace(far, box=lower))
    assert found.position.ahead_m > 80.0
    assert abs(found.position.ahead_m - 100.0) < 2.0 * found.ahead_sigma_m


def test_what_is_below_the_image_is_no_ground_contact() -> None:
    found = _detected(_vehicle(2.5))
    assert found.position.ahead_m == pytest.approx(2.5, rel=0.02)
    assert found.ahead_sigma_m >= WIDTHS_M[VehicleKind.CAR][1] * found.position.ahead_m


def test_the_network_runs_only_when_the_image_or_what_is_around_a_rear_is_searched() -> None:
    vehicle = _vehicle(20.0)
    detector = VehicleDetector(_Finder([vehicle]), _PERSPECTIVE)
    assert detector.find(_IMAGE, SearchPlan(tracked=())) == []
    assert len(detector.find(_IMAGE, SearchPlan(vehicles=True))) == 1
    assert len(detector.find(_IMAGE, SearchPlan(rears=(vehicle.box, vehicle.box)))) == 1


@pytest.mark.parametrize("focal_px", [800.0, 1600.0, 4000.0])
def test_networks_see_a_car_60_m_ahead_40_px_wide_at_most(focal_px: float) -> None:
    finder = _Finder([])
    lens = CAMERA.model_copy(update={"focal_x_px": focal_px, "focal_y_px": focal_px})
    VehicleDetector(finder, Perspective(lens)).find(_IMAGE, SearchPlan(vehicles=True))

    assert finder.most_scale * focal_px * 1.8 / 60.0 == pytest.approx(40.0)


@pytest.mark.parametrize("most_scale", [0.5, 0.9])
def test_a_vehicle_is_found_in_a_reduced_image_at_the_same_place(most_scale: float) -> None:
    image = CameraRenderer(CAMERA).draw(Scene((SceneCar(15.0),)), np.random.default_rng(1))
    finder = VehicleFinder()
    (whole,) = finder.find(image)
    (reduced,) = finder.find(image, most_scale=most_scale)

    assert overlap(whole.box, reduced.box) > 0.8


@pytest.mark.parametrize("size_px", [(50.0, 0.0), (0.0, 50.0)])
def test_a_box_that_the_border_cuts_to_nothing_is_no_vehicle(size_px: tuple[float, float]) -> None:
    box = ImageBox(100.0, float(CAMERA.height_px), *size_px)
    finder = _Finder([VehicleBox(box, None, VehicleKind.CAR, 0.9)])

    assert VehicleDetector(finder, _PERSPECTIVE).find(_IMAGE, SearchPlan(vehicles=True)) == []
