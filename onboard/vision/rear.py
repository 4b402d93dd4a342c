"""The lead's rear from frame to frame: whether it is still there, and its change of scale.

An object at distance Z whose image grows by the factor s in dt seconds approaches at Z ln(s) / dt.
That needs no plate, and gives the closing speed within two frames; from the plate's width it takes
a second. Corners on the rear are tracked by optical flow (Lucas and Kanade 1981, in pyramids after
Bouguet 2001), and a similarity is fitted to them robustly, so that a few corners on the road or on
another vehicle have no effect.
"""

import math
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from onboard.observations import ImageBox
from onboard.vision.perspective import Corners

MAX_POINTS, MIN_POINTS = 60, 8
CORNER_QUALITY, MIN_APART_PX = 0.01, 3.0
"""Quality of a corner relative to the sharpest, and distance between corners."""
PLATE_RIM = 0.2
"""Border around a plate, as a share of its width: its holder, or the card around a tag."""
MIN_SIDE_PX = 24
"""Least side of the part of the image that is tracked."""
MIN_INLIER_SHARE = 0.35
"""Share of the corners that must move as one: on a plate in glare its own do, on a vehicle all."""
MIN_SIGMA = 0.006
"""Least sigma of a change of scale, since a vehicle's rear is not flat."""
MAX_FACTOR = 1.25
"""Largest plausible factor between two frames."""
_AROUND_PX = 4
"""Rim that the quality of a corner depends on: its derivatives, their mean and its neighbours."""
_MARGIN = 0.3
"""Distance that the rear moves in the image between frames, as a share of the region's side."""


@dataclass(frozen=True, slots=True, eq=False)
class ScaleChange:
    """Change in position and scale of a region from one frame to the next."""

    factor: float
    sigma: float
    """Standard deviation of the factor."""
    matrix: npt.NDArray[np.float64]
    """(2, 3) similarity from pixels of the frame before to pixels of this one."""

    def moved(self, corners_px: Corners) -> Corners:
        """Move corners of the frame before to this frame."""
        moved = corners_px @ self.matrix[:, :2].T + self.matrix[:, 2]
        return np.asarray(moved, np.float32)


class RearTracker:
    """Tracks one region from a frame to the next."""

    def __init__(self) -> None:
        self._grey: npt.NDArray[np.uint8] | None = None
        self._points = np.zeros((0, 1, 2), np.float32)
        self._origin = (0, 0)

    def set_reference(
        self, image: npt.NDArray[np.uint8], rear: ImageBox, plate: ImageBox | None
    ) -> None:
        """Select corners on a rear, to be tracked into the next frame.

        Half of them on the plate, which has the sharpest, half beside it, where there is no glare.

        Args:
            image: (h, w, 3), BGR.
            rear: the rear's region.
            plate: the plate's region, if it is known.
        """
        self._grey = None
        margin_px = _MARGIN * max(rear.w_px, rear.h_px) + 8
        rows, columns = image.shape[:2]
        x0, y0 = max(0, int(rear.x_px - margin_px)), max(0, int(rear.y_px - margin_px))
        x1 = min(columns, int(rear.x_px + rear.w_px + margin_px))
        y1 = min(rows, int(rear.y_px + rear.h_px + margin_px))
        if min(x1 - x0, y1 - y0) < MIN_SIDE_PX:
            return
        grey = np.asarray(cv2.cvtColor(image[y0:y1, x0:x1], cv2.COLOR_BGR2GRAY), np.uint8)
        masks = [_mask(grey.shape, rear, x0, y0)]
        if plate is not None:
            on_plate = _mask(grey.shape, _with_rim(plate), x0, y0)
            masks = [on_plate, masks[0] & ~on_plate]
        points = np.concatenate([_corners(grey, mask) for mask in masks])
        if len(points) >= MIN_POINTS:
            self._grey, self._points, self._origin = grey, points, (x0, y0)

    def track(self, image: npt.NDArray[np.uint8]) -> ScaleChange | None:
        """Change of the region from the reference frame to this one; `None` if it is not found."""
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
        if len(before) < MIN_POINTS:
            return None
        return self._fit(before + self._origin, after + self._origin)

    def _fit(
        self, before: npt.NDArray[np.float32], after: npt.NDArray[np.float32]
    ) -> ScaleChange | None:
        matrix, agrees = cv2.estimateAffinePartial2D(
            before, after, method=cv2.RANSAC, ransacReprojThreshold=0.8
        )
        if matrix is None:
            return None
        kept = np.asarray(agrees).ravel() == 1
        if kept.sum() < max(MIN_POINTS, MIN_INLIER_SHARE * len(self._points)):
            return None
        factor = math.hypot(matrix[0, 0], matrix[1, 0])
        if not 1 / MAX_FACTOR < factor < MAX_FACTOR:
            return None
        errors = before[kept] @ matrix[:, :2].T + matrix[:, 2] - after[kept]
        spread_px = float(np.sqrt(((before[kept] - before[kept].mean(axis=0)) ** 2).sum()))
        error_px = float(np.sqrt((errors**2).mean()))
        return ScaleChange(factor, math.hypot(MIN_SIGMA, error_px / spread_px), np.asarray(matrix))


def _with_rim(plate: ImageBox) -> ImageBox:
    rim_px = PLATE_RIM * plate.w_px
    width_px, height_px = plate.w_px + 2 * rim_px, plate.h_px + 2 * rim_px
    return ImageBox(plate.x_px - rim_px, plate.y_px - rim_px, width_px, height_px)


def _mask(shape: tuple[int, ...], box: ImageBox, x0: int, y0: int) -> npt.NDArray[np.uint8]:
    """Mask (255) of the box, in a part of the image that begins at (x0, y0)."""
    mask = np.zeros(shape, np.uint8)
    left, top = max(0, int(box.x_px - x0)), max(0, int(box.y_px - y0))
    right, bottom = int(box.x_px + box.w_px - x0), int(box.y_px + box.h_px - y0)
    mask[top : max(top, bottom), left : max(left, right)] = 255
    return mask


def _corners(grey: npt.NDArray[np.uint8], mask: npt.NDArray[np.uint8]) -> npt.NDArray[np.float32]:
    """The sharpest corners in the mask (n, 1, 2), apart from each other."""
    # Only around the mask: OpenCV rates all pixels, whatever the mask is.
    x_px, y_px, width_px, height_px = cv2.boundingRect(mask)
    left, top = max(0, x_px - _AROUND_PX), max(0, y_px - _AROUND_PX)
    part = slice(top, y_px + height_px + _AROUND_PX), slice(left, x_px + width_px + _AROUND_PX)
    if 0 in grey[part].shape:
        return np.zeros((0, 1, 2), np.float32)
    # OpenCV's stubs leave out that it returns None where there are no corners.
    points: Any = cv2.goodFeaturesToTrack(
        grey[part], MAX_POINTS // 2, CORNER_QUALITY, MIN_APART_PX, mask=mask[part]
    )
    if points is None:
        return np.zeros((0, 1, 2), np.float32)
    return np.asarray(points + np.array([left, top], np.float32), np.float32)
