"""Plates by a model of the user's, with corners by the shipped detector."""

import numpy as np
import numpy.typing as npt

from onboard.observations import ImageBox
from onboard.vision.box_model import BoxModel
from onboard.vision.perspective import Corners
from onboard.vision.plate_detector import PlateDetection, PlateDetector


class ExternalPlateDetector:
    """Finds plates as `PlateDetector` does."""

    def __init__(self, model: BoxModel, own: PlateDetector) -> None:
        """Take both detectors; `own` finds the corners in each box of `model`."""
        self._model = model
        self._own = own

    def find(
        self, image: npt.NDArray[np.uint8], region: ImageBox | None = None
    ) -> list[PlateDetection]:
        """Plates in the image, or in `region` of it, highest score first."""
        left = top = 0
        if region is not None:
            left, top = max(0, int(region.x_px)), max(0, int(region.y_px))
            right, bottom = int(region.x_px + region.w_px + 1), int(region.y_px + region.h_px + 1)
            image = image[: max(0, bottom), : max(0, right)]
        part = image[top:, left:]
        if part.size == 0:
            return []
        plates = []
        for box, score in self._model.find(part):
            x0, y0 = box.x_px + left, box.y_px + top
            x1, y1 = x0 + box.w_px, y0 + box.h_px
            corners = np.asarray([(x0, y0), (x1, y0), (x1, y1), (x0, y1)], np.float32)
            again = self._own.find_again(image, corners)
            plates.append(PlateDetection(again.corners_px if again is not None else corners, score))
        return plates

    def find_again(self, image: npt.NDArray[np.uint8], last: Corners) -> PlateDetection | None:
        """The plate that was at `last` in the frame before, by the shipped detector."""
        return self._own.find_again(image, last)
