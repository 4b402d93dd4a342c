"""Lens and mounting of the camera, from images of a board or of a plate at known distances.

The lens: Zhang's method in OpenCV ("A Flexible New Technique for Camera Calibration", 2000), from
ten or more images of a chessboard or ChArUco board. The mounting: one image of the board upright on
the road, straight ahead. Without a board, the plate of a parked car at three or more known
distances gives focal length, height and pitch, though no distortion.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import cv2
import numpy as np
import numpy.typing as npt

from onboard.errors import UserError
from onboard.settings import parse_settings
from onboard.vision.perspective import Corners
from onboard.vision.settings import Calibration

Image = npt.NDArray[np.uint8]
_Points = npt.NDArray[np.float32]
_Unknowns = npt.NDArray[np.float64]

MIN_PICTURES = 5
"""Least images of a board; fewer do not determine the lens."""
MIN_TILT = math.radians(15)
"""Least angle between the two most different boards. Parallel boards do not determine the focal
length; at 15 degrees its error is about 1 %."""
MIN_DISTANCES = 3
"""Least distances of a plate: focal length, height and pitch are three unknowns."""
MAX_ERROR = 0.1
"""Largest RMS error of a plate's corners, as a share of its width."""
HIGH_RMS = 0.001
"""RMS error, as a share of the image's width, of a board that was bent, moved or zoomed."""
_MAX_ITERATIONS, _MIN_CHANGE = 100, 1e-9
"""Limits of a fit; the change is relative to `scale`."""


class CalibrationError(UserError):
    """The images do not determine the calibration."""


class Board(Protocol):
    """A flat pattern of known size."""

    def find(self, grey: Image) -> tuple[_Points, _Points] | None:
        """Points (n, 3) of the board in metres, and their pixels (n, 2)."""
        ...


class Chessboard:
    """A pattern of black and white squares."""

    def __init__(self, columns: int, rows: int, square_m: float) -> None:
        """Set the pattern.

        Args:
            columns: inner corners in a row, where four squares meet.
            rows: inner corners in a column.
            square_m: side of a square.
        """
        self._size = (columns, rows)
        grid = np.mgrid[0:columns, 0:rows].T.reshape(-1, 2) * square_m
        self._points = np.hstack([grid, np.zeros((len(grid), 1))]).astype(np.float32)

    def find(self, grey: Image) -> tuple[_Points, _Points] | None:
        """All inner corners, or `None`."""
        found, corners = cv2.findChessboardCornersSB(grey, self._size)
        if not found:
            return None
        return self._points, np.asarray(corners, np.float32).reshape(-1, 2)


class CharucoBoard:
    """A chessboard with ArUco tags in its white squares: a visible part of it is enough."""

    def __init__(
        self, columns: int, rows: int, square_m: float, tag_side_m: float, dictionary: str
    ) -> None:
        """Set the pattern.

        Args:
            columns: squares in a row.
            rows: squares in a column.
            square_m: side of a square.
            tag_side_m: side of a tag.
            dictionary: name after OpenCV's `DICT_`.
        """
        number = int(getattr(cv2.aruco, f"DICT_{dictionary}"))
        self._board = cv2.aruco.CharucoBoard(
            (columns, rows), square_m, tag_side_m, cv2.aruco.getPredefinedDictionary(number)
        )
        self._detector = cv2.aruco.CharucoDetector(self._board)

    def find(self, grey: Image) -> tuple[_Points, _Points] | None:
        """The visible inner corners; `None` if fewer than six, or all in a line."""
        # OpenCV's stubs leave out that it returns None where there is no board.
        detected: tuple[Any, ...] = self._detector.detectBoard(grey)
        corners, numbers = detected[:2]
        if numbers is None or len(numbers) < 6:
            return None
        if self._board.checkCharucoCornersCollinear(numbers):
            return None
        points, pixels = self._board.matchImagePoints(list(corners), numbers)
        return (
            np.asarray(points, np.float32).reshape(-1, 3),
            np.asarray(pixels, np.float32).reshape(-1, 2),
        )


@dataclass(frozen=True, slots=True)
class Fit:
    """A calibration and its residual error."""

    calibration: Calibration
    rms_px: float
    used: int
    """Number of images used."""

    @property
    def is_doubtful(self) -> bool:
        """Whether the residual is too large for one rigid board and lens."""
        return self.rms_px > HIGH_RMS * self.calibration.width_px


