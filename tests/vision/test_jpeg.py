"""Truncated JPEGs, complete ones with data behind their end, and claims of size."""

import cv2
import numpy as np
import pytest

from onboard.vision.frames import decode_image, decode_jpeg
from onboard.vision.jpeg import is_jpeg, is_whole, pixels

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


def claiming(side_px: int, before: bytes = b"") -> bytes:
    """A small baseline JPEG whose header claims a square of that size, behind other markers."""
    jpeg = JPEGS["baseline"]
    at = jpeg.index(b"\xff\xc0")
    size = side_px.to_bytes(2, "big")
    return jpeg[:at] + before + jpeg[at : at + 5] + size * 2 + jpeg[at + 9 :]


SMALL = b"\xff\xc0\x00\x11\x08\x00\x10\x00\x10"
HIDING = {
    "plain": b"",
    "fill bytes": b"\xff\xff",
    "markers without length": b"\xff\x01\xff\xd0",
    "a comment with a frame header": b"\xff\xfe\x00\x0b" + SMALL,
    "a comment of no length": b"\xff\xfe\x00\x00",
    "a stuffed zero before a frame header": b"\xff\x00\x00\x02" + SMALL,
    "bytes between segments": b"\x12\x34",
}


@pytest.mark.parametrize("before", HIDING.values(), ids=HIDING)
def test_an_image_that_claims_gigabytes_is_not_decoded(
    before: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    # It would take 20 s and 2.4 GiB.
    monkeypatch.setattr(cv2, "imdecode", lambda *_: pytest.fail("decoded"))
    assert decode_image(claiming(20_000, before)).size == 0
    assert decode_jpeg(claiming(20_000, before)).size == 0


@pytest.mark.parametrize("jpeg", JPEGS.values(), ids=JPEGS)
def test_the_size_is_known_without_decoding(jpeg: bytes) -> None:
    assert pixels(jpeg) == RENDERER.shape[0] * RENDERER.shape[1]


def test_a_camera_sends_nothing_but_jpegs() -> None:
    png = cv2.imencode(".png", RENDERER)[1].tobytes()
    assert decode_image(png).shape == RENDERER.shape
    assert decode_jpeg(png).size == 0
