"""Sub-pixel positions of the two ends of a plate.

The detector's view has plates 84 to 96 pixels wide, and a pixel of that is more than a hundredth of
the gap. The brightness is sampled along lines across each end. Steps that all lines have at one
position are vertical edges. Of the distinct ones the outermost is taken: a plate has more edges
inside (its border, the first stroke of an H) than there are close by outside.
"""

import cv2
import numpy as np
import numpy.typing as npt

from onboard.vision.perspective import Corners

REACH, MIN_REACH_PX = 0.055, 3.0
"""Distance from the detector's corner in which an end is searched: as a share of the width (less
than Europe's blue band, which ends in an edge too) and in pixels, since small plates have larger
errors."""
DISTINCT = 0.3
"""Share of the strongest edge in reach from which an edge is distinct."""
MIN_CONTRAST = 12.0
"""Least contrast of an edge, in grey levels."""
_LINES = np.linspace(0.06, 0.94, 15)[:, None, None]
_STEP_PX = 0.25
_ENDS = ((0, 3, -1.0), (1, 2, 1.0))
"""Upper corner, lower corner, and the outward direction."""


def refine_ends(image: npt.NDArray[np.uint8], corners_px: Corners) -> Corners:
    """Move the corners of a plate along it to where it ends.

    An end without a distinct edge stays.

    Args:
        image: (h, w, 3), BGR.
        corners_px: counted from the outer corner of the first pixel.
    """
    along = (corners_px[1] - corners_px[0] + corners_px[2] - corners_px[3]) / 2
    width_px = float(np.hypot(*along))
    if width_px < 1.0:
        return corners_px
    along = along / width_px
    reach_px = max(MIN_REACH_PX, REACH * width_px)
    offsets_px = np.arange(-reach_px, reach_px + _STEP_PX / 2, _STEP_PX)
    refined = corners_px.copy()
    for upper, lower, outward in _ENDS:
        bases = corners_px[upper] + _LINES * (corners_px[lower] - corners_px[upper])
        points = (bases + outward * offsets_px[:, None] * along - 0.5).astype(np.float32)
        colours = cv2.remap(
            image, points[..., 0], points[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
        )
        levels = cv2.cvtColor(colours, cv2.COLOR_BGR2GRAY).astype(np.float64)
        moved_px = _outermost_edge(levels, offsets_px, width_px)
        refined[[upper, lower]] += np.float32(outward * moved_px) * along
    return refined


def _outermost_edge(
    levels: npt.NDArray[np.float64], offsets_px: npt.NDArray[np.float64], width_px: float
) -> float:
    """Where (lines, offsets) of brightness have it; 0 if nowhere."""
    middle = len(levels) // 2
    median = np.partition(np.diff(levels, axis=1), middle, axis=0)[middle]  # of an odd number
    steps = np.convolve(median, np.ones(3) / 3, "same")
    middles_px = offsets_px[:-1] + _STEP_PX / 2
    # The detector is more often nearly right than far off.
    likely = np.exp(-0.5 * (middles_px / (0.7 * offsets_px[-1])) ** 2)
    strength = np.abs(steps) * likely
    inner = strength[1:-1]
    is_peak = (
        (inner >= strength[:-2]) & (inner > strength[2:]) & (inner >= DISTINCT * strength.max())
    )
    if not is_peak.any():
        return 0.0
    edge = int(np.flatnonzero(is_peak)[-1]) + 1
    near = np.abs(middles_px - middles_px[edge]) <= max(1.0, 0.025 * width_px)
    rise = np.clip(np.sign(steps[edge]) * steps, 0.0, None) * near
    return float(rise @ middles_px / rise.sum()) if rise.sum() >= MIN_CONTRAST else 0.0
