"""Detections of vehicles, by a model of the user's.

A vehicle's distance is measured twice: by its width, which differs between vehicles, and by the
point where it meets the road, which moves with the host vehicle's pitch. Both are combined,
weighted by their inverse variances.
"""

import math

import numpy as np
import numpy.typing as npt

from onboard.observations import ImageBox
from onboard.vision.box_model import BoxModel
from onboard.vision.detection import Detection, DetectionKind, SearchPlan
from onboard.vision.perspective import Perspective, RoadPosition

WIDTH_M = 1.8
"""Width of a common car."""
WIDTH_SIGMA = 0.1
"""Relative sigma of the width of cars."""
PITCH_SIGMA_RAD = 0.01
"""Sigma of the host vehicle's pitch while it moves, with the slope of the road."""
EDGE_SIGMA_PX = 2.0
"""Sigma of a box's sides."""


class VehicleBoxDetector:
    """Detects vehicles in each n-th frame."""

    def __init__(self, detector: BoxModel, every_n_frames: int, perspective: Perspective) -> None:
        """Start with the next frame.

        Args:
            detector: finds the boxes.
            every_n_frames: frames for each one that the detector runs on.
            perspective: of the camera.
        """
        self._detector = detector
        self._every_n_frames = every_n_frames
        self._perspective = perspective
        self._frames = 0

    def find(
        self,
        image: npt.NDArray[np.uint8],
        plan: SearchPlan,  # noqa: ARG002 (the model always runs on the whole frame)
    ) -> list[Detection]:
        """Vehicles in an (h, w, 3) BGR image."""
        self._frames += 1
        if (self._frames - 1) % self._every_n_frames:
            return []
        return [self._detection(box) for box, _ in self._detector.find(image)]

    def _detection(self, box: ImageBox) -> Detection:
        left, right = box.x_px, box.x_px + box.w_px
        top, bottom = box.y_px, box.y_px + box.h_px
        corners = np.array([(left, top), (right, top), (right, bottom), (left, bottom)], np.float32)
        by_width = self._perspective.locate_upright(corners, WIDTH_M)
        share = math.hypot(WIDTH_SIGMA, 1.4 * EDGE_SIGMA_PX / max(box.w_px, 1.0))
        ahead_m, variance = by_width.ahead_m, (share * by_width.ahead_m) ** 2
        foot = self._perspective.locate_on_road((left + right) / 2, bottom)
        if foot is not None:
            # The ray descends by height / distance: an error of that slope counts distance times.
            slope_sigma = math.hypot(
                PITCH_SIGMA_RAD, EDGE_SIGMA_PX / self._perspective.width_px(1.0, 1.0)
            )
            foot_sigma_m = slope_sigma * foot.ahead_m**2 / self._perspective.mounting_height_m
            weight = variance / (variance + foot_sigma_m**2)
            ahead_m += weight * (foot.ahead_m - ahead_m)
            variance *= 1.0 - weight
        right_m = by_width.right_m * ahead_m / by_width.ahead_m
        sigma_m = math.sqrt(variance)
        return Detection(
            kind=DetectionKind.VEHICLE,
            corners_px=corners,
            position=RoadPosition(ahead_m, right_m, by_width.height_m),
            ahead_sigma_m=sigma_m,
            right_sigma_m=math.hypot(0.05 * WIDTH_M, sigma_m * right_m / ahead_m),
        )