def calibrate_lens(images: Sequence[Image], board: Board) -> Fit:
    """Fit focal lengths, principal point and distortion to images of a board.

    Args:
        images: of one size, with the board held at different tilts.
        board: its pattern.

    Raises:
        CalibrationError: the images differ in size, show the board too rarely, or always at
            the same tilt.
        SettingsError: the fit is no plausible camera.
    """
    sizes = {image.shape[:2] for image in images}
    if len(sizes) != 1:
        raise CalibrationError(f"the images must be of one size; they are of {sorted(sizes)}")
    ((height_px, width_px),) = sizes
    found = [pair for image in images if (pair := board.find(_grey(image))) is not None]
    if len(found) < MIN_PICTURES:
        raise CalibrationError(
            f"the board was found in {len(found)} of {len(images)} images; "
            f"{MIN_PICTURES} are needed, 10 or more are good (of a chessboard the inner corners "
            f"are counted, of a ChArUco board the squares)"
        )
    rms_px, matrix, distortion, turns, _ = cv2.calibrateCamera(
        [points for points, _ in found],
        [pixels for _, pixels in found],
        (width_px, height_px),
        np.eye(3),
        np.zeros(5),
    )
    normals = np.array([cv2.Rodrigues(turn)[0][:, 2] for turn in turns])
    tilt = math.acos(np.clip((normals @ normals.T).min(), -1.0, 1.0))
    if tilt < MIN_TILT:
        raise CalibrationError(
            f"the board is held almost the same way in all images, tilted by "
            f"{math.degrees(tilt):.0f} degrees at most from one to another; that leaves the lens "
            f"open: tilt it by 20 degrees and more, to every side"
        )
    return Fit(
        _checked(
            width_px=width_px,
            height_px=height_px,
            focal_x_px=float(matrix[0, 0]),
            focal_y_px=float(matrix[1, 1]),
            # OpenCV counts from the middle of the first pixel.
            principal_x_px=float(matrix[0, 2]) + 0.5,
            principal_y_px=float(matrix[1, 2]) + 0.5,
            distortion=[float(value) for value in np.ravel(distortion)[:5]],
        ),
        rms_px=float(rms_px),
        used=len(found),
    )


def mount_by_board(lens: Calibration, image: Image, board: Board, lowest_m: float) -> Fit:
    """Fit height, pitch and yaw to one image of the board upright, straight ahead of the camera.

    Args:
        lens: the result of `calibrate_lens`.
        image: of the board.
        board: its pattern.
        lowest_m: height of its lowest inner corners over the road.

    Raises:
        CalibrationError: the board was not found, or the image is of another size.
    """
    height_px, width_px = image.shape[:2]
    if (width_px, height_px) != (lens.width_px, lens.height_px):
        raise CalibrationError(
            f"the image of the board upright is {width_px} x {height_px} px, and those of the "
            f"lens are {lens.width_px} x {lens.height_px}"
        )
    found = board.find(_grey(image))
    if found is None:
        raise CalibrationError("the board was not found in the image of it upright")
    points, pixels = found
    matrix = np.array(
        [
            [lens.focal_x_px, 0.0, lens.principal_x_px],
            [0.0, lens.focal_y_px, lens.principal_y_px],
            [0.0, 0.0, 1.0],
        ]
    )
    _, rotation, translation = cv2.solvePnP(points, pixels + 0.5, matrix, np.array(lens.distortion))
    turned, _ = cv2.Rodrigues(rotation)
    in_camera = points @ turned.T + np.ravel(translation)
    # The board's own vertical, for any order of its corners.
    down = max((*turned.T[:2], *-turned.T[:2]), key=lambda axis: float(axis[1]))
    pitch_rad = math.atan2(down[2], down[1])
    below_m = in_camera @ (0.0, math.cos(pitch_rad), math.sin(pitch_rad))
    lowest = below_m > below_m.max() - 1e-3
    middle = in_camera.mean(axis=0)
    away_m = middle[2] * math.cos(pitch_rad) - middle[1] * math.sin(pitch_rad)
    reprojected, _ = cv2.projectPoints(
        points, rotation, translation, matrix, np.array(lens.distortion)
    )
    errors = np.asarray(reprojected).reshape(-1, 2) - pixels - 0.5
    return Fit(
        _mounted(
            lens,
            float(below_m[lowest].mean()) + lowest_m,
            pitch_rad,
            -math.atan2(middle[0], away_m),
        ),
        rms_px=float(np.sqrt((errors**2).sum(axis=1).mean())),
        used=1,
    )


