"""Boxes by a detector of the user's: an ONNX model of one of the usual layouts."""

import cv2
import numpy as np
import numpy.typing as npt

from onboard.errors import UserError
from onboard.observations import ImageBox
from onboard.vision.box_layouts import Boxes, LayoutError, boxes, network_input
from onboard.vision.network import NETWORK_ERRORS, Network
from onboard.vision.settings import BoxModelSettings

_GREY = (114, 114, 114)
"""Fill colour beside an image of another aspect ratio, as in the training of such models."""
LARGEST_BYTES = 400_000_000
"""Size of a file above which it is not loaded: the largest of the YOLOX family has 396 MB."""
_MIN_OVERLAP = 0.5
"""Intersection over union from which two boxes are one object."""
MOST_BOXES = 1000
"""Boxes that are compared with each other, those with the highest scores: a street has some ten."""


class BoxModel:
    """Runs the model on one image at a time; not to be shared between threads."""

    def __init__(self, settings: BoxModelSettings, name: str) -> None:
        """Load the model; `name` is its settings' place in the configuration.

        Raises:
            UserError: it is missing, not a model that can be run, or its output does not have the
                format of `settings`.
        """
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
        except LayoutError as error:
            raise UserError(f"{name}.layout: {error}") from error
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
        outputs = self._network.run(network_input(fitted, self._settings))
        found = _likeliest(boxes(outputs, self._settings))
        kept = cv2.dnn.NMSBoxes(
            found.sides.tolist(), found.scores.tolist(), self._settings.least_score, _MIN_OVERLAP
        )
        return [
            (ImageBox(*(float(side) / scale for side in found.sides[at])), float(found.scores[at]))
            for at in kept
        ]


def _likeliest(found: Boxes) -> Boxes:
    best = np.argsort(-found.scores, kind="stable")[:MOST_BOXES]
    return Boxes(found.sides[best], found.scores[best])
