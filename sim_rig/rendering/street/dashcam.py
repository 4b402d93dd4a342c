"""A dashcam: vignette, exposure, blur, grain, sharpening, compression, burnt-in text."""

import cv2
import numpy as np

from sim_rig.rendering.lens import photograph
from sim_rig.rendering.street.canvas import Image
from sim_rig.rendering.street.textures import roughen
from sim_rig.rendering.street.windscreen import burn_in


def through_dashcam(picture: Image, rng: np.random.Generator) -> Image:
    """Return a picture as a dashcam chosen at random records it, same shape."""
    rows, columns = picture.shape[:2]
    if rng.random() < 0.35:
        y, x = np.ogrid[-1 : 1 : complex(rows), -1 : 1 : complex(columns)]
        fall = 1 - float(rng.uniform(0.1, 0.6)) * (x * x + y * y) / 2
        roughen(picture, np.asarray(fall, np.float32))
    if rng.random() < 0.15:
        burn_in(picture, rng)
    if rng.random() < 0.2:
        picture = photograph(picture, rng, float(rng.uniform(0.5, 2.0)))
    else:
        picture = _recorded(_developed(picture, rng), rng)
    if rng.random() < 0.25:
        burn_in(picture, rng)
    return picture


def _developed(picture: Image, rng: np.random.Generator) -> Image:
    """Exposure to some mean level, colours, blur, grain and sharpening."""
    light = picture.astype(np.float32)
    level = max(8.0, float(light.mean()))
    wanted = float(np.exp(rng.uniform(np.log(0.45), np.log(1.35)))) * 105.0
    gain = (wanted / level) ** float(rng.uniform(0.4, 1.0))
    cast = rng.normal(1.0, 0.05, 3)
    grey = np.arange(256, dtype=np.float64)[:, None] / 255 * min(gain, 6.0) * cast
    curve = np.clip(grey, 0, 1) ** float(np.exp(rng.normal(0, 0.25)))
    veil = float(rng.uniform(0, 35)) if rng.random() < 0.3 else 0.0
    table = np.clip(veil + (255 - veil) * curve, 0, 255).astype(np.uint8)[None]
    light = np.asarray(cv2.LUT(picture, table), np.float32)
    if rng.random() < 0.4:  # paler or stronger colours
        grey_light = light.mean(axis=2, keepdims=True)
        light = grey_light + float(rng.uniform(0.0, 1.5)) * (light - grey_light)
    sigma = float(rng.uniform(0.0, 1.1))
    if sigma > 0.3:
        light = np.asarray(cv2.GaussianBlur(light, (0, 0), sigma), np.float32)
    if rng.random() < 0.15:  # shaken, or moving fast
        length = int(rng.integers(2, 7))
        size = (length, 1) if rng.random() < 0.6 else (1, length)
        light = np.asarray(cv2.blur(light, size), np.float32)
    if rng.random() < 0.6:
        grain = rng.standard_normal(light.shape[:2], np.float32)
        light += np.float32(rng.uniform(0.5, 7.0)) * grain[..., None]
    if rng.random() < 0.5:
        soft = np.asarray(cv2.GaussianBlur(light, (0, 0), float(rng.uniform(0.7, 1.6))))
        light = light + float(rng.uniform(0.2, 1.4)) * (light - soft)
    return np.clip(light, 0, 255).astype(np.uint8)


def _recorded(picture: Image, rng: np.random.Generator) -> Image:
    """Compressed in blocks, in a share at a smaller size."""
    rows, columns = picture.shape[:2]
    small = rng.random() < 0.3
    if small:
        share = float(rng.uniform(0.5, 0.95))
        size = round(columns * share), round(rows * share)
        picture = np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_AREA), np.uint8)
    if rng.random() < 0.85:
        quality = int(rng.integers(18, 95))
        _, code = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, quality])
        picture = np.asarray(cv2.imdecode(code, cv2.IMREAD_COLOR), np.uint8)
    if small:
        way = cv2.INTER_LINEAR if rng.random() < 0.6 else cv2.INTER_CUBIC
        picture = np.asarray(cv2.resize(picture, (columns, rows), interpolation=way), np.uint8)
    return picture
