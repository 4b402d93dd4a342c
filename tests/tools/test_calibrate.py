"""The calibration of a simulated camera is found from its images."""

from collections.abc import Callable
from functools import cache
from pathlib import Path

import cv2
import numpy as np
import pytest
import typer
from typer.testing import CliRunner

from onboard.errors import UserError
from onboard.settings import SettingsError, load_settings
from onboard.tools.calibrate.calibration import (
    Board,
    CalibrationError,
    CharucoBoard,
    Chessboard,
    Fit,
    calibrate_by_plates,
    calibrate_lens,
    mount_by_board,
)
from onboard.tools.calibrate.cli import calibrate
from onboard.vision.settings import Calibration, CameraSettings
from sim_rig.rendering.scene import CameraRenderer, Scene, SceneCar

TRUE = Calibration(
    width_px=960,
    height_px=540,
    focal_x_px=800.0,
    focal_y_px=805.0,
    principal_x_px=490.0,
    principal_y_px=262.0,
    distortion=(-0.22, 0.08, 0.001, -0.0005, 0.0),
    mounting_height_m=1.25,
    pitch_rad=0.06,
    yaw_rad=-0.03,
)
MATRIX = np.array(
    [
        [TRUE.focal_x_px, 0, TRUE.principal_x_px - 0.5],
        [0, TRUE.focal_y_px, TRUE.principal_y_px - 0.5],
        [0, 0, 1],
    ]
)
SQUARE_M = 0.1
COLUMNS, ROWS = 8, 6  # squares
CHESSBOARD = Chessboard(COLUMNS - 1, ROWS - 1, SQUARE_M)
CHARUCO = CharucoBoard(COLUMNS, ROWS, SQUARE_M, 0.07, "5X5_100")
_PX = 100  # a square in the art
_MARGIN = 50


def chessboard_art() -> np.ndarray:
    squares = np.indices((ROWS, COLUMNS)).sum(axis=0) % 2
    art = np.kron(squares, np.ones((_PX, _PX))) * 215 + 20
    return np.pad(art.astype(np.uint8), _MARGIN, constant_values=235)


def charuco_art() -> np.ndarray:
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_5X5_100)
    board = cv2.aruco.CharucoBoard((COLUMNS, ROWS), SQUARE_M, 0.07, dictionary)
    art = board.generateImage((COLUMNS * _PX, ROWS * _PX))
    return np.pad(art, _MARGIN, constant_values=255)


@cache
def _ideal() -> np.ndarray:
    """Pixels of an ideal pinhole's image in the lens's image."""
    grid = np.indices((540, 960))[::-1].reshape(2, -1).T.astype(np.float64)
    return cv2.undistortPointsIter(
        grid.reshape(-1, 1, 2),
        MATRIX,
        np.array(TRUE.distortion),
        np.eye(3),
        np.eye(3),
        (cv2.TERM_CRITERIA_COUNT, 20, 0),
    )[:, 0]


def photograph(art: np.ndarray, rotation: np.ndarray, translation: np.ndarray) -> np.ndarray:
    """`art` on a board whose origin is its top left square, in the camera's image."""
    # On the board's plane: ray = (x, y, 1) meets rotation @ (X, Y, 0) + translation.
    to_board = np.linalg.inv(np.column_stack([rotation[:, 0], rotation[:, 1], translation]))
    on_board = np.column_stack([_ideal(), np.ones(len(_ideal()))]) @ to_board.T
    with np.errstate(divide="ignore", invalid="ignore"):
        metres = on_board[:, :2] / on_board[:, 2:]
    pixels = (metres / SQUARE_M * _PX + _MARGIN - 0.5).astype(np.float32)
    flat = cv2.remap(
        cv2.GaussianBlur(art, (0, 0), 1.0),
        pixels[:, 0].reshape(540, 960),
        pixels[:, 1].reshape(540, 960),
        cv2.INTER_LINEAR,
        borderMode=cv2.BORDER_CONSTANT,
        borderValue=128,
    )
    noisy = flat + np.random.default_rng(1).normal(0, 2, flat.shape)
    grey = np.clip(noisy, 0, 255).astype(np.uint8)
    return np.asarray(cv2.cvtColor(grey, cv2.COLOR_GRAY2BGR), np.uint8)


def at_different_tilts(art: np.ndarray, count: int = 8) -> list[np.ndarray]:
    rng = np.random.default_rng(4)
    pictures = []
    for _ in range(count):
        rotation, _ = cv2.Rodrigues(rng.uniform(-0.5, 0.5, 3))
        middle = np.array([COLUMNS, ROWS, 0]) * SQUARE_M / 2
        at = np.array([rng.uniform(-0.35, 0.35), rng.uniform(-0.15, 0.15), rng.uniform(0.9, 1.5)])
        pictures.append(photograph(art, rotation, at - rotation @ middle))
    return pictures


