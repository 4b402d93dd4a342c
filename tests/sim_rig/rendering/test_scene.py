"""Things stand in the picture where a pinhole camera puts them."""

import math

import cv2
import numpy as np
import pytest

from onboard.vision.settings import Calibration
from sim_rig.rendering.scene import CameraRenderer, Image, Light, Scene, SceneCar, _Look, warp_onto

LEVEL = Calibration(
    width_px=960,
    height_px=540,
    focal_x_px=900.0,
    focal_y_px=900.0,
    principal_x_px=480.0,
    principal_y_px=270.0,
    mounting_height_m=1.3,
)
TILTED = LEVEL.model_copy(update={"pitch_rad": 0.05, "yaw_rad": -0.04})


def rng() -> np.random.Generator:
    return np.random.default_rng(1)


def still(calibration: Calibration = LEVEL) -> CameraRenderer:
    return CameraRenderer(calibration, blur_sigma_px=0.0)


@pytest.mark.parametrize("calibration", [LEVEL, TILTED])
def test_projection_agrees_with_opencv(calibration: Calibration) -> None:
    """`cv2.projectPoints` with the same lens and pose is the oracle."""
    points = np.asarray([(10.0, 0.0, 0.0), (20.0, -3.0, 1.5), (50.0, 4.0, 0.6)])
    pitch, yaw = calibration.pitch_rad, calibration.yaw_rad
    # Camera axes: x right, y down, z ahead. First undo the yaw, then the pitch.
    turn = np.asarray(
        [(math.cos(yaw), 0, -math.sin(yaw)), (0, 1, 0), (math.sin(yaw), 0, math.cos(yaw))]
    )
    nod = np.asarray(
        [(1, 0, 0), (0, math.cos(pitch), -math.sin(pitch)), (0, math.sin(pitch), math.cos(pitch))]
    )
    rotation, _ = cv2.Rodrigues(nod @ turn)
    lens = np.asarray(
        [
            (calibration.focal_x_px, 0, calibration.principal_x_px),
            (0, calibration.focal_y_px, calibration.principal_y_px),
            (0, 0, 1),
        ]
    )
    in_camera = np.asarray(
        [(x, calibration.mounting_height_m - height, z) for z, x, height in points]
    )
    expected, _ = cv2.projectPoints(in_camera, rotation, np.zeros(3), lens, None)
    picture = still(calibration)
    seen = [picture.project(*point) for point in points]
    np.testing.assert_allclose(seen, expected[:, 0], atol=1e-6)


def test_the_width_of_a_plate_follows_from_its_distance() -> None:
    quad = still().plate_quad(SceneCar(ahead_m=15.0, plate="ABC1234"))
    assert quad[1, 0] - quad[0, 0] == pytest.approx(900.0 * 0.520 / 15.0)
    assert quad[2, 1] - quad[1, 1] == pytest.approx(900.0 * 0.110 / 15.0)


@pytest.mark.parametrize("ahead_m", [3.0, 5.0, 8.0])
@pytest.mark.parametrize("calibration", [LEVEL, TILTED])
def test_a_tag_is_found_by_opencv_at_its_place(ahead_m: float, calibration: Calibration) -> None:
    car = SceneCar(ahead_m=ahead_m, lateral_m=0.3, tag_id=7)
    picture = CameraRenderer(calibration)
    parameters = cv2.aruco.DetectorParameters()
    parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    tags = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
    detector = cv2.aruco.ArucoDetector(tags, parameters)
    corners, ids, _ = detector.detectMarkers(picture.draw(Scene((car,)), rng()))
    assert ids is not None
    assert ids.ravel().tolist() == [7]
    # OpenCV counts from the middle of the first pixel.
    np.testing.assert_allclose(corners[0][0] + 0.5, picture.plate_quad(car), atol=0.9)


def test_nearer_cars_hide_farther_ones_whatever_their_order() -> None:
    near = SceneCar(ahead_m=6.0, colour_bgr=(30, 200, 30))
    far = SceneCar(ahead_m=20.0, colour_bgr=(30, 30, 200))
    one, other = (still().draw(Scene(cars), rng()) for cars in ((near, far), (far, near)))
    assert np.array_equal(one, other)
    column, row = (round(value) for value in still().project(6.0, 0.0, 0.75))
    blue, green, red = (int(value) for value in one[row, column])
    assert green > 2 * max(blue, red)


@pytest.mark.parametrize("calibration", [LEVEL, TILTED])
def test_cars_that_are_not_painted_would_not_be_seen(
    calibration: Calibration, monkeypatch: pytest.MonkeyPatch
) -> None:
    draws = rng()
    painted: list[SceneCar] = []
    paint = CameraRenderer._paint_car

    def counted(self: CameraRenderer, image: Image, car: SceneCar, look: _Look) -> None:
        painted.append(car)
        paint(self, image, car, look)

    monkeypatch.setattr(CameraRenderer, "_paint_car", counted)
    cars = given = 0
    for _ in range(60):
        ahead_m = np.cumsum(draws.uniform(3.0, 30.0, 4))
        scene = Scene(
            tuple(
                SceneCar(
                    float(each_m),
                    float(draws.normal(0.0, 0.4)),
                    float(draws.normal(0.0, 0.1)),
                    height_m=float(draws.choice([1.2, 1.5, 2.5])),
                    plate="PA148TK",
                    colour_bgr=(40, 200, 90),
                )
                for each_m in ahead_m
            ),
            light=Light.FOG,
        )
        painted.clear()
        image = still(calibration).draw(scene, rng())
        cars, given = cars + len(painted), given + sum(not car.is_turned for car in scene.cars)
        with monkeypatch.context() as context:
            context.setattr(CameraRenderer, "_is_hidden", lambda *_: False)
            assert np.array_equal(image, still(calibration).draw(scene, rng()))
    assert cars < given


