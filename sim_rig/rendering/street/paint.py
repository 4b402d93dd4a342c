"""Colours and parts that every kind of vehicle has: bands of reflection, glass, lamps, plates."""

from dataclasses import dataclass

import cv2
import numpy as np

from sim_rig.rendering.street.canvas import Bgr, Canvas, Points
from sim_rig.rendering.street.solids import Face, rectangle

GLASS: Bgr = (48.0, 44.0, 40.0)
RUBBER: Bgr = (26.0, 25.0, 25.0)
PLASTIC: Bgr = (45.0, 44.0, 43.0)
_GREYS = (12, 18, 25, 40, 70, 100, 130, 165, 190, 215, 235, 248)
_PLATES: tuple[Bgr, ...] = (
    (235.0, 235.0, 235.0),
    (215.0, 225.0, 230.0),
    (60.0, 190.0, 235.0),
    (160.0, 70.0, 40.0),
    (70.0, 150.0, 60.0),
)


@dataclass(frozen=True, slots=True)
class Lamps:
    """State of a vehicle's lamps: emission of each kind, 0 for off."""

    tail: float
    brake: float
    head: float
    turn: float


def body_colour(rng: np.random.Generator) -> Bgr:
    """Draw a body's colour: most vehicles are white, grey or black."""
    if rng.random() < 0.68:
        grey = float(rng.choice(_GREYS))
        blue, green, red = np.clip(grey + rng.normal(0, 5, 3), 4, 252).tolist()
        return blue, green, red
    hue, saturation, value = rng.integers(0, 180), rng.integers(90, 240), rng.integers(40, 240)
    pixel = np.asarray([[[hue, saturation, value]]], np.uint8)
    blue, green, red = cv2.cvtColor(pixel, cv2.COLOR_HSV2BGR)[0, 0].tolist()
    return blue, green, red


def random_lamps(canvas: Canvas, rng: np.random.Generator) -> Lamps:
    """Draw which lamps are on."""
    dark = canvas.light.is_dark
    is_on = dark or rng.random() < 0.25
    return Lamps(
        tail=float(rng.uniform(0.7, 1.6)) if is_on else 0.0,
        brake=float(rng.uniform(1.2, 2.2)) if rng.random() < (0.45 if dark else 0.3) else 0.0,
        head=float(rng.uniform(1.2, 2.5)) if is_on else 0.0,
        turn=float(rng.uniform(1.0, 2.0)) if rng.random() < 0.08 else 0.0,
    )


def toned(bgr: Bgr, factor: float) -> Bgr:
    """A lighter or darker colour."""
    blue, green, red = (min(255.0, factor * value) for value in bgr)
    return blue, green, red


def paint_body(canvas: Canvas, face: Face, bgr: Bgr, rng: np.random.Generator) -> None:
    """Fill a face with paint that mirrors the sky above and the road below."""
    face.paint(canvas, rectangle(0, 0, 1, 1), bgr)
    shine = rng.uniform(0.0, 0.3)
    edge = rng.uniform(0.25, 0.6)
    for top, bottom, factor in (
        (0.0, edge * 0.5, 1 + shine),
        (edge * 0.5, edge, 1 + 0.4 * shine),
        (edge + 0.5 * (1 - edge), 1.0, 1 - 0.8 * shine),
    ):
        face.paint(canvas, rectangle(0, top, 1, bottom), toned(bgr, factor))


