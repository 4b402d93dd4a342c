"""Vehicles by a model that the user brings, in ONNX as the YOLO family exports it.

A vehicle's distance shows in two ways: by its width, which differs from car to car, and by the
place where it meets the road, which the pitching of the own car moves. Both are taken, weighted by
their variances.
"""

import math

import cv2
import numpy as np
import numpy.typing as npt

from onboard.errors import UserError
from onboard.observations import Box
from onboard.vision.perspective import Perspective, Place
from onboard.vision.settings import VehicleModelSettings
from onboard.vision.sighting import Cue, Search, Sighting

WIDTH_SIGMA = 0.1
"""Of the width of cars, as a share of it."""
PITCH_SIGMA_RAD = 0.01
"""Of the own car's pitch while it drives, with the road's own slope."""
EDGE_SIGMA_PX = 2.0
"""Of a box's sides."""
_GREY = (114, 114, 114)
"""What such models were trained to see beside a picture of another shape."""
_LEAST_OVERLAP = 0.5
"""Boxes that share so much are one vehicle."""


class VehicleDetector:
    """Runs the model on one picture after the other."""

    def __init__(self, settings: VehicleModelSettings) -> None:
        """Load the model.

        Raises:
            UserError: it is missing, not a model that OpenCV can run, or its output is not as
                `settings` say.
        """
        if not settings.file.is_file():
            raise UserError(f"vision.vehicle_model.file: {settings.file}: no such file")
        try:
            self._network = cv2.dnn.readNetFromONNX(str(settings.file))
        except cv2.error as error:
            raise UserError(
                f"vision.vehicle_model.file: {settings.file}: not a model: {error.err}"
            ) from error
        self._settings = settings
        self.find(np.zeros((settings.input_height_px, settings.input_width_px, 3), np.uint8))

    def find(self, image: npt.NDArray[np.uint8]) -> list[Box]:
        """Vehicles in an (h, w, 3) BGR picture, the surest first."""
        width, height = self._settings.input_width_px, self._settings.input_height_px
        scale = min(width / image.shape[1], height / image.shape[0])
        size = (max(1, round(image.shape[1] * scale)), max(1, round(image.shape[0] * scale)))
        fitted = np.full((height, width, 3), _GREY, np.uint8)
        fitted[: size[1], : size[0]] = cv2.resize(image, size, interpolation=cv2.INTER_AREA)
        self._network.setInput(cv2.dnn.blobFromImage(fitted, 1 / 255.0, swapRB=True))
        boxes, scores = self._vehicles(np.asarray(self._network.forward(), np.float32))
        kept = cv2.dnn.NMSBoxes(
            boxes.tolist(), scores.tolist(), self._settings.least_score, _LEAST_OVERLAP
        )
        return [Box(*(float(value) / scale for value in boxes[index])) for index in kept]

    def _vehicles(
        self, output: npt.NDArray[np.float32]
    ) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.float32]]:
        """(n, 4) left, top, width, height in input pixels, and (n,) scores."""
        first_class = 5 if self._settings.has_objectness else 4
        least_values = first_class + max(self._settings.classes) + 1
        rows = output[0] if output.ndim == 3 else np.zeros((0, 0), np.float32)
        if rows.shape[1] > rows.shape[0]:
            rows = rows.T
        if rows.shape[1] < least_values:
            raise UserError(
                f"vision.vehicle_model: output of shape {output.shape}, but (1, rows, "
                f"{least_values} values or more) fits has_objectness and classes"
            )
        columns = [first_class + number for number in self._settings.classes]
        scores = rows[:, columns].max(axis=1)
        if self._settings.has_objectness:
            scores = scores * rows[:, 4]
        sides = rows[:, 2:4]
        return np.hstack([rows[:, :2] - sides / 2, sides]), scores


class Vehicles:
    """Vehicles as sightings, in each n-th picture."""

    def __init__(
        self, detector: VehicleDetector, settings: VehicleModelSettings, perspective: Perspective
    ) -> None:
        self._detector = detector
        self._settings = settings
        self._perspective = perspective
        self._frames = 0

    def find(
        self,
        image: npt.NDArray[np.uint8],
        search: Search,  # noqa: ARG002 (the model always looks at all of the picture)
    ) -> list[Sighting]:
        """Vehicles in the picture."""
        self._frames += 1
        if (self._frames - 1) % self._settings.every_n_frames:
            return []
        return [self._sighting(box) for box in self._detector.find(image)]

    def _sighting(self, box: Box) -> Sighting:
        left, right = box.x_px, box.x_px + box.w_px
        top, bottom = box.y_px, box.y_px + box.h_px
        corners = np.array([(left, top), (right, top), (right, bottom), (left, bottom)], np.float32)
        width_m = self._settings.vehicle_width_m
        by_width = self._perspective.locate_upright(corners, width_m)
        share = math.hypot(WIDTH_SIGMA, 1.4 * EDGE_SIGMA_PX / max(box.w_px, 1.0))
        ahead_m, variance = by_width.ahead_m, (share * by_width.ahead_m) ** 2
        foot = self._perspective.locate_on_road((left + right) / 2, bottom)
        if foot is not None:
            # The ray falls by height / distance: an error in that slope counts distance times.
            slope_sigma = math.hypot(
                PITCH_SIGMA_RAD, EDGE_SIGMA_PX / self._perspective.width_px(1.0, 1.0)
            )
            foot_sigma_m = slope_sigma * foot.ahead_m**2 / self._perspective.mounting_height_m
            weight = variance / (variance + foot_sigma_m**2)
            ahead_m += weight * (foot.ahead_m - ahead_m)
            variance *= 1.0 - weight
        right_m = by_width.right_m * ahead_m / by_width.ahead_m
        sigma_m = math.sqrt(variance)
        return Sighting(
            cue=Cue.VEHICLE,
            corners_px=corners,
            place=Place(ahead_m, right_m, by_width.height_m),
            ahead_sigma_m=sigma_m,
            right_sigma_m=math.hypot(0.05 * width_m, sigma_m * right_m / ahead_m),
        )
