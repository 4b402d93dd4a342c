"""Boxes by a detector of the user's: an ONNX model, as the YOLO family exports it."""

import cv2
import numpy as np
import numpy.typing as npt

from onboard.errors import UserError
from onboard.observations import ImageBox
from onboard.vision.settings import BoxModelSettings

_GREY = (114, 114, 114)
"""Fill colour beside an image of another aspect ratio, as in the training of such models."""
_MIN_OVERLAP = 0.5
"""Intersection over union from which two boxes are one object."""


class BoxModel:
    """Runs the model on one image at a time; not to be shared between threads."""

    def __init__(self, settings: BoxModelSettings, name: str) -> None:
        """Load the model; `name` is its settings' place in the configuration.

        Raises:
            UserError: it is missing, not a model that OpenCV can run, or its output does not
                have the format of `settings`.
        """
        self._name = name
        self._settings = settings
        if not settings.file.is_file():
            raise UserError(f"{name}.file: {settings.file}: no such file")
        try:
            self._network = cv2.dnn.readNetFromONNX(str(settings.file))
        except cv2.error as error:
            raise UserError(f"{name}.file: {settings.file}: not a model: {error.err}") from error
        width, height = settings.input_width_px, settings.input_height_px
        try:
            self.find(np.zeros((height, width, 3), np.uint8))
        except cv2.error as error:
            raise UserError(
                f"{name}: {settings.file}: cannot run on an input of {width} x {height} px "
                f"(input_width_px, input_height_px): {error.err}"
            ) from error

    def find(self, image: npt.NDArray[np.uint8]) -> list[tuple[ImageBox, float]]:
        """Boxes in an (h, w, 3) BGR image and their scores, highest score first."""
        width, height = self._settings.input_width_px, self._settings.input_height_px
        scale = min(width / image.shape[1], height / image.shape[0])
        size = (max(1, round(image.shape[1] * scale)), max(1, round(image.shape[0] * scale)))
        fitted = np.full((height, width, 3), _GREY, np.uint8)
        fitted[: size[1], : size[0]] = cv2.resize(image, size, interpolation=cv2.INTER_AREA)
        self._network.setInput(cv2.dnn.blobFromImage(fitted, 1 / 255.0, swapRB=True))
        boxes, scores = self._boxes(np.asarray(self._network.forward(), np.float32))
        kept = cv2.dnn.NMSBoxes(
            boxes.tolist(), scores.tolist(), self._settings.least_score, _MIN_OVERLAP
        )
        return [
            (ImageBox(*(float(value) / scale for value in boxes[index])), float(scores[index]))
            for index in kept
        ]

    def _boxes(
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
                f"{self._name}: output of shape {output.shape}, but (1, rows, "
                f"{least_values} values or more) fits has_objectness and classes"
            )
        columns = [first_class + number for number in self._settings.classes]
        scores = rows[:, columns].max(axis=1)
        if self._settings.has_objectness:
            scores = scores * rows[:, 4]
        sides = rows[:, 2:4]
        return np.hstack([rows[:, :2] - sides / 2, sides]), scores
