"""Camera frames, and their decoding."""

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from onboard.errors import UserError
from onboard.vision.jpeg import is_jpeg, is_whole

Image = npt.NDArray[np.uint8]
"""(h, w, 3), BGR; empty if decoding failed."""

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


def decode_image(data: bytes) -> Image:
    """Decode an image file; empty where that fails.

    A JPEG without its end is not decoded: the rest of it would be grey.
    """
    if is_jpeg(data) and not is_whole(data):
        return NO_IMAGE
    try:
        image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
    except cv2.error:
        return NO_IMAGE
    return NO_IMAGE if image is None else np.asarray(image, np.uint8)
