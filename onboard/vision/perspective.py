"""Projection between pixels and metres: a pinhole camera over a flat road.

Coordinates of the vehicle: `ahead_m` along its heading, `right_m` to its right, both from the
camera, and `height_m` over the road. Those of the camera: x right, y down, z along the optical
axis. The camera is pitched down by theta and turned right by psi, so a point `down` below it is at

    z' = ahead cos(psi) + right sin(psi)          x = right cos(psi) - ahead sin(psi)
    y  = down cos(theta) - z' sin(theta)          z = down sin(theta) + z' cos(theta)
    u  = c_x + f_x x / z                          v = c_y + f_y y / z

(Hartley and Zisserman, Multiple View Geometry, section 6.1.)
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from onboard.observations import ImageBox
from onboard.vision.settings import Calibration

Corners = npt.NDArray[np.float32]
"""(4, 2): top left, top right, bottom right, bottom left, in pixels."""


_UNTIL_EXACT = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 40, 1e-6)
"""Undistortion has no closed form; OpenCV's default of five iterations leaves errors at the rim."""
_IDENTITY = np.eye(3)
_FAR_M = 1e6


@dataclass(frozen=True, slots=True)
class RoadPosition:
    """Position relative to the camera, with its height over the road."""

    ahead_m: float
    right_m: float
    height_m: float


class Perspective:
    """Projection of a camera with one calibration."""

    def __init__(self, calibration: Calibration) -> None:
        self._calibration = calibration
        self._matrix = np.array(
            [
                [calibration.focal_x_px, 0.0, calibration.principal_x_px],
                [0.0, calibration.focal_y_px, calibration.principal_y_px],
                [0.0, 0.0, 1.0],
            ]
        )
        self._distortion = np.array(calibration.distortion)
        # Rows: right, down, ahead of the vehicle; columns: x, y, z of the camera.
        cos_p, sin_p = math.cos(calibration.pitch_rad), math.sin(calibration.pitch_rad)
        cos_y, sin_y = math.cos(calibration.yaw_rad), math.sin(calibration.yaw_rad)
        self._to_car = np.array(
            [
                [cos_y, -sin_p * sin_y, cos_p * sin_y],
                [0.0, cos_p, sin_p],
                [-sin_y, -sin_p * cos_y, cos_p * cos_y],
            ]
        )

    @property
    def mounting_height_m(self) -> float:
        """Height of the lens over the road."""
        return self._calibration.mounting_height_m

    @property
    def straight_ahead_px(self) -> tuple[float, float]:
        """Pixel (u, v) of what is far away where the vehicle heads, at the height of the lens."""
        return self.project(RoadPosition(_FAR_M, 0.0, 0.0))

    def project(self, position: RoadPosition) -> tuple[float, float]:
        """Pixel (u, v) of a position in front of the camera."""
        u_px, v_px = self.project_all([position])[0]
        return float(u_px), float(v_px)

    def project_all(self, positions: Sequence[RoadPosition]) -> npt.NDArray[np.float64]:
        """Pixels (n, 2) of positions in front of the camera."""
        camera_m = self._calibration.mounting_height_m
        in_car = np.array([(at.right_m, camera_m - at.height_m, at.ahead_m) for at in positions])
        pixels, _ = cv2.projectPoints(
            (in_car @ self._to_car).reshape(-1, 1, 3),
            np.zeros(3),
            np.zeros(3),
            self._matrix,
            self._distortion,
        )
        return np.asarray(pixels, np.float64)[:, 0]

    def width_px(self, width_m: float, ahead_m: float) -> float:
        """Width in pixels of an upright object at that distance."""
        return self._calibration.focal_x_px * width_m / ahead_m

    def locate_upright(self, corners_px: Corners, width_m: float) -> RoadPosition:
        """Middle of a plate or tag `width_m` wide that is perpendicular to the vehicle's heading.

        All of it is equally far ahead, so the ratio of its width to that distance is the difference
        of its ends' slopes.
        """
        slopes = self._slopes(corners_px)
        upper, lower = slopes[1] - slopes[0], slopes[2] - slopes[3]
        width = (math.hypot(*upper) + math.hypot(*lower)) / 2
        ahead_m = width_m / max(width, 1e-9)
        right, down = slopes.mean(axis=0)
        height_m = self._calibration.mounting_height_m - ahead_m * float(down)
        return RoadPosition(ahead_m, ahead_m * float(right), height_m)

    def locate_widths(
        self, corners_px: Corners, widths_m: Sequence[float]
    ) -> dict[float, RoadPosition]:
        """Position as by `locate_upright`, for each possible width."""
        unit = self.locate_upright(corners_px, 1.0)
        lens_m = self._calibration.mounting_height_m
        return {
            width_m: RoadPosition(
                width_m * unit.ahead_m,
                width_m * unit.right_m,
                lens_m + width_m * (unit.height_m - lens_m),
            )
            for width_m in widths_m
        }

    def locate_on_road(self, u_px: float, v_px: float) -> RoadPosition | None:
        """Position on the road at a pixel; `None` at and above the horizon."""
        right, down = self._slopes(np.array([[u_px, v_px]], np.float32))[0]
        if down < 1e-3:
            return None
        ahead_m = self._calibration.mounting_height_m / float(down)
        return RoadPosition(ahead_m, ahead_m * float(right), 0.0)

    def shape(self, corners_px: Corners) -> float:
        """Width divided by height of a plate that faces the camera."""
        top_left, top_right, bottom_right, bottom_left = self._slopes(corners_px)
        width = math.hypot(*(top_right - top_left)) + math.hypot(*(bottom_right - bottom_left))
        height = math.hypot(*(bottom_left - top_left)) + math.hypot(*(bottom_right - top_right))
        return width / max(height, 1e-9)

    def _slopes(self, points_px: npt.NDArray[np.float32]) -> npt.NDArray[np.float64]:
        """Slopes (n, 2) of each point's ray: right and down per metre ahead."""
        points = np.asarray(points_px, np.float64).reshape(-1, 1, 2)
        undistorted = cv2.undistortPointsIter(
            points, self._matrix, self._distortion, _IDENTITY, _IDENTITY, _UNTIL_EXACT
        )
        rays = undistorted[:, 0] @ self._to_car[:, :2].T + self._to_car[:, 2]
        return np.asarray(rays[:, :2] / rays[:, 2:], np.float64)


def bounding_box(corners_px: Corners) -> ImageBox:
    """The upright rectangle around corners."""
    columns, rows = corners_px.T.tolist()  # numpy takes longer for so few
    left, top = min(columns), min(rows)
    return ImageBox(left, top, max(columns) - left, max(rows) - top)
