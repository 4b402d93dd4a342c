"""The blue band at the left end of European plates, which the detector takes for bodywork.

A network that learns what a plate is learns white with black characters. The band (Council
Regulation (EC) 2411/98: 40 to 50 mm wide on a plate of 520 mm) then stays outside, and the gap
comes out a tenth too long. It is known by its colour, where the bodywork beyond has another.
"""

import cv2
import numpy as np
import numpy.typing as npt

from onboard.vision.perspective import Corners

BAND = 0.085
"""Width of the band, as a share of the whole plate's."""
BLUER = 1.3
"""Blue light by red light, in a band; grey has 1."""
LEAST_BLUE = 40.0
"""Grey levels: darker than this, colours are noise."""
UNLIKE = 25.0
"""Grey levels between the colours of band and bodywork."""
_SAMPLES = 8


def with_band(image: npt.NDArray[np.uint8], corners_px: Corners) -> Corners:
    """`corners_px`, moved out at the left where a blue band ends there.

    `image`: (h, w, 3), BGR.
    """
    share = BAND / (1.0 - BAND)
    beyond, band, inside = (
        _colour(image, corners_px, *span)
        for span in ((-2.2 * share, -1.4 * share), (-0.85 * share, -0.2 * share), (0.01, 0.04))
    )
    is_blue = band[0] >= max(LEAST_BLUE, BLUER * band[2]) and band[0] > band[1]
    ends_there = inside[0] / max(inside[2], 1.0) < 0.8 * band[0] / max(band[2], 1.0)
    if not is_blue or not ends_there or np.abs(beyond - band).max() < UNLIKE:
        return corners_px
    top_left, top_right, bottom_right, bottom_left = corners_px
    moved = [
        top_left + share * (top_left - top_right),
        top_right,
        bottom_right,
        bottom_left + share * (bottom_left - bottom_right),
    ]
    return np.asarray(moved, np.float32)


def _colour(
    image: npt.NDArray[np.uint8], corners_px: Corners, start: float, end: float
) -> npt.NDArray[np.float64]:
    """Mean BGR over a part of the plate's length (0 left to 1 right), the middle of its height."""
    along, down = np.meshgrid(np.linspace(start, end, _SAMPLES), np.linspace(0.25, 0.75, _SAMPLES))
    top_left, top_right, bottom_right, bottom_left = corners_px
    upper = top_left + along[..., None] * (top_right - top_left)
    lower = bottom_left + along[..., None] * (bottom_right - bottom_left)
    points = (upper + down[..., None] * (lower - upper) - 0.5).astype(np.float32)
    colours = cv2.remap(
        image, points[..., 0], points[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
    )
    return np.asarray(np.mean(colours, axis=(0, 1)), np.float64)
