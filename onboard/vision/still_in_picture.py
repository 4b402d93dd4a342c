"""What stays on its pixels while the scene moves: a date stamp, dirt, the bonnet, a reflection.

A vehicle at a constant gap is not that still: the host vehicle pitches and sways, which moves it by
pixels. On a smooth road it may be, so what has moved once, as a vehicle does that is approached, is
never taken for still, nor is what is found as a vehicle.
"""

import cv2
import numpy as np
import numpy.typing as npt

from onboard.observations import ImageBox

STILL_S, REMEMBERED_S = 0.8, 3.0
"""Time after which what did not move is still, and for which that is remembered. A clock's seconds
change; of the vehicles ahead in the labelled clips, none was that still for longer than 0.6 s."""
MOST_CHANGE = 0.2
"""Change of a still part at its edges, as a share of its contrast there: the road behind a stamp
changes it by a tenth, half a pixel of motion by more than a third."""
SCENE_STEP, SCENE_BLOCKS = 16.0, (8, 6)
"""Grey levels by which samples of a moving scene differ, and the blocks across and down it."""
CHANGED_SHARE, MOVED_SHARE = 0.04, 0.33
"""Share of a block's samples that differ where it moves, and share of the blocks that move with the
host vehicle: 0.31 to 0.92 on the labelled clips, and at most 0.29 while others pass it."""
MOVED_PX, MOVED_WIDTHS = 4.0, 0.15
"""What moves from where it was first by more pixels, and by more of its width, has moved."""
RIM = 0.3, 0.6
"""Rim around a plate that is watched with it, as shares of its width and height."""
_STRIDE = 8

Grey = npt.NDArray[np.float32]


class StillInPicture:
    """Watches one track's part of the image."""

    def __init__(self) -> None:
        self._box: tuple[slice, slice] | None = None
        self._part: Grey = np.zeros((0, 0), np.float32)
        self._scene: Grey = self._part
        self._since, self._still_at = 0.0, -np.inf
        self._first: ImageBox | None = None
        self._has_moved = False

    def is_still(self, stamp_s: float) -> bool:
        """Whether it stayed on its pixels while the scene moved, now or shortly before."""
        return not self._has_moved and stamp_s - self._still_at <= REMEMBERED_S

    def receive_frame(self, image: npt.NDArray[np.uint8], box: ImageBox, stamp_s: float) -> None:
        """Compare the part with what it showed before.

        Args:
            image: (h, w, 3), BGR.
            box: where the track is in this frame.
            stamp_s: of the frame.
        """
        self._first = self._first or box
        self._has_moved |= _has_left(self._first, box)
        if self._has_moved:
            return
        samples = image[::_STRIDE, ::_STRIDE]
        if (
            self._box is None
            or samples.shape[:2] != self._scene.shape
            or not _contains(self._box, box)
            or _change(_grey(image[self._box]), self._part) > MOST_CHANGE
        ):
            self._box, self._since, self._scene = _inside(box, image), stamp_s, _grey(samples)
            self._part = _grey(image[self._box])
        elif (
            stamp_s - self._since >= STILL_S
            and _moved_share(_grey(samples), self._scene) >= MOVED_SHARE
        ):
            self._still_at = stamp_s


def _grey(image: npt.NDArray[np.uint8]) -> Grey:
    if image.size == 0:
        return np.zeros((0, 0), np.float32)
    return np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), np.float32)


def _moved_share(scene: Grey, before: Grey) -> float:
    differs = (np.abs(scene - before) > SCENE_STEP).astype(np.float32)
    blocks = cv2.resize(differs, SCENE_BLOCKS, interpolation=cv2.INTER_AREA)
    return float((blocks > CHANGED_SHARE).mean())


def _change(part: Grey, before: Grey) -> float:
    """Root mean square of the change at edges, as a share of the contrast, whatever the light."""
    if part.shape != before.shape or part.size == 0:
        return np.inf
    across = cv2.Sobel(before, cv2.CV_32F, 1, 0)
    along = cv2.Sobel(before, cv2.CV_32F, 0, 1)
    weight = (across**2 + along**2) / max(float((across**2 + along**2).sum()), 1.0)
    level, level_before = float((weight * part).sum()), float((weight * before).sum())
    change = (weight * (part - level - before + level_before) ** 2).sum()
    contrast = (weight * (before - level_before) ** 2).sum()
    return float(np.sqrt(change / max(float(contrast), 1.0)))


def _has_left(first: ImageBox, box: ImageBox) -> bool:
    moved_px = float(np.hypot(*np.subtract(box.centre_px, first.centre_px)))
    return moved_px > max(MOVED_PX, MOVED_WIDTHS * first.w_px)


def _contains(place: tuple[slice, slice], box: ImageBox) -> bool:
    """Whether the middle of `box` lies in `place`."""
    x_px, y_px = box.centre_px
    rows, columns = place
    return bool(columns.start <= x_px <= columns.stop and rows.start <= y_px <= rows.stop)


def _inside(box: ImageBox, image: npt.NDArray[np.uint8]) -> tuple[slice, slice]:
    """Rows and columns of the box and its rim."""
    across_px, along_px = RIM[0] * box.w_px, RIM[1] * box.h_px
    top, left = max(0, int(box.y_px - along_px)), max(0, int(box.x_px - across_px))
    bottom = min(image.shape[0], int(box.y_px + box.h_px + along_px) + 1)
    right = min(image.shape[1], int(box.x_px + box.w_px + across_px) + 1)
    return slice(top, max(top, bottom)), slice(left, max(left, right))