def upright(art: np.ndarray, bottom_m: float, ahead_m: float = 2.0) -> np.ndarray:
    """The board straight ahead of the camera, across its heading, its lower edge `bottom_m`
    high."""
    pitch, _ = cv2.Rodrigues(np.array([TRUE.pitch_rad, 0.0, 0.0]))
    yaw, _ = cv2.Rodrigues(np.array([0.0, -TRUE.yaw_rad, 0.0]))
    rotation = pitch @ yaw
    top_m = bottom_m + ROWS * SQUARE_M
    corner = np.array([-COLUMNS * SQUARE_M / 2, TRUE.mounting_height_m - top_m, ahead_m])
    return photograph(art, rotation, rotation @ corner)


@pytest.mark.long
@pytest.mark.parametrize(
    ("art", "board"), [(chessboard_art(), CHESSBOARD), (charuco_art(), CHARUCO)]
)
def test_the_lens_is_found_again(art: np.ndarray, board: Board) -> None:
    fit = calibrate_lens(at_different_tilts(art), board)

    lens = fit.calibration
    assert fit.used >= 6
    assert fit.rms_px < 0.3
    assert lens.focal_x_px == pytest.approx(TRUE.focal_x_px, rel=0.01)
    assert lens.focal_y_px == pytest.approx(TRUE.focal_y_px, rel=0.01)
    assert lens.principal_x_px == pytest.approx(TRUE.principal_x_px, abs=5)
    assert lens.principal_y_px == pytest.approx(TRUE.principal_y_px, abs=5)
    assert lens.distortion[0] == pytest.approx(TRUE.distortion[0], abs=0.05)


@pytest.mark.parametrize(
    ("art", "board"), [(chessboard_art(), CHESSBOARD), (charuco_art(), CHARUCO)]
)
def test_the_mounting_is_found_by_the_board_upright(art: np.ndarray, board: Board) -> None:
    # The lowest inner corners are a square above the lower edge.
    fit = mount_by_board(TRUE, upright(art, bottom_m=0.7), board, lowest_m=0.7 + SQUARE_M)

    assert fit.rms_px < 0.5
    assert fit.calibration.mounting_height_m == pytest.approx(1.25, abs=0.01)
    assert fit.calibration.pitch_rad == pytest.approx(0.06, abs=0.005)
    assert fit.calibration.yaw_rad == pytest.approx(-0.03, abs=0.005)
    assert fit.calibration.distortion == TRUE.distortion
    assert not fit.is_doubtful


def test_the_order_of_a_boards_corners_does_not_matter() -> None:
    board = Chessboard(ROWS - 1, COLUMNS - 1, SQUARE_M)

    fit = mount_by_board(TRUE, upright(chessboard_art(), bottom_m=0.7), board, lowest_m=0.8)

    assert fit.calibration.mounting_height_m == pytest.approx(1.25, abs=0.01)
    assert fit.calibration.pitch_rad == pytest.approx(0.06, abs=0.005)


def always_facing(art: np.ndarray) -> list[np.ndarray]:
    """Images of the board at different positions, never tilted."""
    middle = np.array([COLUMNS, ROWS, 0]) * SQUARE_M / 2
    places = [(-0.2, 0, 1.0), (0, 0, 1.2), (0.2, 0, 1.4), (0, 0, 1.8), (0.1, 0, 2.2)]
    return [photograph(art, np.eye(3), np.array(place) - middle) for place in places]


def always_alike(art: np.ndarray) -> list[np.ndarray]:
    """The same image of a tilted board."""
    return at_different_tilts(art, 1) * 6


@pytest.mark.parametrize("photographed", [always_alike, always_facing])
def test_a_board_that_is_never_tilted_is_an_error(
    photographed: Callable[[np.ndarray], list[np.ndarray]],
) -> None:
    """The residual is low, and the focal length off by 6 to 15 %."""
    with pytest.raises(CalibrationError, match="tilt it by 20 degrees"):
        calibrate_lens(photographed(chessboard_art()), CHESSBOARD)


def test_a_fit_with_a_large_residual_is_doubtful() -> None:
    """A board in motion with a rolling shutter leaves 1.1 px, and the lens is off by 12 %."""
    assert Fit(TRUE, rms_px=1.1, used=8).is_doubtful
    assert not Fit(TRUE, rms_px=0.5, used=8).is_doubtful


