"""Sub-pixel positions of the four sides of a tag.

Blur rounds corners, so that corner refinement finds a tag 0.5 to 1 px too narrow. It moves no
straight side. So the brightness is sampled along short lines across each side, the middle of the
step is found on each, a straight line is fitted to the middles, and the corners are the
intersections of neighbouring lines.
"""

import cv2
import numpy as np
import numpy.typing as npt

from onboard.vision.perspective import Corners

_LINES = 15
"""Lines across each side."""
_STEP_PX = 0.25
NEAR_PX, NEAR = 2.0, 0.125
"""Half width of the window around the strongest step: in pixels, and as a share of the side."""
NOISE_STEP = 2.5
"""Grey levels a sample; a smaller rise is noise."""
MIN_CONTRAST = 15.0
"""Least contrast across a side, in grey levels."""
_SHARE = np.linspace(0.15, 0.85, _LINES, dtype=np.float32)
"""Where the lines cross a side: not near its corners."""


def refine_sides(grey: npt.NDArray[np.uint8], corners_px: Corners, reach_px: float) -> Corners:
    """Refine the corners of a dark shape on light ground.

    A side whose step cannot be found stays where it is.

    Args:
        grey: (h, w) image.
        corners_px: pixels count from the middle of the first one, as in OpenCV.
        reach_px: distance by which a side may move at most.
    """
    ends = np.roll(corners_px, -1, axis=0)
    along = ends - corners_px
    length = np.hypot(along[:, 0], along[:, 1])
    if length.min() < 4.0:
        return corners_px
    # Corners run clockwise in the image, so this points outwards.
    outward = np.stack([along[:, 1], -along[:, 0]], axis=1) / length[:, None]
    offsets = np.arange(-reach_px, reach_px + _STEP_PX / 2, _STEP_PX, dtype=np.float32)
    bases = corners_px[:, None] + _SHARE[None, :, None] * along[:, None]
    points = bases[:, :, None] + offsets[None, None, :, None] * outward[:, None, None]
    flat = points.reshape(4 * _LINES, len(offsets), 2).astype(np.float32)
    levels = cv2.remap(
        grey, flat[..., 0], flat[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
    )
    steps = np.diff(np.asarray(levels, np.float32), axis=1).reshape(4, _LINES, -1)
    middles = offsets[:-1] + _STEP_PX / 2
    lines = [
        _side(
            corners_px[side],
            along[side],
            outward[side],
            _step_at(steps[side], middles, float(length[side])),
        )
        for side in range(4)
    ]
    refined = [_intersection(lines[side - 1], lines[side]) for side in range(4)]
    return np.asarray(refined, np.float32)


_Line = tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]
"""A point and a direction."""


def _step_at(
    steps: npt.NDArray[np.float32], offsets_px: npt.NDArray[np.float32], side_px: float
) -> npt.NDArray[np.float32] | None:
    """Offset of the rise in brightness on each line, by its centroid; `None` without a rise."""
    strongest_px = offsets_px[steps.mean(axis=0).argmax()]
    near = np.abs(offsets_px - strongest_px) <= min(NEAR_PX, NEAR * side_px)
    weights = np.clip(steps - NOISE_STEP, 0.0, None) * near
    totals = weights.sum(axis=1)
    if np.median(totals) < MIN_CONTRAST:
        return None
    middles = (weights * offsets_px).sum(axis=1) / np.maximum(totals, 1.0)
    return np.asarray(middles, np.float32)


def _side(
    start: npt.NDArray[np.float32],
    along: npt.NDArray[np.float32],
    outward: npt.NDArray[np.float32],
    offsets_px: npt.NDArray[np.float32] | None,
) -> _Line:
    """The line through the middles of the steps."""
    if offsets_px is None:
        return start.astype(np.float64), along.astype(np.float64)
    sound = np.abs(offsets_px - np.median(offsets_px)) <= 0.75
    slope, shift = np.polyfit(_SHARE[sound], offsets_px[sound], 1)
    return (
        np.asarray(start + shift * outward, np.float64),
        np.asarray(along + slope * outward, np.float64),
    )


def _intersection(one: _Line, other: _Line) -> npt.NDArray[np.float64]:
    """The intersection of two lines."""
    (start, along), (other_start, other_along) = one, other
    share = np.linalg.solve(np.column_stack([along, -other_along]), other_start - start)
    return np.asarray(start + share[0] * along, np.float64)