def test_the_cars_before_the_lead_are_not_painted(monkeypatch: pytest.MonkeyPatch) -> None:
    painted: list[float] = []
    monkeypatch.setattr(
        CameraRenderer, "_paint_car", lambda _self, _image, car, _look: painted.append(car.ahead_m)
    )
    still().draw(Scene((SceneCar(12.0), SceneCar(41.5), SceneCar(71.0))), rng())

    assert painted == [12.0]


def test_the_near_cars_plate_covers_the_far_cars() -> None:
    cars = (SceneCar(6.0, plate="AAA1111"), SceneCar(12.0, plate="BBB2222"))
    alone = still().draw(Scene(cars[:1]), rng())
    both = still().draw(Scene(cars), rng())
    quad = still().plate_quad(cars[0])
    (left, top), (right, bottom) = quad[0].astype(int), quad[2].astype(int)
    assert np.array_equal(alone[top:bottom, left:right], both[top:bottom, left:right])


def test_brake_lights_glow() -> None:
    dark = still().draw(Scene((SceneCar(8.0),)), rng())
    lit = still().draw(Scene((SceneCar(8.0, braking=True),)), rng())
    assert int(lit[..., 2].sum()) > int(dark[..., 2].sum())


def test_dashes_come_towards_the_camera_and_repeat() -> None:
    first, moved, around = (
        still().draw(Scene(travelled_m=metres), rng()) for metres in (0.0, 4.0, 12.0)
    )
    assert not np.array_equal(first, moved)
    assert np.array_equal(first, around)


@pytest.mark.parametrize("light", Light)
def test_every_light_shows_the_plate(light: Light) -> None:
    car = SceneCar(ahead_m=8.0, plate="ABC1234")
    picture = CameraRenderer(LEVEL)
    image = picture.draw(Scene((car,), light=light), rng())
    quad = picture.plate_quad(car)
    (left, top), (right, bottom) = quad[0].astype(int), quad[2].astype(int)
    assert float(image[top:bottom, left:right].std()) > 25.0


def test_noise_changes_with_the_generator_only() -> None:
    picture, scene = CameraRenderer(LEVEL), Scene((SceneCar(10.0, plate="ABC1234"),))
    first, again = (picture.draw(scene, np.random.default_rng(5)) for _ in range(2))
    other = picture.draw(scene, np.random.default_rng(6))
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)


@pytest.mark.parametrize("ahead_m", [-5.0, 0.0, 0.5, 1.5, 1000.0])
@pytest.mark.parametrize("lateral_m", [-50.0, 0.0, 3.5])
def test_cars_beside_behind_and_far_away_are_no_trouble(ahead_m: float, lateral_m: float) -> None:
    image = CameraRenderer(LEVEL).draw(Scene((SceneCar(ahead_m, lateral_m, plate="A1"),)), rng())
    assert image.shape == (540, 960, 3)
    assert image.dtype == np.uint8


def test_warping_outside_the_picture_leaves_it_alone() -> None:
    image = np.full((20, 20, 3), 77, np.uint8)
    texture = np.full((4, 4, 4), 255, np.uint8)
    quad = np.asarray([(30, 30), (40, 30), (40, 40), (30, 40)], np.float32)
    warp_onto(image, texture, quad)
    assert (image == 77).all()


def test_a_bend_shows_its_line_where_the_camera_projects_it() -> None:
    """The right border of the road, 30 m along a bend of 100 m to the right."""
    radius_m, right_m = 100.0, 5.25
    angles = np.linspace(0.0, 1.0, 101)
    middle = [(radius_m * math.sin(a), radius_m * (1.0 - math.cos(a))) for a in angles]
    bent, straight = (
        still().draw(Scene(middle_m=tuple(points)), rng()).astype(int) for points in (middle, [])
    )
    turned = 30.0 / radius_m
    ahead_m = (radius_m - right_m) * math.sin(turned)
    lateral_m = radius_m - (radius_m - right_m) * math.cos(turned)
    u, v = (round(each) for each in still().project(ahead_m, lateral_m, 0.0))

    assert bent[v, u - 1 : u + 2].max() > 180
    assert straight[v, u - 1 : u + 2].max() < 180


def test_the_plate_of_a_car_that_is_turned_a_little_is_narrower_and_aslant() -> None:
    level, turned = (
        still().plate_quad(SceneCar(20.0, 0.0, heading_rad=angle, plate="ABC1234"))
        for angle in (0.0, 0.2)
    )

    assert np.ptp(turned[:, 0]) == pytest.approx(np.ptp(level[:, 0]) * math.cos(0.2), rel=0.02)
    assert turned[1, 1] > level[1, 1]  # its right end is nearer
