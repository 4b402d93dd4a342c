"""Wear of plates: dirt, fading, scratches."""

import cv2
import numpy as np

from sim_rig.rendering.plate_art import Art


def worn(art: Art, rng: np.random.Generator) -> Art:
    """Add random wear to the image of a plate; many plates stay new."""
    kind = rng.choice(4, p=[0.55, 0.2, 0.15, 0.1])
    if kind == 1:
        return _dirty(art, rng)
    if kind == 2:
        return _faded(art, rng)
    if kind == 3:
        return _scratched(_dirty(art, rng), rng)
    return art


def _patches(shape: tuple[int, ...], rng: np.random.Generator) -> Art:
    """Smooth patches, 0 to 1, with no scale of their own."""
    rows, columns = shape[:2]
    total = np.zeros((rows, columns), np.float32)
    for cells in (2, 5, 12):
        coarse = rng.standard_normal((cells, 2 * cells), np.float32)
        total += np.asarray(cv2.resize(coarse, (columns, rows), interpolation=cv2.INTER_CUBIC))
    return np.asarray(1 / (1 + np.exp(-2 * (total - rng.uniform(-0.5, 2.5)))))[..., None]


def _dirty(art: Art, rng: np.random.Generator) -> Art:
    """Mud or dust over all of it, thicker in patches."""
    grey = rng.uniform(30, 170)
    mud = np.asarray([0.85, 0.95, 1.05]) * grey
    share = rng.uniform(0.2, 0.7) * _patches(art.shape, rng)
    return np.asarray(np.clip(art * (1 - share) + mud * share, 0, 255), np.uint8)


def _faded(art: Art, rng: np.random.Generator) -> Art:
    """Reduce the contrast of text and ground, more in patches."""
    ground = np.median(art.reshape(-1, 3), axis=0)
    share = rng.uniform(0.1, 0.5) + rng.uniform(0.0, 0.4) * _patches(art.shape, rng)
    return np.asarray(np.clip(art * (1 - share) + ground * share, 0, 255), np.uint8)


def _scratched(art: Art, rng: np.random.Generator) -> Art:
    """Thin lines in a colour between ink and ground."""
    scratched = art.copy()
    rows, columns = art.shape[:2]
    for _ in range(rng.integers(2, 12)):
        start = rng.uniform((0, 0), (columns, rows))
        end = start + rng.normal(0, 0.3 * rows, 2)
        shade = int(rng.integers(40, 230))
        line = np.rint(np.asarray([start, end])).astype(int).tolist()
        cv2.line(scratched, line[0], line[1], (shade,) * 3, int(rng.integers(1, 3)), cv2.LINE_AA)
    return scratched