def test_a_row_of_corners_is_no_board() -> None:
    art = charuco_art()
    art[_MARGIN + 2 * _PX :] = 255  # one row of inner corners is left
    middle = np.array([COLUMNS, ROWS, 0]) * SQUARE_M / 2
    picture = photograph(art, np.eye(3), np.array([0, 0, 1.0]) - middle)

    assert CHARUCO.find(np.asarray(cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY), np.uint8)) is None


def test_focal_length_and_mounting_are_found_by_a_plate_at_known_distances() -> None:
    camera = CameraSettings(
        source="made up",
        focal_x_px=1500.0,
        focal_y_px=1500.0,
        mounting_height_m=1.3,
        pitch_rad=0.04,
        yaw_rad=0.02,
    )
    picture, rng = CameraRenderer(camera), np.random.default_rng(2)
    plates = []
    for distance_m in (4.0, 5.0, 7.0, 10.0, 14.0):
        corners = picture.plate_quad(SceneCar(distance_m, 0.05, plate="GN417KB"))
        plates.append((distance_m, (corners + rng.normal(0, 0.2, (4, 2))).astype(np.float32)))

    fit = calibrate_by_plates((1280, 720), plates, width_m=0.52, height_m=0.63)

    found = fit.calibration
    assert fit.rms_px < 0.5
    assert found.focal_x_px == pytest.approx(1500.0, rel=0.01)
    assert found.mounting_height_m == pytest.approx(1.3, abs=0.03)
    assert found.pitch_rad == pytest.approx(0.04, abs=0.003)
    assert found.yaw_rad == pytest.approx(0.02, abs=0.003)


def test_a_plate_at_other_distances_than_given_is_an_error() -> None:
    picture = CameraRenderer(CameraSettings(source="made up"))
    plates = [
        (said_m, picture.plate_quad(SceneCar(true_m, plate="GN417KB")).astype(np.float32))
        for said_m, true_m in ((4.0, 12.0), (6.0, 4.0), (8.0, 6.0), (12.0, 8.0))
    ]

    with pytest.raises(CalibrationError, match="in the order of the distances"):
        calibrate_by_plates((1280, 720), plates, width_m=0.52, height_m=0.63)


def test_too_few_images_are_an_error() -> None:
    empty = np.full((540, 960, 3), 128, np.uint8)
    with pytest.raises(CalibrationError, match="found in 0 of 6"):
        calibrate_lens([empty] * 6, CHESSBOARD)
    with pytest.raises(CalibrationError, match="one size"):
        calibrate_lens([empty, empty[:200]], CHESSBOARD)
    with pytest.raises(CalibrationError, match=r"upright is 960 x 200 px, and .* are 960 x 540"):
        mount_by_board(TRUE, empty[:200], CHARUCO, 0.5)
    with pytest.raises(CalibrationError, match="not found in the image of it upright"):
        mount_by_board(TRUE, empty, CHARUCO, 0.5)
    with pytest.raises(CalibrationError, match="3 distances"):
        calibrate_by_plates((960, 540), [(4.0, np.zeros((4, 2), np.float32))] * 5, 0.52, 0.6)


def test_an_impossible_mounting_is_an_error() -> None:
    with pytest.raises(SettingsError, match="mounting_height_m"):
        mount_by_board(TRUE, upright(chessboard_art(), 0.7), CHESSBOARD, lowest_m=50.0)


def run(*arguments: str | Path) -> None:
    app = typer.Typer()
    app.command()(calibrate)
    result = CliRunner().invoke(app, [str(each) for each in arguments])
    if result.exception is not None:
        raise result.exception


@pytest.mark.long
def test_the_command_writes_a_valid_calibration(tmp_path: Path) -> None:
    (tmp_path / "board").mkdir()
    for index, picture in enumerate(at_different_tilts(chessboard_art())):
        cv2.imwrite(str(tmp_path / "board" / f"{index}.png"), picture)
    cv2.imwrite(str(tmp_path / "upright.png"), upright(chessboard_art(), 0.7))

    run(
        *(tmp_path / "board", "--board", "7x5", "--square-m", "0.1"),
        *("--upright", tmp_path / "upright.png", "--lowest-corners-m", "0.8"),
        *("--out", tmp_path / "camera.yaml"),
    )

    found = load_settings(tmp_path / "camera.yaml", Calibration)
    assert found.focal_x_px == pytest.approx(TRUE.focal_x_px, rel=0.01)
    assert found.pitch_rad == pytest.approx(TRUE.pitch_rad, abs=0.01)
    assert found.mounting_height_m == pytest.approx(1.25, abs=0.03)

    run(tmp_path / "board", "--board", "7x5", "--square-m", "0.1", "--out", tmp_path / "lens.yaml")

    assert found.has_mounting
    assert not load_settings(tmp_path / "lens.yaml", Calibration).has_mounting