def paint_glass(
    canvas: Canvas, face: Face, shape: Points, rng: np.random.Generator, clear: float = 0.35
) -> None:
    """Fill a window: dark, with the sky in it, or what is behind.

    Args:
        canvas: drawn onto.
        face: with the window.
        shape: (4, 2) on the face: upper left, upper right, lower right, lower left.
        rng: source of all random numbers.
        clear: chance that one looks through.
    """
    tint = rng.uniform(0.4, 1.6)
    face.paint(canvas, shape, toned(GLASS, tint), emission=0.25 * canvas.light.ambient)
    mirrored = rng.uniform(0.0, 0.9) if rng.random() < 0.6 else 0.0
    if mirrored > 0.05:
        down = rng.uniform(0.2, 1.0)
        part = shape.copy()
        part[3] = shape[0] + down * rng.uniform(0.5, 1.0) * (shape[3] - shape[0])
        part[2] = shape[1] + down * (shape[2] - shape[1])
        sky = np.asarray(canvas.light.sky_bgr) * mirrored + np.asarray(GLASS) * (1 - mirrored)
        canvas.fill_px(face.pixels(canvas, part), (float(sky[0]), float(sky[1]), float(sky[2])))
    if rng.random() < clear:  # the view through, between seats and heads
        low, high = rng.uniform(0.05, 0.3), rng.uniform(0.5, 0.9)
        inner = _inside(shape, 0.1, low, 0.9, high)
        through = toned(canvas.light.sky_bgr, rng.uniform(0.2, 0.8))
        canvas.fill_px(face.pixels(canvas, inner), through)
        for middle in rng.uniform(0.2, 0.8, rng.integers(1, 5)):
            half = rng.uniform(0.04, 0.09)
            seat = _inside(shape, middle - half, rng.uniform(low, high), middle + half, high)
            face.paint(canvas, seat, toned(GLASS, 0.7))


def _inside(shape: Points, left: float, top: float, right: float, bottom: float) -> Points:
    """Part of a quadrilateral, in shares of its sides."""

    def at(u: float, v: float) -> Points:
        upper = shape[0] + u * (shape[1] - shape[0])
        return np.asarray(upper + v * (shape[3] + u * (shape[2] - shape[3]) - upper))

    return np.asarray([at(left, top), at(right, top), at(right, bottom), at(left, bottom)])


def paint_lamp(
    canvas: Canvas, face: Face, shape: Points, bgr: Bgr, emission: float, *, radius_m: float
) -> None:
    """Fill a lamp; one that is on is bright in its middle and glows.

    Args:
        canvas: drawn onto.
        face: with the lamp.
        shape: (n, 2) on the face.
        bgr: colour of its light; its glass is darker.
        emission: 0 for off.
        radius_m: of its glow.
    """
    if emission <= 0.0:
        face.paint(canvas, shape, toned(bgr, 0.62))
        return
    face.paint(canvas, shape, bgr, emission=emission)
    middle = shape.mean(axis=0)
    white = np.asarray(bgr) * 0.4 + 255 * 0.6
    core = (float(white[0]), float(white[1]), float(white[2]))
    face.paint(canvas, middle + 0.5 * (shape - middle), core, emission=emission)
    canvas.shine(face.points(middle[None])[0], radius_m, toned(bgr, min(1.0, 0.4 * emission)))


def paint_plate(
    canvas: Canvas, face: Face, centre: tuple[float, float], rng: np.random.Generator
) -> None:
    """Draw a plate with strokes for its characters, by night lit."""
    across_m = float(np.linalg.norm(face.corners_m[1] - face.corners_m[0]))
    down_m = float(np.linalg.norm(face.corners_m[3] - face.corners_m[0]))
    width, height = ((0.52, 0.11), (0.305, 0.15), (0.4, 0.13))[rng.integers(3)]
    half_u, half_v = width / 2 / across_m, height / 2 / down_m
    u, v = centre
    glow = 0.8 if canvas.light.is_dark else 0.0
    plate = rectangle(u - half_u, v - half_v, u + half_u, v + half_v)
    ground = _PLATES[int(rng.choice(len(_PLATES), p=[0.5, 0.2, 0.16, 0.08, 0.06]))]
    face.paint(canvas, plate, ground, emission=glow)
    for stroke in np.linspace(u - 0.8 * half_u, u + 0.8 * half_u, 7):
        half = 0.06 * half_u
        part = rectangle(stroke - half, v - 0.6 * half_v, stroke + half, v + 0.6 * half_v)
        face.paint(canvas, part, (40.0, 40.0, 40.0), emission=0.5 * glow)


def circle(u: float, v: float, radius_u: float, radius_v: float) -> Points:
    """A shape on a face: an ellipse."""
    turn = np.linspace(0, 2 * np.pi, 14, endpoint=False)
    return np.column_stack([u + radius_u * np.cos(turn), v + radius_v * np.sin(turn)])
