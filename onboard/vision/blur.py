"""How blurred a picture is, by a lens out of focus, a dirty windscreen, or motion.

A blurred picture hardly changes when it is blurred again; a sharp one loses its steps (Crete et al.
2007, "The blur effect: perception and estimation with a new no-reference perceptual blur metric").
"""

import cv2
import numpy as np
import numpy.typing as npt

DETAIL_PX = 736
"""Width of the picture that is examined, as the detector of vehicles sees it."""
BLURRED = 0.42
"""Blur from which boxes and plates are measured wrong. Clips and photographs by day have at most
0.41; blurred by motion of 9 px at a width of 1242 px, photographs have 0.48 and more, of 7 px half
of them 0.45 and more."""
_AGAIN_PX = 9
"""Length of the mean that blurs again (Crete et al., section 3)."""


def detail(image: npt.NDArray[np.uint8]) -> npt.NDArray[np.uint8]:
    """The grey picture in which blur and motion are examined.

    Args:
        image: (h, w, 3), BGR.

    Returns:
        at most `DETAIL_PX` wide.
    """
    grey = cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)
    scale = DETAIL_PX / grey.shape[1]
    if scale < 1:
        size = DETAIL_PX, max(1, round(scale * grey.shape[0]))
        grey = cv2.resize(grey, size, interpolation=cv2.INTER_AREA)
    return np.asarray(grey, np.uint8)


def blur_of(grey: npt.NDArray[np.uint8]) -> float:
    """The larger of the blur across and along the middle half of the rows, 0 (sharp) to 1.

    Args:
        grey: (h, w), of `detail`.
    """
    rows = grey.shape[0]
    levels = np.asarray(grey[rows // 4 : max(1, rows - rows // 4)], np.float32)
    return max(_blur(levels, axis) for axis in (0, 1))


def _blur(levels: npt.NDArray[np.float32], axis: int) -> float:
    """Share of the steps along an axis that is left after blurring again."""
    again = cv2.blur(levels, (_AGAIN_PX, 1) if axis else (1, _AGAIN_PX))
    steps = np.abs(np.diff(levels, axis=axis))
    lost = np.maximum(steps - np.abs(np.diff(again, axis=axis)), 0.0)
    return 1.0 - float(lost.sum()) / max(float(steps.sum()), 1.0)
