"""From pixels to metres and back: a pinhole camera over a flat road.

Coordinates of the car: `ahead_m` along its heading, `right_m` to its right, both from the camera,
and `height_m` over the road. Those of the camera: x right, y down, z along the optical axis. The
camera is pitched down by theta and turned right by psi, so a point `down` below it lies at

    z' = ahead cos(psi) + right sin(psi)          x = right cos(psi) - ahead sin(psi)
    y  = down cos(theta) - z' sin(theta)          z = down sin(theta) + z' cos(theta)
    u  = c_x + f_x x / z                          v = c_y + f_y y / z

(Hartley and Zisserman, Multiple View Geometry, section 6.1.)
"""

import math
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from onboard.vision.settings import Calibration

Corners = npt.NDArray[np.float32]
"""(4, 2): top left, top right, bottom right, bottom left, in pixels."""


@dataclass(frozen=True, slots=True)
class Place:
    """Where something is, from the camera."""

    ahead_m: float
    right_m: float
    height_m: float


class Perspective:
    """The camera of one calibration."""

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
        # Rows: right, down, ahead of the car; columns: x, y, z of the camera.
        cos_p, sin_p = math.cos(calibration.pitch_rad), math.sin(calibration.pitch_rad)
        cos_y, sin_y = math.cos(calibration.yaw_rad), math.sin(calibration.yaw_rad)
        self._to_car = np.array(
            [
                [cos_y, -sin_p * sin_y, cos_p * sin_y],
                [0.0, cos_p, sin_p],
                [-sin_y, -sin_p * cos_y, cos_p * cos_y],
            ]
        )

    def project(self, place: Place) -> tuple[float, float]:
        """Pixel (u, v) of a place in front of the camera."""
        down_m = self._calibration.mounting_height_m - place.height_m
        in_camera = self._to_car.T @ (place.right_m, down_m, place.ahead_m)
        point, _ = cv2.projectPoints(
            in_camera.reshape(1, 1, 3), np.zeros(3), np.zeros(3), self._matrix, self._distortion
        )
        return float(point[0, 0, 0]), float(point[0, 0, 1])

    def width_px(self, width_m: float, ahead_m: float) -> float:
        """How wide something upright appears at that distance."""
        return self._calibration.focal_x_px * width_m / ahead_m

    def locate_upright(self, corners_px: Corners, width_m: float) -> Place:
        """Middle of a plate or tag `width_m` wide that faces the camera: z = f W / w."""
        undistorted = self._normalised(corners_px)
        upper = undistorted[1] - undistorted[0]
        lower = undistorted[2] - undistorted[3]
        width = (math.hypot(*upper) + math.hypot(*lower)) / 2
        middle = undistorted.mean(axis=0)
        return self._place(middle, width_m / max(width, 1e-9))

    def locate_on_road(self, u_px: float, v_px: float) -> Place | None:
        """The place on the road that the pixel shows; `None` at and above the horizon."""
        point = self._normalised(np.array([[u_px, v_px]], np.float32))[0]
        down = float(self._to_car[1] @ (*point, 1.0))
        if down < 1e-3:
            return None
        return self._place(point, self._calibration.mounting_height_m / down)

    def shape(self, corners_px: Corners) -> float:
        """Width by height of a plate that faces the camera."""
        top_left, top_right, bottom_right, bottom_left = self._normalised(corners_px)
        width = math.hypot(*(top_right - top_left)) + math.hypot(*(bottom_right - bottom_left))
        height = math.hypot(*(bottom_left - top_left)) + math.hypot(*(bottom_right - top_right))
        return width / max(height, 1e-9)

    def _normalised(self, points_px: npt.NDArray[np.float32]) -> npt.NDArray[np.float64]:
        """(n, 2) of x/z, y/z in the camera's coordinates."""
        points = np.asarray(points_px, np.float64).reshape(-1, 1, 2)
        undistorted = cv2.undistortPoints(points, self._matrix, self._distortion)
        return np.asarray(undistorted, np.float64)[:, 0]

    def _place(self, point: npt.NDArray[np.float64], depth_m: float) -> Place:
        right_m, down_m, ahead_m = depth_m * (self._to_car @ (*point, 1.0))
        height_m = self._calibration.mounting_height_m - float(down_m)
        return Place(float(ahead_m), float(right_m), height_m)
