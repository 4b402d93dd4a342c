"""Truncated JPEGs, and complete ones with data behind their end."""

import cv2
import numpy as np
import pytest

from onboard.vision.frames import decode_image
from onboard.vision.jpeg import is_jpeg, is_whole

RENDERER = np.random.default_rng(1).integers(0, 255, (24, 32, 3)).astype(np.uint8)
PREVIEW = cv2.imencode(".jpg", RENDERER[:8, :8])[1].tobytes()
BEHIND = {
    "nothing": b"",
    "zeros": b"\0\0\r\n",
    "a film": b"\0\0\0\x18ftypmp42\0\0\0\0isommp42" + bytes(range(256)),
    "another picture": PREVIEW[:-2],
    "notes": b"SEFHk\0\0\0\1\0\0\0SEFT",
}


def encoded(*options: int) -> bytes:
    return cv2.imencode(".jpg", RENDERER, options)[1].tobytes()


def with_preview(jpeg: bytes) -> bytes:
    segment = b"Exif\0\0" + PREVIEW
    return jpeg[:2] + b"\xff\xe1" + (len(segment) + 2).to_bytes(2, "big") + segment + jpeg[2:]


JPEGS = {
    "baseline": encoded(),
    "progressive": encoded(cv2.IMWRITE_JPEG_PROGRESSIVE, 1),
    "restarts": encoded(cv2.IMWRITE_JPEG_RST_INTERVAL, 1),
    "with a preview": with_preview(encoded()),
    "fill bytes": encoded()[:-2] + b"\xff\xff\xff\xd9",
}


@pytest.mark.parametrize("behind", BEHIND.values(), ids=BEHIND)
@pytest.mark.parametrize("jpeg", JPEGS.values(), ids=JPEGS)
def test_data_may_follow_the_end_of_an_image(jpeg: bytes, behind: bytes) -> None:
    assert is_whole(jpeg + behind)
    assert decode_image(jpeg + behind).shape == RENDERER.shape


@pytest.mark.parametrize("jpeg", JPEGS.values(), ids=JPEGS)
def test_an_image_without_its_end_is_incomplete_at_any_length(jpeg: bytes) -> None:
    last = jpeg.rindex(b"\xff\xd9") + 1
    torn = [jpeg[:length] for length in range(2, last) if not jpeg[:length].endswith(b"\xff\xd9")]

    assert all(is_jpeg(data) and not is_whole(data) for data in torn)
    assert not any(is_whole(data + b"\0\0") for data in torn if not data.endswith(b"\xff"))
    assert decode_image(torn[-1]).size == 0