def calibrate_by_plates(
    size_px: tuple[int, int],
    plates: Sequence[tuple[float, Corners]],
    width_m: float,
    height_m: float,
) -> Fit:
    """Fit focal length, height, pitch and yaw to one plate straight ahead at known distances.

    Args:
        size_px: width and height of the images.
        plates: distance from the camera in m, and corners of the plate, for each image.
        width_m: width of the plate.
        height_m: height of its middle over the road.

    Raises:
        CalibrationError: there are too few distances, or the corners do not fit them.
    """
    if len({distance_m for distance_m, _ in plates}) < MIN_DISTANCES:
        raise CalibrationError(f"the plate must be projected at {MIN_DISTANCES} distances or more")
    width_px, height_px = size_px
    distances_m = np.array([distance_m for distance_m, _ in plates])
    corners = np.array([each for _, each in plates], np.float64)
    centre = np.array([width_px / 2, height_px / 2])
    middles = corners.mean(axis=1) - centre
    widths = np.linalg.norm(corners[:, 1] - corners[:, 0], axis=1)
    widths = (widths + np.linalg.norm(corners[:, 2] - corners[:, 3], axis=1)) / 2

    def errors_px(unknown: _Unknowns) -> _Unknowns:
        focal, drop, pitch, yaw, beside = unknown
        away = distances_m * np.cos(yaw) + beside * np.sin(yaw)
        across = beside * np.cos(yaw) - distances_m * np.sin(yaw)
        depth = drop * np.sin(pitch) + away * np.cos(pitch)
        down = drop * np.cos(pitch) - away * np.sin(pitch)
        projected = (focal * width_m / depth, focal * across / depth, focal * down / depth)
        return np.concatenate(
            [projected[0] - widths, projected[1] - middles[:, 0], projected[2] - middles[:, 1]]
        )

    start = np.array([np.median(widths * distances_m) / width_m, 0.7, 0.0, 0.0, 0.0])
    fitted = _least_squares(errors_px, start, np.array([1000.0, 1.0, 0.1, 0.1, 1.0]))
    focal, drop, pitch, yaw, _ = (float(value) for value in fitted)
    rms_px = float(np.sqrt(np.mean(errors_px(fitted) ** 2)))
    if rms_px > MAX_ERROR * np.median(widths):
        raise CalibrationError(
            f"the plates do not fit their distances: they are off by {rms_px:.0f} px, and "
            f"{np.median(widths):.0f} px wide; are the images in the order of the distances?"
        )
    lens = _checked(
        width_px=width_px,
        height_px=height_px,
        focal_x_px=focal,
        focal_y_px=focal,
        principal_x_px=width_px / 2,
        principal_y_px=height_px / 2,
    )
    return Fit(_mounted(lens, drop + height_m, pitch, yaw), rms_px, len(plates))


def _least_squares(
    errors_of: Callable[[_Unknowns], _Unknowns], start: _Unknowns, scale: _Unknowns
) -> _Unknowns:
    """Minimise the sum of squared errors (Levenberg 1944, Marquardt 1963).

    Args:
        errors_of: errors for some values of the unknowns.
        start: initial values.
        scale: a large change of each unknown.
    """
    at, errors, damping = start, errors_of(start), 1e-3
    for _ in range(_MAX_ITERATIONS):
        steps = np.diag(1e-6 * scale)
        slopes = np.stack([(errors_of(at + step) - errors) / 1e-6 for step in steps], axis=1)
        damped = np.vstack([slopes, math.sqrt(damping) * np.eye(len(at))])
        change = np.linalg.lstsq(damped, np.concatenate([-errors, np.zeros(len(at))]))[0]
        tried = errors_of(at + change * scale)
        if tried @ tried < errors @ errors:
            at, errors, damping = at + change * scale, tried, damping / 10
        else:
            damping *= 10
        if np.abs(change).max() < _MIN_CHANGE:
            break
    return at


def _mounted(lens: Calibration, height_m: float, pitch_rad: float, yaw_rad: float) -> Calibration:
    place = {"mounting_height_m": height_m, "pitch_rad": pitch_rad, "yaw_rad": yaw_rad}
    return _checked(**(lens.model_dump() | place))


def _checked(**values: object) -> Calibration:
    return parse_settings(values, Calibration, "the images give")


def _grey(image: Image) -> Image:
    return np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), np.uint8)
