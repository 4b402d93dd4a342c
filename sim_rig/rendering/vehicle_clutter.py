"""Random, roughly drawn cars with parts that resemble plates, as negative examples."""

import cv2
import numpy as np

from sim_rig.rendering.car_art import rear_of_car
from sim_rig.rendering.clutter import (
    Bgr,
    Image,
    blend,
    box,
    colour,
    disc,
    letters,
    place,
    strokes,
    write,
)
from sim_rig.rendering.glyphs import font_names, text_row
from sim_rig.rendering.plate_texts import word


def add_car(
    image: Image, centre: tuple[float, float], width_px: float, rng: np.random.Generator
) -> None:
    """Draw a car from behind or from the front, with lamps, grille, badges and seams.

    Args:
        image: drawn onto.
        centre: about (x, y), px.
        width_px: width of the car.
        rng: source of all random numbers.
    """
    width, height = max(8, round(width_px)), max(8, round(width_px * rng.uniform(0.7, 1.1)))
    bgr = colour(rng)
    braking = bool(rng.random() < 0.3)
    rear = rear_of_car(1.8, 1.5, _few(bgr), braking)
    car = np.asarray(cv2.resize(rear, (width, height), interpolation=cv2.INTER_AREA), np.uint8)
    body = car[..., :3].copy()
    for _ in range(rng.integers(1, 10)):
        _TRIM[rng.integers(len(_TRIM))](body, rng)
    shine = np.linspace(rng.uniform(-40, 40), rng.uniform(-40, 40), height)[:, None, None]
    body = np.clip(body + shine, 0, 255).astype(np.uint8)
    left = round(centre[0] - width * rng.uniform(0.35, 0.65))
    top = round(centre[1] - height * rng.uniform(0.45, 0.75))
    blend(image, body, car[..., 3], left, top)