def test_a_parked_cars_plate_gives_the_lens_within_two_percent(tmp_path: Path) -> None:
    camera = CameraSettings(
        source="made up",
        focal_x_px=1400.0,
        focal_y_px=1400.0,
        mounting_height_m=1.35,
        pitch_rad=0.03,
    )
    picture, rng = CameraRenderer(camera), np.random.default_rng(0)
    (tmp_path / "car").mkdir()
    for distance_m in (4, 6, 8, 12):
        # The detector leaves out the plate's blue band.
        car = SceneCar(distance_m, 0.05, plate="KA123AB", colour_bgr=(40, 40, 110))
        path = tmp_path / "car" / f"{distance_m}.png"
        cv2.imwrite(str(path), picture.draw(Scene((car,)), rng))

    run(
        *(tmp_path / "car", "--plate-at-m", "4,6,8,12", "--plate-height-m", "0.63"),
        *("--out", tmp_path / "camera.yaml"),
    )

    found = load_settings(tmp_path / "camera.yaml", Calibration)
    assert found.focal_x_px == pytest.approx(1400.0, rel=0.02)
    assert found.mounting_height_m == pytest.approx(1.35, abs=0.03)
    assert found.pitch_rad == pytest.approx(0.03, abs=0.003)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ([], "--board, or"),
        (["--board", "9"], "must be like 9x6"),
        (["--board", "1x6"], "must be like 9x6"),
        (["--plate-at-m", "4,x", "--plate-height-m", "0.6"], "must be like 4,6,8"),
        (["--plate-at-m", "4,5,6", "--plate-height-m", "0.6"], "3 distances for 1 images"),
        (["--plate-at-m", "4,nan", "--plate-height-m", "0.6"], "distances must be above 0"),
        (
            ["--plate-at-m", "4", "--plate-height-m", "0.6", "--plate-width-m", "0"],
            "must be 0.001 to 1 m",
        ),
        (["--board", "2x6"], "must be like 9x6"),
        (["--board", "7x5", "--square-m", "30"], "--square-m: must be 0.001 to 1 m"),
        (["--board", "7x5", "--square-m", "nan"], "--square-m: must be 0.001 to 1 m"),
        (["--board", "7x5", "--charuco-tag-m", "0.03"], "less than the square's 0.03"),
        (
            ["--board", "7x5", "--charuco-tag-m", "0.02", "--charuco-dictionary", "9X9"],
            "one of 4X4",
        ),
        (["--board", "7x5"], "found in 0 of 1"),
        (["--board", "7x5", "--upright", "1.png"], "--lowest-corners-m go together"),
    ],
)
def test_a_users_mistake_is_an_error(tmp_path: Path, options: list[str], message: str) -> None:
    cv2.imwrite(str(tmp_path / "1.png"), np.full((540, 960, 3), 128, np.uint8))
    with pytest.raises(UserError, match=message):
        run(tmp_path, *options)


def test_more_than_one_image_of_the_board_upright_is_an_error(tmp_path: Path) -> None:
    for index in range(2):
        cv2.imwrite(str(tmp_path / f"{index}.png"), np.full((540, 960, 3), 128, np.uint8))

    with pytest.raises(UserError, match=r"--upright: must be one image \(2 given\)"):
        run(tmp_path, "--board", "7x5", "--upright", tmp_path, "--lowest-corners-m", "0.8")


def test_only_some_frames_of_a_video_are_used(tmp_path: Path) -> None:
    """All frames of a long video would fill the memory."""
    video = tmp_path / "board.avi"
    writer = cv2.VideoWriter(str(video), cv2.VideoWriter.fourcc(*"MJPG"), 25.0, (96, 64))
    for _ in range(250):
        writer.write(np.full((64, 96, 3), 128, np.uint8))
    writer.release()

    with pytest.raises(CalibrationError, match="found in 0 of 32 images"):
        run(video, "--board", "7x5")


def test_an_unreadable_image_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    cv2.imwrite(str(tmp_path / "1.png"), np.full((540, 960, 3), 128, np.uint8))
    (tmp_path / "2.png").write_bytes(b"")

    with pytest.raises(UserError, match="found in 0 of 1"):
        calibrate(str(tmp_path), board="7x5")

    assert "2.png: not an image that can be read" in capsys.readouterr().err
