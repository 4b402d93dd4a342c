"""Motorcycles with their riders, and people on foot, which are no vehicles."""

import numpy as np

from sim_rig.rendering.street.canvas import Bgr, Canvas
from sim_rig.rendering.street.cars import RED, WHITE
from sim_rig.rendering.street.paint import RUBBER, body_colour, circle, random_lamps, toned
from sim_rig.rendering.street.solids import Face, Pose, rectangle


def draw_motorcycle(
    canvas: Canvas, pose: Pose, size_m: tuple[float, float, float], rng: np.random.Generator
) -> None:
    """Draw a motorcycle and its rider as flat shapes across the line of sight.

    Args:
        canvas: drawn onto.
        pose: of its middle; seen from ahead if the heading is more than 90 degrees.
        size_m: length, width and height with the rider.
        rng: source of all random numbers.
    """
    _, width_m, height_m = size_m
    face = _upright(canvas, pose, width_m, height_m)
    jacket, trousers, body = body_colour(rng), toned(body_colour(rng), 0.6), body_colour(rng)
    wheel = float(rng.uniform(0.08, 0.12))
    face.paint(canvas, rectangle(0.5 - wheel, 0.62, 0.5 + wheel, 1.0), RUBBER)
    for side in (-1, 1):  # legs
        legs = [
            (0.5 + side * x, y) for x, y in ((0.1, 0.45), (0.4, 0.62), (0.38, 0.88), (0.2, 0.85))
        ]
        face.paint(canvas, legs, trousers)
    face.paint(canvas, rectangle(0.28, 0.55, 0.72, float(rng.uniform(0.66, 0.78))), body)
    torso = ((0.3, 0.2), (0.7, 0.2), (0.8, 0.5), (0.2, 0.5))
    face.paint(canvas, torso, jacket)
    for side in (-1, 1):  # arms
        arms = [
            (0.5 + side * x, y) for x, y in ((0.2, 0.2), (0.5, 0.42), (0.46, 0.48), (0.2, 0.36))
        ]
        face.paint(canvas, arms, toned(jacket, 0.85))
    face.paint(canvas, circle(0.5, 0.1, 0.17, 0.1), body_colour(rng))
    lamps = random_lamps(canvas, rng)
    is_rear = abs(pose.heading_rad) < np.pi / 2
    tone: Bgr = RED if is_rear else WHITE
    emission = max(lamps.brake, lamps.tail) if is_rear else max(lamps.head, 1.2)
    lamp = circle(0.5, 0.58, 0.1, 0.035)
    face.paint(canvas, lamp, tone, emission=emission)
    if emission > 0.0:
        canvas.shine(face.points(lamp.mean(axis=0)[None])[0], 0.08, tone)
    if is_rear and rng.random() < 0.8:
        face.paint(canvas, rectangle(0.37, 0.64, 0.63, 0.72), (215.0, 220.0, 225.0))


def draw_person(canvas: Canvas, pose: Pose, rng: np.random.Generator) -> None:
    """Draw somebody on foot."""
    face = _upright(canvas, pose, 0.55, float(rng.uniform(1.5, 1.9)))
    coat, trousers = body_colour(rng), toned(body_colour(rng), 0.7)
    gait = float(rng.uniform(0.0, 0.2))
    face.paint(canvas, ((0.35, 0.5), (0.5, 0.5), (0.5 - gait, 1.0), (0.3 - gait, 1.0)), trousers)
    face.paint(canvas, ((0.5, 0.5), (0.65, 0.5), (0.7 + gait, 1.0), (0.5 + gait, 1.0)), trousers)
    face.paint(canvas, ((0.25, 0.16), (0.75, 0.16), (0.72, 0.55), (0.28, 0.55)), coat)
    face.paint(canvas, circle(0.5, 0.08, 0.14, 0.075), (110.0, 140.0, 190.0))


def _upright(canvas: Canvas, pose: Pose, width_m: float, height_m: float) -> Face:
    """A face across the road, turned to the camera."""
    half_m = width_m / 2
    corners = [
        (pose.ahead_m, pose.right_m + side * half_m, pose.up_m + up_m)
        for side, up_m in ((-1, height_m), (1, height_m), (1, 0.0), (-1, 0.0))
    ]
    normal = (-1.0, 0.0, 0.0)
    level = canvas.level(normal, pose.ahead_m)
    return Face(np.asarray(corners), normal, level, pose.ahead_m)
