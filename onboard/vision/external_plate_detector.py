"""Plates by a model that the user brings, which gives boxes, and corners by the own detector."""

import numpy as np
import numpy.typing as npt

from onboard.observations import ImageBox
from onboard.vision.box_model import BoxModel
from onboard.vision.perspective import Corners
from onboard.vision.plate_detector import FoundPlate, PlateDetector


class BroughtPlates:
    """Finds plates as `PlateDetector` does."""

    def __init__(self, model: BoxModel, own: PlateDetector) -> None:
        """`own` looks at each box again: a reader and a distance need corners."""
        self._model = model
        self._own = own

    def find(
        self, image: npt.NDArray[np.uint8], region: ImageBox | None = None
    ) -> list[FoundPlate]:
        """Plates in the picture, or in `region` of it, the surest first."""
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
            plates.append(FoundPlate(again.corners_px if again is not None else corners, score))
        return plates

    def find_again(self, image: npt.NDArray[np.uint8], last: Corners) -> FoundPlate | None:
        """The plate that was at `last` in the picture before, by the own detector."""
        return self._own.find_again(image, last)
