"""How far the lane is seen to be free, on rendered roads and in real clips."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from onboard.observations import LeadIdentity
from onboard.vision.free_lane import FreeLane
from onboard.vision.lane import LaneShape
from onboard.vision.networks import load_perception
from onboard.vision.perspective import Perspective
from onboard.vision.settings import Calibration
from sim_rig.rendering.scene import Light, Scene, SceneCar
from tests.vision.drive import CAMERA, RENDERER, TAGS, frames, observe

LANE = LaneShape(3.5)
UNMARKED = SceneCar(15.0, 0.2)
"""A vehicle without plate and tag."""


def free_until_m(*cars: SceneCar, light: Light = Light.DAY) -> float:
    image = RENDERER.draw(Scene(cars, light=light), np.random.default_rng(1))
    return FreeLane(Perspective(CAMERA), 3.5).free_until_m(image, LANE)


@pytest.mark.parametrize("light", Light)
def test_an_empty_lane_is_free_as_far_as_it_is_looked_at(light: Light) -> None:
    assert free_until_m(light=light) == pytest.approx(63.0)


@pytest.mark.parametrize("light", Light)
@pytest.mark.parametrize("gap_m", [12.0, 20.0, 30.0])
@pytest.mark.parametrize("grey", [20, 90, 220])
def test_a_vehicle_ends_the_free_part(light: Light, gap_m: float, grey: int) -> None:
    car = SceneCar(gap_m, 0.2, colour_bgr=(grey, grey, grey))

    assert 0.8 * gap_m < free_until_m(car, light=light) < 1.2 * gap_m


def test_vehicles_in_the_next_lanes_do_not_end_it() -> None:
    cars = SceneCar(12.0, 3.5), SceneCar(20.0, -3.5)

    assert free_until_m(*cars) == pytest.approx(63.0)


@pytest.mark.parametrize("level", [0, 10, 28])
def test_in_the_dark_nothing_is_seen_to_be_free(level: int) -> None:
    image = np.full((540, 960, 3), level, np.uint8)

    assert FreeLane(Perspective(CAMERA), 3.5).free_until_m(image, LANE) == 0.0


def test_a_camera_that_shows_no_road_sees_nothing_free() -> None:
    upwards = CAMERA.model_copy(update={"pitch_rad": -0.5})
    image = np.full((540, 960, 3), 90, np.uint8)

    assert FreeLane(Perspective(upwards), 3.5).free_until_m(image, LANE) == 0.0


def test_a_vehicle_that_cannot_be_found_is_unknown_and_not_a_free_lane() -> None:
    observed = observe(load_perception(CAMERA, TAGS), frames(lambda _: Scene((UNMARKED,)), 1.0))

    assert {(lead.identity, lead.gap_m) for lead in observed.leads} == {
        (LeadIdentity.UNKNOWN, None)
    }


def test_without_a_calibrated_mounting_no_lane_is_seen_to_be_free() -> None:
    observed = observe(load_perception(None, TAGS), frames(lambda _: Scene(), 0.5))

    assert {lead.identity for lead in observed.leads} == {LeadIdentity.UNKNOWN}


@pytest.mark.realdata
@pytest.mark.parametrize(
    ("frame", "free_m"), [(0, (10, 20)), (500, (8, 16)), (700, (45, 70)), (1100, (45, 70))]
)
def test_a_real_road_is_free_up_to_the_vehicle_on_it(
    rig_data: Path, frame: int, free_m: tuple[float, float]
) -> None:
    clip = cv2.VideoCapture(str(rig_data / "clips" / "small-leads-320p.mp4"))
    clip.set(cv2.CAP_PROP_POS_FRAMES, frame)
    _, image = clip.read()
    camera = Calibration(
        width_px=480,
        height_px=320,
        focal_x_px=371.0,
        focal_y_px=371.0,
        principal_x_px=240.0,
        principal_y_px=160.0,
        mounting_height_m=1.17,
        pitch_rad=0.086,
        yaw_rad=-0.02,
    )

    nearest_m, farthest_m = free_m
    seen = FreeLane(Perspective(camera), 3.5).free_until_m(np.asarray(image, np.uint8), LANE)
    assert nearest_m < seen < farthest_m
