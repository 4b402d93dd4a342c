"""Effects of a camera on an image: light, blur, grain, sharpening, compression.

Every effect is drawn at random in the range that gate cameras, dashcams and telephones show.
"""

import cv2
import numpy as np
import numpy.typing as npt

Image = npt.NDArray[np.uint8]
"""(h, w, 3), BGR."""
_Light = npt.NDArray[np.float32]


def photograph(image: Image, rng: np.random.Generator, fine_px: float) -> Image:
    """Return `image` as a camera chosen at random delivers it, same shape.

    Args:
        image: scene without effects.
        rng: chooses the camera and the light.
        fine_px: width of the finest detail to be kept, a stroke of a character: blur is drawn in
            proportion.
    """
    light = image.astype(np.float32)
    if rng.random() < 0.8:
        light = _lit(light, rng)
    if rng.random() < 0.25:
        light = _shadowed(light, rng)
    if rng.random() < 0.12:
        light = _glared(light, rng)
    light = _exposed(light, rng)
    light = _blurred(light, rng, fine_px)
    light = _grained(light, rng)
    if rng.random() < 0.5:
        light = _sharpened(light, rng)
    picture = np.clip(light, 0, 255).astype(np.uint8)
    if rng.random() < 0.15:
        picture = _grey(picture)
    if rng.random() < 0.2:
        picture = _enlarged(picture, rng, fine_px)
    elif rng.random() < 0.85:
        picture = _compressed(picture, int(rng.integers(25, 96)))
    return picture


def _sharpened(light: _Light, rng: np.random.Generator) -> _Light:
    """Halos along edges, as cameras and programs add them."""
    soft = cv2.GaussianBlur(light, (0, 0), rng.uniform(0.7, 1.8))
    return np.asarray(light + rng.uniform(0.2, 2.5) * (light - np.asarray(soft)), np.float32)


def _enlarged(picture: Image, rng: np.random.Generator, fine_px: float) -> Image:
    """Compressed small, then shown larger and sharpened, as video stills and crops are."""
    rows, columns = picture.shape[:2]
    least = max(0.35, 0.75 / max(fine_px, 0.75))  # keeps the finest detail
    share = float(rng.uniform(min(least, 0.95), 0.95))
    size = (max(2, round(columns * share)), max(2, round(rows * share)))
    small = np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_AREA), np.uint8)
    small = _compressed(small, int(rng.integers(35, 96)))
    way = (cv2.INTER_LINEAR, cv2.INTER_CUBIC, cv2.INTER_LANCZOS4)[rng.integers(3)]
    large = np.asarray(cv2.resize(small, (columns, rows), interpolation=way), np.float32)
    if rng.random() < 0.5:
        large = _sharpened(large, rng)
    return _compressed(np.clip(large, 0, 255).astype(np.uint8), int(rng.integers(50, 98)))


def _lit(light: _Light, rng: np.random.Generator) -> _Light:
    """Colour of the light, and gamma."""
    cast = rng.normal(1.0, 0.07, 3).astype(np.float32)
    gamma = np.float32(np.exp(rng.normal(0, 0.25)))
    return np.asarray(255 * (light * np.float32(1 / 255)) ** gamma * cast, np.float32)


def _shadowed(light: _Light, rng: np.random.Generator) -> _Light:
    """One half lies in a shadow with a straight edge."""
    rows, columns = light.shape[:2]
    angle = rng.uniform(0, 2 * np.pi)
    y, x = np.mgrid[0:rows, 0:columns].astype(np.float32)
    side = (x - rng.uniform(0.2, 0.8) * columns) * np.cos(angle) + (
        y - rng.uniform(0.2, 0.8) * rows
    ) * np.sin(angle)
    soft_px = rng.uniform(0.5, 0.15 * columns)
    share = 1 / (1 + np.exp(-np.clip(side / soft_px, -30, 30)))
    dark = rng.uniform(0.3, 0.8)
    return np.asarray(light * (dark + (1 - dark) * share)[..., None], np.float32)


def _glared(light: _Light, rng: np.random.Generator) -> _Light:
    """A lamp or the sun mirrored: a soft bright spot."""
    rows, columns = light.shape[:2]
    y, x = np.mgrid[0:rows, 0:columns].astype(np.float32)
    radius = rng.uniform(0.05, 0.3) * columns
    distance = np.hypot(x - rng.uniform(0, columns), y - rng.uniform(0, rows)) / radius
    spot = rng.uniform(60, 200) * np.exp(-distance * distance)
    return np.asarray(light + spot[..., None], np.float32)


def _exposed(light: _Light, rng: np.random.Generator) -> _Light:
    """Right, too dark by much, or too bright until it clips; and haze."""
    kind = rng.choice(4, p=[0.55, 0.19, 0.1, 0.16])
    gain = (
        rng.uniform(0.6, 1.1),
        np.exp(rng.uniform(np.log(0.08), np.log(0.6))),
        rng.uniform(1.1, 1.9),
        0.0,
    )[kind]
    if kind == 3:  # little contrast: haze, fog, a dirty or faded plate
        contrast = rng.uniform(0.15, 0.6)
        return np.asarray(light * contrast + rng.uniform(0, 200) * (1 - contrast), np.float32)
    return np.asarray(light * gain, np.float32)


def _blurred(light: _Light, rng: np.random.Generator, fine_px: float) -> _Light:
    sigma = rng.uniform(0.25, 0.25 + max(0.35, 0.48 * fine_px))
    light = np.asarray(cv2.GaussianBlur(light, (0, 0), sigma), np.float32)
    if rng.random() < 0.2:
        length = rng.uniform(1.0, max(2.0, 1.7 * fine_px))
        angle = rng.uniform(0, np.pi)
        size = 2 * int(np.ceil(length / 2)) + 1
        y, x = np.mgrid[0:size, 0:size].astype(np.float32) - size // 2
        along = x * np.cos(angle) + y * np.sin(angle)
        across = x * np.sin(angle) - y * np.cos(angle)
        kernel = np.clip(1 - np.abs(across), 0, 1) * np.clip(length / 2 + 0.5 - np.abs(along), 0, 1)
        light = np.asarray(cv2.filter2D(light, -1, kernel / kernel.sum()), np.float32)
    return light


def _grained(light: _Light, rng: np.random.Generator) -> _Light:
    """Grain, in some cameras coarse from their own smoothing, and coloured or not."""
    sigma = rng.choice([rng.uniform(0, 4), rng.uniform(4, 14)], p=[0.7, 0.3])
    shape = light.shape if rng.random() < 0.6 else (*light.shape[:2], 1)
    grain = rng.standard_normal(shape, np.float32) * np.float32(sigma)
    if rng.random() < 0.4:
        soft = cv2.GaussianBlur(grain, (0, 0), 0.8)
        grain = np.asarray(soft, np.float32).reshape(shape) * np.float32(2.0)
    return np.asarray(light + grain, np.float32)


def _grey(picture: Image) -> Image:
    grey = cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY)
    return np.asarray(cv2.cvtColor(grey, cv2.COLOR_GRAY2BGR), np.uint8)


def _compressed(picture: Image, quality: int) -> Image:
    _, code = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, quality])
    return np.asarray(cv2.imdecode(code, cv2.IMREAD_COLOR), np.uint8)
