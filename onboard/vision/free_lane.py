"""How far the host vehicle's lane is seen to be free: as far as it looks like the road before it.

Rows across the lane are followed from the bonnet towards the horizon. Asphalt changes slowly from
row to row; where a vehicle stands on it, its shadow and its rear do not (the shadow under a vehicle
is darker than any road: Tzomakas and von Seelen 1998, "Vehicle detection in traffic scenes using
shadows"). A shadow of a bridge, paint on the lane or darkness ends the free part too: then it is
unknown what is beyond.
"""

import cv2
import numpy as np
import numpy.typing as npt

from onboard.vision.lane import LaneShape
from onboard.vision.perspective import Perspective, RoadPosition

NEAREST, FARTHEST, ROWS = 2.2, 18.0, 40
"""Distances of the first row, beyond the bonnet, and of the last one, in lane widths (7.7 to 63 m),
and how many there are."""
HALF_WIDTH, COLUMNS = 0.28, 15
"""Half the width of a row in lane widths, inside the markings, and its samples."""
MIN_ROWS = 5
"""Rows in the image that are needed to know the road."""
LEAST_LEVEL = 32.0
"""Grey level below which nothing is seen: `STEP` hides what differs less. On a dense motorway with
0.2 and 0.3 of the light, the lane was free in 45 and 26 of 258 frames with 16, in none with 32."""
STEP, STEP_SHARE = 8.0, 0.12
"""Change from the road before, in grey levels and as a share of its level, that is no road."""
FOLLOWED = 0.25
"""Share by which the level of the road follows each row."""


class FreeLane:
    """Judges one camera's images."""

    def __init__(self, perspective: Perspective, lane_width_m: float) -> None:
        """Take the camera, and the width of a common lane in m."""
        self._perspective = perspective
        self._rows_m = lane_width_m * np.geomspace(NEAREST, FARTHEST, ROWS)
        self._across_m = lane_width_m * np.linspace(-HALF_WIDTH, HALF_WIDTH, COLUMNS)

    def free_until_m(self, image: npt.NDArray[np.uint8], lane: LaneShape) -> float:
        """Distance in m up to which the lane is seen to be free; 0 if nothing is seen.

        Args:
            image: (h, w, 3), BGR.
            lane: the host vehicle's.
        """
        levels, rows_m = self._levels(image, lane)
        if len(levels) < MIN_ROWS:
            return 0.0
        road = float(np.median(levels[:MIN_ROWS]))
        free_m = 0.0
        for level, row_m in zip(levels, rows_m, strict=True):
            if road < LEAST_LEVEL or abs(level - road) > max(STEP, STEP_SHARE * road):
                break
            road += FOLLOWED * (level - road)
            free_m = float(row_m)
        return free_m

    def _levels(
        self, image: npt.NDArray[np.uint8], lane: LaneShape
    ) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
        """Median grey level of each row that is in the image, and its distance."""
        places = [
            RoadPosition(ahead_m, lane.middle_m(ahead_m) + right_m, 0.0)
            for ahead_m in self._rows_m
            for right_m in self._across_m
        ]
        at = self._perspective.project_all(places).reshape(ROWS, COLUMNS, 2) - 0.5
        height, width = image.shape[:2]
        is_inside = ((at >= 0) & (at <= (width - 1, height - 1))).all(axis=(1, 2))
        at = at[is_inside].astype(np.float32)
        if not len(at):
            return np.zeros(0), np.zeros(0)
        colours = cv2.remap(image, at[..., 0], at[..., 1], cv2.INTER_LINEAR)
        grey = np.asarray(colours, np.float64).mean(axis=2)
        return np.median(grey, axis=1), self._rows_m[is_inside]
