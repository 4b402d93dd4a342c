"""Lettering on bodies, panels and the picture itself, as masks from the plates' fonts."""

from functools import lru_cache

import cv2
import numpy as np

from sim_rig.rendering.glyphs import font_names, text_row
from sim_rig.rendering.plate_texts import word
from sim_rig.rendering.street.canvas import Bgr, Canvas, Image, Points
from sim_rig.rendering.street.paint import body_colour
from sim_rig.rendering.street.solids import Face

_WORDS = 150


@lru_cache(maxsize=1)
def _masks() -> tuple[Image, ...]:
    """Words as masks 24 px high, drawn once: rendering a font takes longer than all the rest."""
    rng = np.random.default_rng(0)
    fonts = font_names()
    found = []
    for _ in range(_WORDS):
        row = text_row(word(rng, 12), fonts[rng.integers(len(fonts))], weight_px=2)
        size = max(4, round(24 * row.shape[1] / row.shape[0])), 24
        found.append(np.asarray(cv2.resize(row, size, interpolation=cv2.INTER_AREA), np.uint8))
    return tuple(found)


def word_mask(rng: np.random.Generator) -> Image:
    """A word, (24, w), 0 to 255. Callers must not write to it."""
    return _masks()[int(rng.integers(_WORDS))]


def write_on(canvas: Canvas, face: Face, shape: Points, rng: np.random.Generator) -> None:
    """Write one to three rows of words into a shape (4, 2) of a face."""
    bgr = canvas.seen(body_colour(rng), face.level, face.ahead_m)
    rows = int(rng.integers(1, 4))
    for row in range(rows):
        upper = shape[0] + (row + 0.1) / rows * (shape[3] - shape[0])
        lower = shape[0] + (row + 0.9) / rows * (shape[3] - shape[0])
        end = shape[1] - shape[0]
        part = np.asarray([upper, upper + end, lower + end, lower])
        write_px(canvas.image, face.pixels(canvas, part), bgr, rng)


def write_px(image: Image, quad_px: Points, bgr: Bgr, rng: np.random.Generator) -> None:
    """Write a word into a quadrilateral (4, 2) of an image."""
    height, width = image.shape[:2]
    left, top = np.clip(np.floor(quad_px.min(axis=0)), 0, (width, height)).astype(int)
    right, bottom = np.clip(np.ceil(quad_px.max(axis=0)), 0, (width, height)).astype(int)
    if right - left < 3 or bottom - top < 3:
        return
    mask = word_mask(rng)
    rows, columns = mask.shape
    source = np.asarray([(0, 0), (columns, 0), (columns, rows), (0, rows)], np.float32)
    matrix = cv2.getPerspectiveTransform(source, (quad_px - (left, top)).astype(np.float32))
    size = int(right - left), int(bottom - top)
    share = cv2.warpPerspective(mask, matrix, size, flags=cv2.INTER_AREA)[..., None] / 255.0
    part = image[top:bottom, left:right]
    part[:] = (part * (1 - share) + share * np.asarray(bgr)).astype(np.uint8)
