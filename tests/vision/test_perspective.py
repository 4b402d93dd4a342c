"""Metres to pixels and back, against OpenCV's projection and the rig's own equation."""

import math

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from onboard.vision.perspective import Perspective, RoadPosition
from onboard.vision.settings import Calibration, CameraSettings, guessed_calibration
from sim_rig.rendering.scene import CameraRenderer, SceneCar

ANGLES = st.floats(-0.1, 0.1)
PLACES = st.builds(
    RoadPosition,
    ahead_m=st.floats(3.0, 80.0),
    right_m=st.floats(-3.0, 3.0),
    height_m=st.floats(0.0, 1.2),
)


CAMERA = CameraSettings(source="rendered", pitch_rad=0.03, yaw_rad=-0.04)
RENDERER = CameraRenderer(CAMERA)


def calibration(pitch_rad: float = 0.0, yaw_rad: float = 0.0, k1: float = 0.0) -> Calibration:
    return Calibration(pitch_rad=pitch_rad, yaw_rad=yaw_rad, distortion=(k1, 0.0, 0.0, 0.0, 0.0))


@given(PLACES, ANGLES, ANGLES)
def test_projection_is_that_of_opencv(
    place: RoadPosition, pitch_rad: float, yaw_rad: float
) -> None:
    lens = calibration(pitch_rad, yaw_rad, k1=-0.1)
    # OpenCV takes the rotation from the vehicle's axes (right, down, ahead) to the camera's: first
    # about the vertical, then about the camera's own horizontal axis.
    about_vertical, _ = cv2.Rodrigues(np.array([0.0, -yaw_rad, 0.0]))
    about_horizontal, _ = cv2.Rodrigues(np.array([pitch_rad, 0.0, 0.0]))
    rotation, _ = cv2.Rodrigues(about_horizontal @ about_vertical)
    # (OpenCV ignores rotations below 1e-5 rad: hence the tolerance.)
    matrix = np.array([[1100.0, 0, 640], [0, 1100, 360], [0, 0, 1]])
    point = np.array([[place.right_m, 1.3 - place.height_m, place.ahead_m]])

    expected, _ = cv2.projectPoints(
        point, rotation, np.zeros(3), matrix, np.array([-0.1, 0.0, 0.0, 0.0, 0.0])
    )

    assert Perspective(lens).project(place) == pytest.approx(tuple(expected[0, 0]), abs=0.02)


@given(PLACES)
def test_projection_is_that_of_the_rig(place: RoadPosition) -> None:
    expected = RENDERER.project(place.ahead_m, place.right_m, place.height_m)

    assert Perspective(CAMERA).project(place) == pytest.approx(expected, abs=1e-6)


@given(st.floats(3.0, 60.0), st.floats(-4.0, 4.0))
def test_an_upright_tag_is_located_by_its_width(ahead_m: float, lateral_m: float) -> None:
    car = SceneCar(ahead_m, lateral_m, tag_id=1, tag_side_m=0.3)

    place = Perspective(CAMERA).locate_upright(RENDERER.plate_quad(car), 0.3)

    assert place.ahead_m == pytest.approx(ahead_m, rel=1e-4)
    assert place.right_m == pytest.approx(lateral_m, abs=1e-3)
    assert place.height_m == pytest.approx(0.63, abs=1e-3)


@given(st.floats(3.0, 60.0), st.floats(-4.0, 4.0), ANGLES, ANGLES)
def test_an_object_on_the_road_is_located_by_its_foot_point(
    ahead_m: float, right_m: float, pitch_rad: float, yaw_rad: float
) -> None:
    perspective = Perspective(calibration(pitch_rad, yaw_rad, k1=-0.1))

    place = perspective.locate_on_road(*perspective.project(RoadPosition(ahead_m, right_m, 0.0)))

    assert place is not None
    assert place.ahead_m == pytest.approx(ahead_m, rel=1e-3)
    assert place.right_m == pytest.approx(right_m, abs=1e-3 * ahead_m)


def test_the_sky_has_no_position_on_the_road() -> None:
    assert Perspective(calibration()).locate_on_road(640.0, 300.0) is None


def test_the_same_camera_at_half_the_resolution_gives_the_same_positions() -> None:
    lens = calibration(pitch_rad=0.03, k1=-0.1)
    half = lens.for_size(640, 360)

    assert half is not None
    u_px, v_px = Perspective(lens).project(RoadPosition(20.0, 2.0, 0.5))
    assert Perspective(half).project(RoadPosition(20.0, 2.0, 0.5)) == pytest.approx(
        (u_px / 2, v_px / 2)
    )


@pytest.mark.parametrize("size", [(720, 1280), (640, 480), (1280, 700)])
def test_a_frame_of_another_aspect_ratio_has_no_calibration(size: tuple[int, int]) -> None:
    assert calibration().for_size(*size) is None


def test_a_quadrilateral_seen_straight_on_has_its_own_shape() -> None:
    corners = np.array([[0, 0], [520, 0], [520, 110], [0, 110]], np.float32)

    assert math.isclose(Perspective(calibration()).shape(corners), 520 / 110, rel_tol=1e-6)


@pytest.mark.parametrize("size", [(200, 720), (720, 200), (64, 8192), (8192, 64), (720, 1280)])
def test_a_picture_of_any_shape_has_a_guessed_lens_of_60_degrees_along_its_longer_side(
    size: tuple[int, int],
) -> None:
    perspective = Perspective(guessed_calibration(*size))
    half = math.tan(math.radians(30.0))

    assert 2 * half * perspective.width_px(1.0, 1.0) == pytest.approx(max(size))
