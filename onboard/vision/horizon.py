"""Whether a vehicle ahead would be seen: the horizon before the host vehicle is sharp.

A camera is about as high as a car, so every vehicle ahead stands across the horizon, where a clear
picture shows edges of trees, houses, barriers and of the road's end. Dirt on a lens or windscreen
is out of focus; behind it, as in fog and in a blurred picture, these edges are gone.
"""

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from onboard.vision.blur import DETAIL_PX
from onboard.vision.lane import LaneShape
from onboard.vision.perspective import Perspective, RoadPosition

DISTANCES = (3.5, 8.0, 18.0)
"""Distances ahead at which the lane's sides bound what is examined, in lane widths (12 to 63 m)."""
HALF_HEIGHT_RAD = 0.045
"""Half height of what is examined: the host vehicle pitches, and roads are not level."""
COLUMNS = 10
"""Parts side by side, each about as wide as a vehicle 60 m ahead."""
LEAST_EDGE = 0.2
"""Largest step between two pixels by their surroundings' level, from which a part is sharp. In all
of 60 clear frames of gantries, small-leads and motorway, each part has 0.28 and more; chosen by
these. In frames of the other clips and in the labelled photographs it is 0.21 and more; with thirty
smears before them in half of all at most 0.08, and 0.13 in a blur of three pixels."""
_LEVEL = 16.0
"""Level that is added, below which steps are noise."""
_AROUND_PX = 9


@dataclass(frozen=True, slots=True)
class HorizonPart:
    """One of the parts side by side."""

    x_px: float
    """Its middle."""
    edge: float
    """Largest step between two pixels, by their surroundings' level."""
    level: float
    """Mean grey level."""

    @property
    def is_sharp(self) -> bool:
        """Whether it shows edges."""
        return self.edge >= LEAST_EDGE


class Horizon:
    """Judges one camera's images."""

    def __init__(self, perspective: Perspective, lane_width_m: float) -> None:
        """Take the camera, and the width of a common lane in m."""
        self._perspective = perspective
        self._lane_width_m = lane_width_m
        self._half_px = HALF_HEIGHT_RAD * perspective.width_px(1.0, 1.0)

    def is_sharp(self, image: npt.NDArray[np.uint8], lane: LaneShape) -> bool:
        """Whether the horizon over the lane shows edges everywhere.

        Args:
            image: (h, w, 3), BGR.
            lane: the host vehicle's.
        """
        parts = self.parts(image, lane)
        return bool(parts) and all(part.is_sharp for part in parts)

    def parts(self, image: npt.NDArray[np.uint8], lane: LaneShape) -> list[HorizonPart]:
        """The horizon over the lane from left to right; empty if too little of it is seen.

        Args:
            image: (h, w, 3), BGR.
            lane: the host vehicle's.
        """
        left, top, right, bottom = self._sides(image.shape, lane)
        scale = min(1.0, DETAIL_PX / image.shape[1])
        columns = int(scale * (right - left)) // COLUMNS
        rows = int(scale * (bottom - top))
        if columns < 2 or rows < 2:
            return []
        grey = cv2.cvtColor(image[top:bottom, left:right], cv2.COLOR_BGR2GRAY)
        size = columns * COLUMNS, rows
        levels = np.asarray(cv2.resize(grey, size, interpolation=cv2.INTER_AREA), np.float32)
        steps = _steps(levels) / (cv2.blur(levels, (_AROUND_PX, _AROUND_PX)) + _LEVEL)
        largest = steps.reshape(rows, COLUMNS, columns).max(axis=(0, 2))
        means = levels.reshape(rows, COLUMNS, columns).mean(axis=(0, 2))
        middles_px = left + (right - left) * (np.arange(COLUMNS) + 0.5) / COLUMNS
        return [
            HorizonPart(float(x_px), float(edge), float(level))
            for x_px, edge, level in zip(middles_px, largest, means, strict=True)
        ]

    def _sides(self, shape: tuple[int, ...], lane: LaneShape) -> tuple[int, int, int, int]:
        """Left, top, right and bottom of what is around the horizon, as wide as the lane."""
        sides = [
            RoadPosition(ahead_m, lane.middle_m(ahead_m) + share * self._lane_width_m, 0.0)
            for ahead_m in (self._lane_width_m * distance for distance in DISTANCES)
            for share in (-0.5, 0.5)
        ]
        across = self._perspective.project_all(sides)[:, 0]
        _, middle_px = self._perspective.project(RoadPosition(1e6, 0.0, 0.0))
        height, width = shape[:2]
        left, right = np.clip((across.min(), across.max()), 0, width)
        top, bottom = np.clip((middle_px - self._half_px, middle_px + self._half_px), 0, height)
        return int(left), int(top), int(right), int(bottom)


def _steps(levels: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    """The larger of the steps to the next pixel below and to the right."""
    steps = np.zeros_like(levels)
    steps[:-1] = np.abs(np.diff(levels, axis=0))
    steps[:, :-1] = np.maximum(steps[:, :-1], np.abs(np.diff(levels, axis=1)))
    return steps
