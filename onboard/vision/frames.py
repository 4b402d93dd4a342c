"""Camera frames, and their decoding."""

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from onboard.errors import UserError
from onboard.vision.jpeg import is_jpeg, is_whole, pixels

Image = npt.NDArray[np.uint8]
"""(h, w, 3), BGR; empty if decoding failed."""

MOST_PIXELS = 2**26
"""Of a JPEG that is decoded: 67 million take 200 MB."""

NO_IMAGE: Image = np.zeros((0, 0, 3), np.uint8)


class CameraError(UserError):
    """The camera cannot be opened."""


@dataclass(frozen=True, slots=True, eq=False)
class Frame:
    """One image of the camera and its time."""

    stamp_s: float
    image: Image
    name: str = ""
    """Name of the file that it came from."""


def decode_jpeg(data: bytes) -> Image:
    """Decode a JPEG; empty where that fails, and for anything else.

    One without its end is not decoded: the rest of it would be grey. Nor is one of more than
    `MOST_PIXELS`.
    """
    if is_jpeg(data) and is_whole(data) and 0 < pixels(data) <= MOST_PIXELS:
        return _decoded(data)
    return NO_IMAGE


def decode_image(data: bytes) -> Image:
    """Decode an image file of the user's, of any format; empty where that fails."""
    return decode_jpeg(data) if is_jpeg(data) else _decoded(data)


def _decoded(data: bytes) -> Image:
    try:
        image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
    except cv2.error:
        return NO_IMAGE
    return NO_IMAGE if image is None else np.asarray(image, np.uint8)
