"""The lead's rear from one frame to the next: is it still there, and how fast does it grow?

What is at distance Z and grows by the factor s in dt seconds comes nearer by Z ln(s) / dt. That
needs no plate that can be found or read, and tells closing speed within two frames, where the
plate's width, finer than a pixel as it is, needs a second. Corners on the rear are followed by
optical flow (Lucas and Kanade 1981, in pyramids after Bouguet 2001), and a similarity is fitted to
them robustly, so that a few corners on the road or a neighbour do not matter.
"""

import math
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from onboard.observations import ImageBox
from onboard.vision.perspective import Corners

MOST_POINTS, LEAST_POINTS = 60, 8
CORNER_QUALITY, LEAST_APART_PX = 0.01, 3.0
"""Of a corner against the sharpest, and between corners."""
PLATE_RIM = 0.2
"""Of a plate's width: its holder, or the card around a tag."""
LEAST_SIDE_PX = 24
"""Of the part of the picture that is compared."""
LEAST_SHARE = 0.35
"""Of the corners must move as one: a plate in glare takes its own with it, a car all of them."""
LEAST_SIGMA = 0.006
"""Of a growth: what remains however many corners agree, since the car's back is not flat."""
MOST_GROWTH = 1.25
"""In one frame; more is a mistake."""
_MARGIN = 0.3
"""Of the region's side: how far the rear moves in the picture from frame to frame."""


@dataclass(frozen=True, slots=True, eq=False)
class Growth:
    """How what was at one place in a frame looks in the next."""

    factor: float
    sigma: float
    """Of the factor, one standard deviation."""
    matrix: npt.NDArray[np.float64]
    """(2, 3): where points of the frame before are now."""

    def moved(self, corners_px: Corners) -> Corners:
        """Where corners of the frame before are now."""
        moved = corners_px @ self.matrix[:, :2].T + self.matrix[:, 2]
        return np.asarray(moved, np.float32)


class Rear:
    """One region, followed."""

    def __init__(self) -> None:
        self._grey: npt.NDArray[np.uint8] | None = None
        self._points = np.zeros((0, 1, 2), np.float32)
        self._origin = (0, 0)

    def remember(self, image: npt.NDArray[np.uint8], rear: ImageBox, plate: ImageBox) -> None:
        """Take corners on a rear in the (h, w, 3) picture, to be followed into the next.

        Half of them on the plate, which has the sharpest, half beside it, where glare spares them.
        """
        self._grey = None
        margin_px = _MARGIN * max(rear.w_px, rear.h_px) + 8
        rows, columns = image.shape[:2]
        x0, y0 = max(0, int(rear.x_px - margin_px)), max(0, int(rear.y_px - margin_px))
        x1 = min(columns, int(rear.x_px + rear.w_px + margin_px))
        y1 = min(rows, int(rear.y_px + rear.h_px + margin_px))
        if min(x1 - x0, y1 - y0) < LEAST_SIDE_PX:
            return
        grey = np.asarray(cv2.cvtColor(image[y0:y1, x0:x1], cv2.COLOR_BGR2GRAY), np.uint8)
        rim_px = PLATE_RIM * plate.w_px
        framed = ImageBox(
            plate.x_px - rim_px,
            plate.y_px - rim_px,
            plate.w_px + 2 * rim_px,
            plate.h_px + 2 * rim_px,
        )
        on_plate = _mask(grey.shape, framed, x0, y0)
        beside = _mask(grey.shape, rear, x0, y0) & ~on_plate
        points = np.concatenate([_corners(grey, on_plate), _corners(grey, beside)])
        if len(points) >= LEAST_POINTS:
            self._grey, self._points, self._origin = grey, points, (x0, y0)

    def follow(self, image: npt.NDArray[np.uint8]) -> Growth | None:
        """What was remembered in the frame before, in this one; `None` if it is not there."""
        if self._grey is None:
            return None
        (x0, y0), (rows, columns) = self._origin, self._grey.shape
        part = image[y0 : y0 + rows, x0 : x0 + columns]
        if part.shape[:2] != self._grey.shape:
            return None
        grey = np.asarray(cv2.cvtColor(part, cv2.COLOR_BGR2GRAY), np.uint8)
        moved, found, _ = cv2.calcOpticalFlowPyrLK(
            self._grey, grey, self._points, self._points.copy(), winSize=(15, 15), maxLevel=2
        )
        sound = found.ravel() == 1
        before, after = self._points[sound, 0], np.asarray(moved, np.float32)[sound, 0]
        if len(before) < LEAST_POINTS:
            return None
        return self._fit(before + self._origin, after + self._origin)

    def _fit(
        self, before: npt.NDArray[np.float32], after: npt.NDArray[np.float32]
    ) -> Growth | None:
        matrix, agrees = cv2.estimateAffinePartial2D(
            before, after, method=cv2.RANSAC, ransacReprojThreshold=0.8
        )
        if matrix is None:
            return None
        kept = np.asarray(agrees).ravel() == 1
        if kept.sum() < max(LEAST_POINTS, LEAST_SHARE * len(self._points)):
            return None
        factor = math.hypot(matrix[0, 0], matrix[1, 0])
        if not 1 / MOST_GROWTH < factor < MOST_GROWTH:
            return None
        errors = before[kept] @ matrix[:, :2].T + matrix[:, 2] - after[kept]
        spread_px = float(np.sqrt(((before[kept] - before[kept].mean(axis=0)) ** 2).sum()))
        error_px = float(np.sqrt((errors**2).mean()))
        return Growth(factor, math.hypot(LEAST_SIGMA, error_px / spread_px), np.asarray(matrix))


def _mask(shape: tuple[int, ...], box: ImageBox, x0: int, y0: int) -> npt.NDArray[np.uint8]:
    """255 in the box, in a part of the picture that begins at (x0, y0)."""
    mask = np.zeros(shape, np.uint8)
    left, top = max(0, int(box.x_px - x0)), max(0, int(box.y_px - y0))
    right, bottom = int(box.x_px + box.w_px - x0), int(box.y_px + box.h_px - y0)
    mask[top : max(top, bottom), left : max(left, right)] = 255
    return mask


def _corners(grey: npt.NDArray[np.uint8], mask: npt.NDArray[np.uint8]) -> npt.NDArray[np.float32]:
    """(n, 1, 2): the sharpest corners in the mask, apart from each other."""
    # OpenCV's stubs do not know that it gives None where there are none.
    points: Any = cv2.goodFeaturesToTrack(
        grey, MOST_POINTS // 2, CORNER_QUALITY, LEAST_APART_PX, mask=mask
    )
    return np.zeros((0, 1, 2), np.float32) if points is None else np.asarray(points, np.float32)
