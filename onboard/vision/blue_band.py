"""The blue band at the left end of European plates, which the detector takes for bodywork.

A network that learns what a plate is learns white with black characters. The band (Council
Regulation (EC) 2411/98: 40 to 50 mm wide on a plate of 520 mm) then stays outside, or is cut in
two, and the gap comes out up to a tenth too long. It is known by its colour, where the bodywork
beyond has another.
"""

import cv2
import numpy as np
import numpy.typing as npt

from onboard.vision.perspective import Corners

BAND = 0.085
"""Width of the band, as a share of the whole plate's."""
NARROWEST, WIDEST = 0.5 * BAND, 1.7 * BAND
"""What is blue over less or more of a plate is no band."""
BLUER = 1.3
"""Blue light by red light, in a band; grey has 1."""
LEAST_BLUE = 40.0
"""Grey levels: darker than this, colours are noise."""
UNLIKE = 25.0
"""Grey levels between the colours of band and bodywork."""
PLAINLY = 0.35
"""Of the most blue that is seen there, so that it is no longer the plate's ground; bodywork may be
bluer than the band."""
_BAND_STEPS, _LAST_STEPS = 16, 6
_REACH, _STEP = 3 * BAND, BAND / _BAND_STEPS
_HEIGHTS, _SMOOTHED = 16, 5

_Values = npt.NDArray[np.float64]


def with_band(image: npt.NDArray[np.uint8], corners_px: Corners) -> Corners:
    """`corners_px`, the left ones moved to where a blue band begins.

    The same array if there is none. `image`: (h, w, 3), BGR.
    """
    places = np.arange(-_REACH, _REACH, _STEP)
    colours = _colours(image, corners_px, places)
    blueness = colours[:, 0] - colours[:, 1:].max(axis=1)
    near = np.where(np.abs(places) < 1.2 * BAND, blueness, 0.0)
    is_blue = (near >= PLAINLY * near.max()) & (near > 0)
    if not is_blue.any():
        return corners_px
    # From the plate's ground outwards: the band's right edge, and half a band on, its own colour.
    last_blue = int(np.flatnonzero(is_blue)[-1])
    middle = last_blue - _BAND_STEPS // 2
    blue, _, red = colours[middle]
    if blue < max(LEAST_BLUE, BLUER * red) or not is_blue[middle:last_blue].all():
        return corners_px
    unlike = np.abs(colours[: middle + 1] - colours[middle]).max(axis=1)[::-1]
    to_left = _end(unlike[: round(1.4 * _BAND_STEPS)])
    if not NARROWEST <= places[last_blue] - places[middle] + to_left <= WIDEST:
        return corners_px
    share = float(places[middle]) - to_left
    top_left, top_right, bottom_right, bottom_left = corners_px
    moved = [
        top_left + share * (top_right - top_left),
        top_right,
        bottom_right,
        bottom_left + share * (bottom_right - bottom_left),
    ]
    return np.asarray(moved, np.float32)


def _end(unlike: _Values) -> float:
    """How far the band reaches, from what each place differs by from the first of them.

    A blurred edge lies where half of the difference is reached. Infinite where it does not end, or
    what follows looks like it again.
    """
    beyond = float(np.median(unlike[-_LAST_STEPS:]))
    half = beyond / 2
    first = int(np.argmax(unlike >= half))
    if beyond < UNLIKE or (unlike[first:] < min(half, UNLIKE)).any():
        return np.inf
    before, after = unlike[first - 1], unlike[first]
    return float(first - (after - half) / (after - before)) * _STEP


def _colours(image: npt.NDArray[np.uint8], corners_px: Corners, places: _Values) -> _Values:
    """BGR by place along the plate (0 left to 1 right): means over the middle of its height."""
    along, down = np.meshgrid(places, np.linspace(0.25, 0.75, _HEIGHTS))
    top_left, top_right, bottom_right, bottom_left = corners_px
    upper = top_left + along[..., None] * (top_right - top_left)
    lower = bottom_left + along[..., None] * (bottom_right - bottom_left)
    points = (upper + down[..., None] * (lower - upper) - 0.5).astype(np.float32)
    colours = cv2.remap(
        image, points[..., 0], points[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
    )
    return np.asarray(np.mean(cv2.blur(colours, (_SMOOTHED, 1)), axis=0), np.float64)
