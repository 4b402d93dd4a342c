"""Noise for surfaces, drawn once: tiles of which each picture takes a part."""

from functools import lru_cache

import cv2
import numpy as np
import numpy.typing as npt

Tile = npt.NDArray[np.float32]
"""(h, w) factors, 1 in the mean."""

_SIDE, _COUNT = 640, 24


@lru_cache(maxsize=1)
def _tiles() -> tuple[Tile, ...]:
    rng = np.random.default_rng(1)
    found = []
    for number in range(_COUNT):
        roughness = rng.uniform(0.45, 1.1)
        total = np.zeros((_SIDE, _SIDE), np.float32)
        for octave in range(7):
            side = _SIDE // 2**octave
            shape = (side, max(2, side // (1 + number % 3)))
            grain = rng.standard_normal(shape, np.float32)
            grown = cv2.resize(grain, (_SIDE, _SIDE), interpolation=cv2.INTER_CUBIC)
            total += np.asarray(grown, np.float32) * np.float32(roughness ** (6 - octave))
        found.append(np.asarray((total - total.mean()) / total.std(), np.float32))
    return tuple(found)


def tile(shape: tuple[int, int], strength: float, rng: np.random.Generator) -> Tile:
    """Factors (h, w) with some standard deviation: a part of a tile, at most as large, stretched.

    Args:
        shape: rows and columns.
        strength: standard deviation.
        rng: source of all random numbers.
    """
    whole = _tiles()[int(rng.integers(_COUNT))]
    rows, columns = (int(side) for side in rng.integers(40, _SIDE, 2))
    top, left = int(rng.integers(0, _SIDE - rows)), int(rng.integers(0, _SIDE - columns))
    part = cv2.resize(whole[top : top + rows, left : left + columns], shape[::-1])
    return np.asarray(1.0 + np.float32(strength) * np.asarray(part), np.float32)


def roughen(image: npt.NDArray[np.uint8], factors: Tile) -> None:
    """Multiply an image (h, w, 3) by factors (h, w), in place."""
    three = np.asarray(cv2.merge([factors, factors, factors]), np.float32)
    cv2.multiply(image, three, dst=image, dtype=cv2.CV_8U)
