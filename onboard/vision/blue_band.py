"""The blue band at the left end of European plates, which the plate detector leaves out.

The network detects white with black characters. The band (Council Regulation (EC) 2411/98: 40 to 50
mm wide on a plate of 520 mm) stays outside or is cut in two, and the gap comes out up to a tenth
too long. The band is found by its colour, if it differs from that of the bodywork beside it.
"""

import statistics

import cv2
import numpy as np
import numpy.typing as npt

from onboard.vision.perspective import Corners

BAND = 0.085
"""Width of the band, as a share of the whole plate's."""
NARROWEST, WIDEST = 0.5 * BAND, 1.7 * BAND
"""Widths between which a blue area is a band, as a share of the plate's."""
BLUER = 1.3
"""Least ratio of blue to red in a band; grey has 1."""
MIN_BLUE = 40.0
"""Least level of blue; below it, colours are noise."""
COLOUR_CONTRAST = 25.0
"""Grey levels between the colours of band and bodywork."""
MIN_BLUE_SHARE = 0.35
"""Share of the strongest blue near the left end that is no longer the plate's ground; the bodywork
may be bluer than the band."""
_BAND_STEPS, _LAST_STEPS = 16, 6
_REACH, _STEP = 3 * BAND, BAND / _BAND_STEPS
_POSITIONS = np.arange(-_REACH, _REACH, _STEP)
_IS_NEAR = np.abs(_POSITIONS) < 1.2 * BAND
_HEIGHTS, _SMOOTHED = np.linspace(0.25, 0.75, 16)[:, None, None], 5

_Values = npt.NDArray[np.float64]


def include_blue_band(image: npt.NDArray[np.uint8], corners_px: Corners) -> Corners:
    """Move the left corners of a plate to the outer edge of its blue band.

    Returns `corners_px` itself if there is none. `image`: (h, w, 3), BGR.
    """
    colours = _colours(image, corners_px)
    blueness = colours[:, 0] - colours[:, 1:].max(axis=1)
    near = np.where(_IS_NEAR, blueness, 0.0)
    is_blue = (near >= MIN_BLUE_SHARE * near.max()) & (near > 0)
    if not is_blue.any():
        return corners_px
    # From the plate's ground outwards: the band's right edge, then its colour half a band further.
    last_blue = int(np.flatnonzero(is_blue)[-1])
    middle = last_blue - _BAND_STEPS // 2
    blue, _, red = colours[middle]
    if blue < max(MIN_BLUE, BLUER * red) or not is_blue[middle:last_blue].all():
        return corners_px
    unlike = np.abs(colours[: middle + 1] - colours[middle]).max(axis=1)[::-1]
    to_left = _end(unlike[: round(1.4 * _BAND_STEPS)])
    if not NARROWEST <= _POSITIONS[last_blue] - _POSITIONS[middle] + to_left <= WIDEST:
        return corners_px
    share = float(_POSITIONS[middle]) - to_left
    top_left, top_right, bottom_right, bottom_left = corners_px
    moved = [
        top_left + share * (top_right - top_left),
        top_right,
        bottom_right,
        bottom_left + share * (bottom_right - bottom_left),
    ]
    return np.asarray(moved, np.float32)


def _end(unlike: _Values) -> float:
    """Width of the band, from the difference in colour of each position to the first.

    A blurred edge is where half of the difference is reached. Infinite if the band does not end, or
    if its colour occurs again behind its end.
    """
    beyond = statistics.median(unlike[-_LAST_STEPS:].tolist())
    half = beyond / 2
    first = int(np.argmax(unlike >= half))
    if beyond < COLOUR_CONTRAST or (unlike[first:] < min(half, COLOUR_CONTRAST)).any():
        return np.inf
    before, after = unlike[first - 1], unlike[first]
    return float(first - (after - half) / (after - before)) * _STEP


def _colours(image: npt.NDArray[np.uint8], corners_px: Corners) -> _Values:
    """BGR by position along the plate (0 left to 1 right): means over the middle of its height."""
    along = _POSITIONS[:, None]
    top_left, top_right, bottom_right, bottom_left = corners_px
    upper = top_left + along * (top_right - top_left)
    lower = bottom_left + along * (bottom_right - bottom_left)
    points = (upper + _HEIGHTS * (lower - upper) - 0.5).astype(np.float32)
    colours = cv2.remap(
        image, points[..., 0], points[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
    )
    smooth = cv2.blur(colours, (_SMOOTHED, 1))
    return np.asarray(cv2.reduce(smooth, 0, cv2.REDUCE_AVG, dtype=cv2.CV_64F)[0], np.float64)