def _few(bgr: Bgr) -> Bgr:
    """Round sizes, so that drawn cars can be cached."""
    blue, green, red = (channel // 64 * 64 + 20 for channel in bgr)
    return blue, green, red


def _grille(image: Image, rng: np.random.Generator) -> None:
    x0, y0, x1, y1 = place(image, rng, 0.5)
    cv2.rectangle(image, (x0, y0), (x1, y1), (25, 25, 25), cv2.FILLED)
    paint, thickness = colour(rng), int(rng.integers(1, 4))
    step = int(rng.integers(3, 12))
    if rng.random() < 0.7:
        for y in range(y0, y1, step):
            cv2.line(image, (x0, y), (x1, y), paint, thickness)
    else:
        for x in range(x0, x1, step):
            cv2.line(image, (x, y0), (x, y1), paint, thickness)


def _lamp(image: Image, rng: np.random.Generator) -> None:
    x0, y0, x1, y1 = place(image, rng, 0.25)
    centre, axes = ((x0 + x1) // 2, (y0 + y1) // 2), ((x1 - x0) // 2, (y1 - y0) // 2)
    shell: Bgr = (40, 40, 200) if rng.random() < 0.5 else (225, 225, 225)
    cv2.ellipse(image, centre, axes, 0, 0, 360, shell, -1, cv2.LINE_AA)
    inner = (max(1, axes[0] // 2), max(1, axes[1] // 2))
    cv2.ellipse(image, centre, inner, 0, 0, 360, (245, 250, 255), -1, cv2.LINE_AA)


def _head_lamp(image: Image, rng: np.random.Generator) -> None:
    """A bright housing as long as a plate, with bulbs, rims and ribs in it."""
    x0, y0, x1, y1 = place(image, rng, 0.35)
    y1 = min(y1, y0 + (x1 - x0))  # at most as high as long
    lean = rng.normal(0, 0.08, (4, 2)) * (x1 - x0)
    corners = np.asarray([(x0, y0), (x1, y0), (x1, y1), (x0, y1)]) + lean
    outline = np.rint(corners).astype(np.int32)
    glass = rng.integers(120, 250)
    cv2.fillConvexPoly(image, outline, _shade(glass, rng), cv2.LINE_AA)
    for _ in range(rng.integers(0, 10)):
        x = int(rng.integers(x0, x1))
        cv2.line(image, (x, y0), (x, y1), _shade(rng.integers(40, 250), rng), 1, cv2.LINE_AA)
    radius = max(1, (y1 - y0) // 2)
    for _ in range(rng.integers(1, 4)):
        centre = int(rng.integers(x0, x1)), (y0 + y1) // 2
        cv2.circle(image, centre, radius, _shade(rng.integers(20, 250), rng), -1, cv2.LINE_AA)
        rim = max(1, int(radius * rng.uniform(0.4, 0.9)))
        cv2.circle(image, centre, rim, _shade(rng.integers(20, 250), rng), 1, cv2.LINE_AA)
    cv2.polylines(image, [outline], True, _shade(rng.integers(20, 250), rng), 1, cv2.LINE_AA)


def _lit_lamp(image: Image, rng: np.random.Generator) -> None:
    """A lamp that shines, or a reflector in the sun: white, its glow in the colour of the glass."""
    x0, y0, x1, y1 = place(image, rng, 0.3)
    centre, axes = ((x0 + x1) // 2, (y0 + y1) // 2), ((x1 - x0) // 2, (y1 - y0) // 3)
    glass = ((30, 30, 220), (30, 140, 240), (235, 240, 245))[rng.integers(3)]
    cv2.ellipse(image, centre, axes, 0, 0, 360, glass, -1, cv2.LINE_AA)
    if rng.random() < 0.4:  # diodes in rows
        step = max(2, (y1 - y0) // int(rng.integers(2, 6)))
        for y in range(y0 + step // 2, y1, step):
            for x in range(x0 + step // 2, x1, step):
                cv2.circle(image, (x, y), max(1, step // 3), (250, 250, 255), -1, cv2.LINE_AA)
        return
    inner = max(1, int(axes[0] * rng.uniform(0.3, 0.9))), max(1, int(axes[1] * 0.7))
    cv2.ellipse(image, centre, inner, 0, 0, 360, (255, 255, 255), -1, cv2.LINE_AA)


def _emblem(image: Image, rng: np.random.Generator) -> None:
    """A maker's sign: a ring, a shield or an oval, with strokes or letters in it."""
    x0, y0, x1, y1 = place(image, rng, 0.25)
    centre, axes = ((x0 + x1) // 2, (y0 + y1) // 2), ((x1 - x0) // 2, (y1 - y0) // 2)
    chrome, ground = _shade(rng.integers(120, 250), rng), colour(rng)
    cv2.ellipse(image, centre, axes, 0, 0, 360, ground, -1, cv2.LINE_AA)
    thickness = max(1, round(min(axes) * rng.uniform(0.08, 0.3)))
    cv2.ellipse(image, centre, axes, 0, 0, 360, chrome, thickness, cv2.LINE_AA)
    if rng.random() < 0.5:
        fonts = font_names()
        row = text_row(word(rng, 6), fonts[rng.integers(len(fonts))], weight_px=3)
        size = max(3, round(1.4 * axes[0])), max(3, round(0.8 * axes[1]))
        row = np.asarray(cv2.resize(row, size, interpolation=cv2.INTER_AREA), np.uint8)
        write(image, row, chrome, x0 + axes[0] * 3 // 10, y0 + axes[1] * 6 // 10)
        return
    for _ in range(rng.integers(1, 5)):
        start, end = rng.integers((x0, y0), (x1, y1), (2, 2)).tolist()
        cv2.line(image, start, end, chrome, thickness, cv2.LINE_AA)


def _shade(grey: int | np.integer, rng: np.random.Generator) -> Bgr:
    """A grey, hardly coloured."""
    blue, green, red = (int(v) for v in np.clip(grey + rng.normal(0, 6, 3), 0, 255))
    return blue, green, red


def _badge(image: Image, rng: np.random.Generator) -> None:
    letters(image, rng, image.shape[0] * rng.uniform(0.02, 0.08), panel=False)


_TRIM = (
    *(_grille, strokes, _badge, box, disc, _lamp),
    *(_head_lamp, _lit_lamp, _emblem) * 3,
)
"""Parts of cars; lamps and emblems, as bright and as long as plates, are the most frequent."""
