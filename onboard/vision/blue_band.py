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
"""Grey levels by which a band is bluer than what lies on either side."""
_REACH, _STEP = 3 * BAND, BAND / 16
_HEIGHTS, _SMOOTHED = 16, 5

_Values = npt.NDArray[np.float64]


def with_band(image: npt.NDArray[np.uint8], corners_px: Corners) -> Corners:
    """`corners_px`, the left ones moved to where a blue band begins; as they are if there is none.

    `image`: (h, w, 3), BGR.
    """
    places = np.arange(-_REACH, _REACH, _STEP)
    colours = _colours(image, corners_px, places)
    blueness = colours[:, 0] - colours[:, 2]
    bluest = int(np.argmax(np.where(np.abs(places) < 1.1 * BAND, blueness, -np.inf)))
    blue, green, red = colours[bluest]
    if blue < max(LEAST_BLUE, BLUER * red) or blue <= green:
        return corners_px
    to_left, to_right = _length(blueness[bluest::-1]), _length(blueness[bluest:])
    if not NARROWEST <= to_left + to_right <= WIDEST:
        return corners_px
    share = float(places[bluest]) - to_left
    top_left, top_right, bottom_right, bottom_left = corners_px
    moved = [
        top_left + share * (top_right - top_left),
        top_right,
        bottom_right,
        bottom_left + share * (bottom_right - bottom_left),
    ]
    return np.asarray(moved, np.float32)


def _length(blueness: _Values) -> float:
    """How far the band reaches from the first of these; infinite where it has no end, or several.

    A blurred edge lies where half of the difference is left.
    """
    near = blueness[: round(WIDEST / _STEP)]
    half = (near[0] + near.min()) / 2
    first = int(np.argmax(near < half))
    if near[0] - near.min() < UNLIKE or (near[first:] >= half).any():
        return np.inf
    before, after = near[first - 1], near[first]
    return float(first - (half - after) / (before - after)) * _STEP


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
