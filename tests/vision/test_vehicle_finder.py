"""Vehicles by two networks, whose doubts are multiplied."""

import numpy as np
import pytest

from onboard.observations import ImageBox
from onboard.vision.nanodet import AREA_PX, NanoDet, input_size
from onboard.vision.vehicle_finder import VehicleFinder, merged, overlap
from onboard.vision.vehicle_network import LEAST_SCORE, VehicleBox, VehicleKind
from sim_rig.rendering.scene import CameraRenderer, Scene, SceneCar
from tests.vision.drive import CAMERA


def _photographed(score: float, left_px: float = 100.0) -> VehicleBox:
    return VehicleBox(ImageBox(left_px, 100.0, 60.0, 50.0), None, VehicleKind.TRUCK, score)


def _drawn(score: float, left_px: float = 105.0) -> VehicleBox:
    box = ImageBox(left_px, 100.0, 60.0, 50.0)
    return VehicleBox(box, (left_px, left_px + 50.0), VehicleKind.VAN, score)


def _is_reported(photographs: list[VehicleBox], streets: list[VehicleBox]) -> bool:
    return any(vehicle.score >= LEAST_SCORE for vehicle in merged(photographs, streets))


def test_the_network_of_photographs_is_believed_alone() -> None:
    assert _is_reported([_photographed(0.4)], [])
    assert not _is_reported([_photographed(0.39)], [])


def test_the_network_of_rendered_streets_is_believed_alone_where_it_is_sure() -> None:
    assert _is_reported([], [_drawn(0.65)])
    assert not _is_reported([], [_drawn(0.6)])


def test_two_that_doubt_find_together_what_neither_does_alone() -> None:
    assert _is_reported([_photographed(0.25)], [_drawn(0.4)])
    assert not _is_reported([_photographed(0.25)], [_drawn(0.4, left_px=300.0)])


def test_a_vehicle_of_both_is_one_with_the_box_of_the_surer_network() -> None:
    (vehicle,) = merged([_photographed(0.6)], [_drawn(0.6)])
    assert vehicle.box.x_px == 100.0
    assert vehicle.end_px is None
    assert vehicle.score == pytest.approx(1 - 0.4 * 0.4**0.5)
    (vehicle,) = merged([_photographed(0.3)], [_drawn(0.9)])
    assert vehicle.end_px == (105.0, 155.0)
    assert vehicle.kind is VehicleKind.VAN


def test_the_surest_vehicle_comes_first() -> None:
    found = merged([_photographed(0.5), _photographed(0.45, 400.0)], [_drawn(0.99, 700.0)])
    assert [vehicle.box.x_px for vehicle in found] == [700.0, 100.0, 400.0]


@pytest.mark.parametrize("size_px", [(1280, 720), (1242, 375), (480, 640), (3840, 1080)])
def test_images_of_all_shapes_cost_about_the_same(size_px: tuple[int, int]) -> None:
    columns, rows = input_size(*size_px)
    assert columns % 32 == rows % 32 == 0
    assert 0.5 * AREA_PX <= columns * rows <= 1.5 * AREA_PX


@pytest.mark.parametrize("finder", [NanoDet, VehicleFinder])
def test_a_rear_is_found_where_it_is(finder: type[NanoDet | VehicleFinder]) -> None:
    scene = Scene((SceneCar(12.0),))
    image = CameraRenderer(CAMERA).draw(scene, np.random.default_rng(1))
    best = finder(least_score=0.1).find(image)[0]
    assert best.box.x_px + best.box.w_px / 2 == pytest.approx(CAMERA.width_px / 2, abs=20.0)
    assert best.box.w_px == pytest.approx(CAMERA.focal_x_px * 1.8 / 12.0, rel=0.2)


def test_around_a_rear_it_is_found_as_in_the_whole_image_and_nothing_that_the_part_cuts() -> None:
    cars = SceneCar(12.0), SceneCar(11.0, 3.5)
    image = CameraRenderer(CAMERA).draw(Scene(cars), np.random.default_rng(1))
    vehicles = VehicleFinder()
    ahead, beside = sorted(vehicles.find(image), key=lambda vehicle: vehicle.box.x_px)

    (found,) = vehicles.find(image, ahead.box)

    assert overlap(found.box, ahead.box) > 0.85
    assert overlap(found.box, beside.box) < 0.1
    assert vehicles.find(image, ImageBox(2000.0, 0.0, 50.0, 50.0)) == []
