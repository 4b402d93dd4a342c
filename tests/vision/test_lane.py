"""The host vehicle's lane from its markings: on the rig's straight road, and on painted bends."""

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from onboard.observations import Curvature
from onboard.vision.lane import HostLane, LaneMarkingDetector, LaneShape, lane_of_path
from onboard.vision.perspective import Perspective
from sim_rig.rendering.scene import Light, Scene, SceneCar
from tests.vision.drive import CAMERA, RENDERER

LANE_M = 3.5
FINDER = LaneMarkingDetector(Perspective(CAMERA), LANE_M)


def painted(
    shape: LaneShape, *, dashed: bool = False, lines: tuple[float, ...] = (-0.5, 0.5)
) -> NDArray[np.uint8]:
    """A dark road with the lane's lines, each 0.15 m wide."""
    image = np.full((540, 960, 3), 90, np.uint8)
    for line in lines:
        for start_m in np.arange(4.0, 60.0, 1.0):
            if dashed and start_m % 12 > 4:
                continue
            corners = []
            for ahead_m, side_m in ((0.0, -1), (0.0, 1), (1.0, 1), (1.0, -1)):
                middle_m = shape.middle_m(start_m + ahead_m) + line * shape.width_m
                u, v = RENDERER.project(start_m + ahead_m, middle_m + 0.075 * side_m, 0.0)
                corners.append((u * 16, v * 16))
            cv2.fillConvexPoly(image, np.array(corners, np.int32), (200, 200, 200), cv2.LINE_AA, 4)
    rng = np.random.default_rng(1)
    return np.clip(image + rng.normal(0, 3, image.shape), 0, 255).astype(np.uint8)


@pytest.mark.parametrize("light", Light)
def test_the_rigs_lane_is_found_in_any_light(light: Light) -> None:
    image = RENDERER.draw(Scene(light=light, travelled_m=5.0), np.random.default_rng(1))

    shape = FINDER.find(image)

    assert shape is not None
    assert shape.width_m == pytest.approx(LANE_M, abs=0.15)
    assert shape.offset_m == pytest.approx(0.0, abs=0.1)
    assert shape.middle_m(30.0) == pytest.approx(0.0, abs=0.3)


@pytest.mark.parametrize("dashed", [False, True])
@pytest.mark.parametrize(
    "shape",
    [
        LaneShape(3.5),
        LaneShape(3.2, offset_m=0.6),
        LaneShape(3.7, offset_m=-0.8, heading_rad=0.03),
        LaneShape(3.5, curvature_1_m=1 / 300),
        LaneShape(3.5, curvature_1_m=-1 / 400, heading_rad=0.03),
    ],
)
def test_a_lane_in_a_bend_is_found(shape: LaneShape, dashed: bool) -> None:
    found = FINDER.find(painted(shape, dashed=dashed))

    assert found is not None
    for ahead_m in (10.0, 20.0, 30.0):
        assert found.middle_m(ahead_m) == pytest.approx(shape.middle_m(ahead_m), abs=0.5)
    assert found.width_m == pytest.approx(shape.width_m, abs=0.3)


def test_a_road_without_paint_has_no_lane() -> None:
    assert FINDER.find(painted(LaneShape(3.5), lines=())) is None


def test_one_line_is_no_lane() -> None:
    assert FINDER.find(painted(LaneShape(3.5), lines=(-0.5,))) is None


def test_uniform_images_have_no_lane() -> None:
    noise = np.random.default_rng(1).integers(0, 255, (540, 960, 3)).astype(np.uint8)
    for image in (np.zeros((540, 960, 3), np.uint8), noise):
        shape = FINDER.find(image)
        assert shape is None or 0.8 * LANE_M <= shape.width_m <= 1.2 * LANE_M


def test_vehicles_on_the_road_do_not_change_the_lane() -> None:
    cars = (SceneCar(20.0, 0.0, plate="GN417KB"), SceneCar(15.0, 3.5), SceneCar(30.0, -3.5))
    shapes = [
        FINDER.find(RENDERER.draw(Scene(cars=cars, travelled_m=m), np.random.default_rng(1)))
        for m in range(12)
    ]

    found = [shape for shape in shapes if shape is not None]
    assert len(found) >= 4
    assert all(abs(shape.middle_m(20.0)) < 0.6 for shape in found)


def test_the_lane_follows_fits_and_decays_without_them() -> None:
    lane = HostLane(LANE_M)
    for _ in range(10):
        lane.receive_fit(LaneShape(3.5, offset_m=0.5, curvature_1_m=1 / 300))
    assert lane.shape.middle_m(30.0) == pytest.approx(0.5 + 900 / 600, rel=0.05)

    lane.receive_fit(None)
    assert lane.shape.middle_m(30.0) > 1.7
    for _ in range(100):
        lane.receive_fit(None)
    assert lane.shape.middle_m(30.0) == pytest.approx(0.0, abs=0.05)


def test_without_markings_the_lane_bends_with_the_path_at_once() -> None:
    lane = HostLane(LANE_M)

    lane.receive_curvature(Curvature(0.0, 1 / 150, 0.0))

    assert lane.shape.middle_m(20.0) == pytest.approx(22.0**2 / 300, rel=0.01)
    lane.receive_curvature(None)
    assert lane.shape.middle_m(20.0) == pytest.approx(0.0)


def test_markings_say_more_of_the_lane_than_the_path() -> None:
    lane = HostLane(LANE_M)
    for _ in range(20):
        lane.receive_fit(LaneShape(3.5))

    lane.receive_curvature(Curvature(0.0, 1 / 150, 1 / 1000))

    assert lane.shape.middle_m(20.0) == pytest.approx(0.0, abs=0.05)
    assert lane.path_sigma_m(20.0) < 0.01


@pytest.mark.parametrize("radius_m", [150.0, -150.0, 230.0])
def test_lines_of_a_narrow_bend_are_found_around_the_path(radius_m: float) -> None:
    """By markings alone, bends are looked for down to a radius of 230 m."""
    shape = lane_of_path(LANE_M, 1 / radius_m)

    found = FINDER.find(painted(shape), path_curvature_1_m=1.1 / radius_m)

    assert found is not None
    for ahead_m in (10.0, 20.0, 30.0):
        assert found.middle_m(ahead_m) == pytest.approx(shape.middle_m(ahead_m), abs=0.5)
