"""Boxes by a detector of the user's: an ONNX model, as the YOLO family exports it."""

import cv2
import numpy as np
import numpy.typing as npt

from onboard.errors import UserError
from onboard.observations import ImageBox
from onboard.vision.network import NETWORK_ERRORS, Network
from onboard.vision.settings import BoxModelSettings

_GREY = (114, 114, 114)
"""Fill colour beside an image of another aspect ratio, as in the training of such models."""
_STRIDES = (8, 16, 32)
"""Sides of the cells of YOLOX in pixels of its input (Ge et al. 2021)."""
LARGEST_BYTES = 400_000_000
"""Size of a file above which it is not loaded: the largest of the YOLOX family has 396 MB."""
_MIN_OVERLAP = 0.5
"""Intersection over union from which two boxes are one object."""


class BoxModel:
    """Runs the model on one image at a time; not to be shared between threads."""

    def __init__(self, settings: BoxModelSettings, name: str) -> None:
        """Load the model; `name` is its settings' place in the configuration.

        Raises:
            UserError: it is missing, not a model that can be run, or its output does not
                have the format of `settings`.
        """
        self._name = name
        self._settings = settings
        if not settings.file.is_file():
            raise UserError(f"{name}.file: {settings.file}: no such file")
        if settings.file.stat().st_size > LARGEST_BYTES:
            raise UserError(
                f"{name}.file: {settings.file}: has {settings.file.stat().st_size:,} bytes, "
                f"but at most {LARGEST_BYTES:,} are allowed"
            )
        try:
            self._network = Network(settings.file)
        except NETWORK_ERRORS as error:
            raise UserError(f"{name}.file: {settings.file}: not a model: {error}") from error
        width, height = settings.input_width_px, settings.input_height_px
        try:
            self.find(np.zeros((height, width, 3), np.uint8))
        except NETWORK_ERRORS as error:
            raise UserError(
                f"{name}: {settings.file}: cannot run on an input of {width} x {height} px "
                f"(input_width_px, input_height_px): {error}"
            ) from error

    def find(self, image: npt.NDArray[np.uint8]) -> list[tuple[ImageBox, float]]:
        """Boxes in an (h, w, 3) BGR image and their scores, highest score first."""
        width, height = self._settings.input_width_px, self._settings.input_height_px
        scale = min(width / image.shape[1], height / image.shape[0])
        size = (max(1, round(image.shape[1] * scale)), max(1, round(image.shape[0] * scale)))
        fitted = np.full((height, width, 3), _GREY, np.uint8)
        fitted[: size[1], : size[0]] = cv2.resize(image, size, interpolation=cv2.INTER_AREA)
        is_yolox = self._settings.layout == "yolox"
        scaling = 1.0 if is_yolox else 1 / 255.0
        blob = cv2.dnn.blobFromImage(fitted, scaling, swapRB=not is_yolox)
        boxes, scores = self._boxes(self._network.run(np.asarray(blob, np.float32))[0])
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
        is_yolox = self._settings.layout == "yolox"
        has_objectness = self._settings.has_objectness or is_yolox
        first_class = 5 if has_objectness else 4
        least_values = first_class + max(self._settings.classes) + 1
        rows = output[0] if output.ndim == 3 else np.zeros((0, 0), np.float32)
        if rows.shape[1] > rows.shape[0]:
            rows = rows.T
        if rows.shape[1] < least_values:
            raise UserError(
                f"{self._name}: output of shape {output.shape}, but (1, rows, "
                f"{least_values} values or more) fits has_objectness and classes"
            )
        if is_yolox:
            rows = self._from_cells(rows)
        rows = rows[np.isfinite(rows).all(axis=1)]
        columns = [first_class + number for number in self._settings.classes]
        scores = rows[:, columns].max(axis=1)
        if has_objectness:
            scores = scores * rows[:, 4]
        sides = rows[:, 2:4]
        return np.hstack([rows[:, :2] - sides / 2, sides]), scores

    def _from_cells(self, rows: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
        """Rows of YOLOX with centres and sides in input pixels."""
        width, height = self._settings.input_width_px, self._settings.input_height_px
        cells = [
            (x * side, y * side, side)
            for side in _STRIDES
            for y in range(height // side)
            for x in range(width // side)
        ]
        if len(rows) != len(cells):
            raise UserError(
                f"{self._name}.layout: yolox has {len(cells)} rows for an input of {width} x "
                f"{height} px, but {self._settings.file} gives {len(rows)}"
            )
        corners = np.asarray(cells, np.float32)
        pixels = rows.copy()
        pixels[:, :2] = rows[:, :2] * corners[:, 2:] + corners[:, :2]
        pixels[:, 2:4] = np.exp(np.minimum(rows[:, 2:4], 10.0)) * corners[:, 2:]
        return pixels
