"""Trucks, trailers, tankers, buses: bodies as high as a house on dark frames."""

from collections.abc import Callable

import numpy as np

from sim_rig.rendering.street.canvas import Bgr, Canvas
from sim_rig.rendering.street.cars import AMBER, RED, WHITE
from sim_rig.rendering.street.lettering import write_on
from sim_rig.rendering.street.paint import (
    PLASTIC,
    RUBBER,
    Lamps,
    body_colour,
    circle,
    paint_body,
    paint_glass,
    paint_lamp,
    paint_plate,
    random_lamps,
    toned,
)
from sim_rig.rendering.street.solids import CrossSection, Face, Pose, rectangle, visible_faces

_DARK: Bgr = (24.0, 24.0, 24.0)


def draw_truck(
    canvas: Canvas, pose: Pose, size_m: tuple[float, float, float], rng: np.random.Generator
) -> None:
    """Draw a truck or a trailer of some length, width and height; `pose` is that of its middle."""
    length_m, width_m, height_m = size_m
    lamps, half_m = random_lamps(canvas, rng), width_m / 2
    floor_m = float(rng.uniform(0.85, 1.25))
    cab_m = min(2.2, 0.3 * length_m)
    _frame(canvas, pose, size_m, floor_m, rng)
    front_m = length_m / 2
    body = (
        CrossSection(-front_m, front_m - cab_m - 0.3, half_m, floor_m),
        CrossSection(-front_m, front_m - cab_m - 0.3, half_m, height_m),
    )
    cab_height_m = float(rng.uniform(2.5, 3.7))
    cab = (
        CrossSection(front_m - cab_m, front_m, 0.96 * half_m, 0.5),
        CrossSection(front_m - cab_m, front_m - 0.15, 0.92 * half_m, cab_height_m),
    )
    drawers: list[Callable[[], None]] = [
        lambda: _cab(canvas, visible_faces(canvas, pose, *cab), lamps, rng),
        lambda: _load(canvas, pose, body, rng),
    ]
    middle_m = pose.place([(front_m, 0, 0), (-front_m, 0, 0)])[:, 0]
    for draw in drawers if middle_m[0] > middle_m[1] else drawers[::-1]:
        draw()
    _tail(*(canvas, pose), rear_m=-front_m, half_m=half_m, floor_m=floor_m, lamps=lamps, rng=rng)


def draw_bus(
    canvas: Canvas, pose: Pose, size_m: tuple[float, float, float], rng: np.random.Generator
) -> None:
    """Draw a bus of some length, width and height; `pose` is that of its middle."""
    length_m, width_m, height_m = size_m
    lamps, bgr, half_m = random_lamps(canvas, rng), body_colour(rng), width_m / 2
    low = CrossSection(-length_m / 2, length_m / 2, half_m, 0.3)
    high = CrossSection(-length_m / 2 + 0.1, length_m / 2 - 0.15, 0.95 * half_m, height_m)
    sash = toned(body_colour(rng), 1.0)
    top, bottom = float(rng.uniform(0.1, 0.2)), float(rng.uniform(0.42, 0.55))
    for name, face in visible_faces(canvas, pose, low, high).items():
        paint_body(canvas, face, bgr, rng)
        if name == "top":
            continue
        if rng.random() < 0.5:
            face.paint(canvas, rectangle(0, 0.62, 1, float(rng.uniform(0.68, 0.85))), sash)
        face.paint(canvas, rectangle(0, 0.92, 1, 1), PLASTIC)
        if name in ("left", "right"):
            ends = np.linspace(0.02, 0.98, int(rng.integers(5, 9)))
            for left, right in zip(ends[:-1] + 0.004, ends[1:] - 0.004, strict=True):
                paint_glass(canvas, face, rectangle(left, top, right, bottom), rng, 0.1)
            _wheels_of(canvas, face, (0.14, 0.78) if name == "right" else (0.22, 0.86), length_m)
            if rng.random() < 0.5:
                write_on(canvas, face, rectangle(0.2, 0.6, 0.8, 0.8), rng)
        elif name == "front":
            paint_glass(canvas, face, rectangle(0.04, 0.12, 0.96, 0.62), rng)
            for left in (0.05, 0.8):
                at = rectangle(left, 0.74, left + 0.15, 0.83)
                paint_lamp(canvas, face, at, WHITE, lamps.head, radius_m=0.3)
            paint_plate(canvas, face, (0.5, 0.88), rng)
        else:
            if rng.random() < 0.75:
                paint_glass(canvas, face, rectangle(0.08, 0.1, 0.92, bottom), rng)
            else:
                write_on(canvas, face, rectangle(0.1, 0.1, 0.9, 0.5), rng)
            face.paint(canvas, rectangle(0.15, 0.62, 0.85, 0.85), toned(_DARK, 2.0))
            _rear_lamps(canvas, face, lamps, (0.55, 0.8), rng)
            paint_plate(canvas, face, (0.5, 0.88), rng)


def _frame(
    canvas: Canvas,
    pose: Pose,
    size_m: tuple[float, float, float],
    floor_m: float,
    rng: np.random.Generator,
) -> None:
    """Wheels and the dark below the floor."""
    length_m, width_m, _ = size_m
    half_m = width_m / 2
    low = CrossSection(-length_m / 2 + 0.5, length_m / 2, 0.8 * half_m, 0.35)
    high = CrossSection(-length_m / 2 + 0.2, length_m / 2, 0.85 * half_m, floor_m)
    for face in visible_faces(canvas, pose, low, high).values():
        face.paint(canvas, rectangle(0, 0, 1, 1), _DARK)
    radius_m = float(rng.uniform(0.45, 0.54))
    axles = [-length_m / 2 + 1.0, -length_m / 2 + 2.3, length_m / 2 - 1.2]
    for along_m in axles[int(rng.random() < 0.3) :]:
        for side in (-1, 1):
            wheel = visible_faces(
                canvas,
                Pose(
                    float(pose.place([(along_m, side * (half_m - 0.3), 0)])[0, 0]),
                    float(pose.place([(along_m, side * (half_m - 0.3), 0)])[0, 1]),
                    pose.heading_rad,
                ),
                CrossSection(-0.8 * radius_m, 0.8 * radius_m, 0.28, 0.0),
                CrossSection(-0.8 * radius_m, 0.8 * radius_m, 0.28, 2 * radius_m),
            )
            for name, face in wheel.items():
                if name in ("left", "right"):
                    face.paint(canvas, circle(0.5, 0.5, 0.62, 0.5), RUBBER)
                    face.paint(canvas, circle(0.5, 0.5, 0.35, 0.28), (110.0, 110.0, 110.0))
                else:
                    face.paint(canvas, rectangle(0, 0, 1, 1), RUBBER)


def _wheels_of(canvas: Canvas, face: Face, shares: tuple[float, float], length_m: float) -> None:
    down_m = float(np.linalg.norm(face.corners_m[3] - face.corners_m[0]))
    for share in shares:
        size = 0.5 / length_m, 0.5 / down_m
        face.paint(canvas, circle(share, 0.97, 1.2 * size[0], 1.2 * size[1]), _DARK)
        face.paint(canvas, circle(share, 0.98, *size), RUBBER)
        face.paint(canvas, circle(share, 0.98, 0.5 * size[0], 0.5 * size[1]), (130.0,) * 3)


def _cab(canvas: Canvas, faces: dict[str, Face], lamps: Lamps, rng: np.random.Generator) -> None:
    bgr = body_colour(rng)
    for name, face in faces.items():
        paint_body(canvas, face, bgr, rng)
        if name == "front":
            paint_glass(canvas, face, rectangle(0.05, 0.12, 0.95, 0.45), rng)
            face.paint(canvas, rectangle(0.2, 0.55, 0.8, 0.8), PLASTIC)
            for left in (0.03, 0.79):
                at = rectangle(left, 0.8, left + 0.18, 0.9)
                paint_lamp(canvas, face, at, WHITE, lamps.head, radius_m=0.3)
            paint_plate(canvas, face, (0.5, 0.92), rng)
        elif name in ("left", "right"):
            window = rectangle(0.3, 0.15, 0.9, 0.45)
            paint_glass(canvas, face, window, rng, 0.1)


def _load(
    canvas: Canvas, pose: Pose, body: tuple[CrossSection, CrossSection], rng: np.random.Generator
) -> None:
    """A box or a tarpaulin, a tank, a tipper, or a low platform with or without a load."""
    kind = int(rng.choice(4, p=[0.62, 0.14, 0.12, 0.12]))
    low, high = body
    bgr = body_colour(rng)
    if kind == 1:
        _tank(canvas, pose, body, bgr, rng)
        return
    if kind >= 2:
        top_m = low.up_m + float(rng.uniform(0.3, 1.5)) * (1.0 if kind == 2 else 0.25)
        high = CrossSection(high.rear_m, high.front_m, high.half_width_m, top_m)
    for name, face in visible_faces(canvas, pose, low, high).items():
        paint_body(canvas, face, bgr, rng)
        if name == "rear":
            _doors(canvas, face, bgr, rng)
        if kind == 0 and name in ("rear", "left", "right"):
            if rng.random() < 0.5:
                write_on(canvas, face, rectangle(0.1, 0.1, 0.9, 0.6), rng)
            face.paint(canvas, rectangle(0, 0.95, 1, 1), _DARK)
        elif kind == 2:
            for rib in np.linspace(0.05, 0.93, 6):
                face.paint(canvas, rectangle(rib, 0.0, rib + 0.03, 1.0), toned(bgr, 0.6))
    if kind == 3 and rng.random() < 0.7:  # something on it
        share = float(rng.uniform(0.5, 0.9))
        foot = CrossSection(
            low.rear_m * share, low.front_m * share, share * low.half_width_m, high.up_m
        )
        top_m = high.up_m + float(rng.uniform(0.3, 1.6))
        tip = CrossSection(
            foot.rear_m, foot.front_m, foot.half_width_m * rng.uniform(0.5, 1.0), top_m
        )
        load = body_colour(rng)
        for face in visible_faces(canvas, pose, foot, tip).values():
            paint_body(canvas, face, load, rng)


def _doors(canvas: Canvas, face: Face, bgr: Bgr, rng: np.random.Generator) -> None:
    line = toned(bgr, 0.55) if sum(bgr) > 150 else toned(WHITE, 0.4)
    for at in (0.0, 0.49, 0.97):
        face.paint(canvas, rectangle(at, 0.0, at + 0.025, 1.0), line)
    for at in rng.uniform(0.1, 0.9, 2):
        face.paint(canvas, rectangle(at, 0.02, at + 0.012, 0.98), toned(WHITE, 0.6))
    if rng.random() < 0.3:  # a barred band across
        for number in range(8):
            tone = RED if number % 2 else WHITE
            left = number / 8
            face.paint(canvas, rectangle(left, 0.9, left + 0.125, 0.96), tone)


def _tank(
    canvas: Canvas,
    pose: Pose,
    body: tuple[CrossSection, CrossSection],
    bgr: Bgr,
    rng: np.random.Generator,
) -> None:
    """A lying cylinder: its hull, then the end that is seen."""
    low, high = body
    radius_m = min(low.half_width_m, (high.up_m - low.up_m) / 2)
    turn = np.linspace(0, 2 * np.pi, 20, endpoint=False)
    across, up = radius_m * np.cos(turn), low.up_m + radius_m * (1 + np.sin(turn))
    rings = [
        pose.place(np.column_stack([np.full(20, along_m), across, up]))
        for along_m in (low.rear_m, low.front_m)
    ]
    ahead_m = float(rings[0][:, 0].mean())
    for first in range(20):
        second = (first + 1) % 20
        quad = np.asarray([rings[0][first], rings[0][second], rings[1][second], rings[1][first]])
        tone = toned(bgr, 0.55 + 0.5 * max(0.0, float(np.sin(turn[first]))))
        if np.cos(turn[first]) * pose.right_m < 0.3 or np.sin(turn[first]) > 0.5:
            canvas.fill(quad, canvas.seen(tone, canvas.light.ambient, ahead_m))
    near = rings[0] if rings[0][:, 0].mean() < rings[1][:, 0].mean() else rings[1]
    level = canvas.level((-1.0, 0.0, 0.0), ahead_m)
    canvas.fill(near, canvas.seen(toned(bgr, 0.9), level, ahead_m))
    middle = near.mean(axis=0)
    inner = middle + rng.uniform(0.4, 0.9) * (near - middle)
    canvas.fill(inner, canvas.seen(toned(bgr, 1.05), level, ahead_m))


def _tail(
    canvas: Canvas,
    pose: Pose,
    *,
    rear_m: float,
    half_m: float,
    floor_m: float,
    lamps: Lamps,
    rng: np.random.Generator,
) -> None:
    """Underrun bar with lamps and plate below the floor."""
    low = CrossSection(rear_m, rear_m + 0.1, half_m, float(rng.uniform(0.4, 0.55)))
    high = CrossSection(rear_m, rear_m + 0.1, half_m, floor_m + 0.02)
    face = visible_faces(canvas, pose, low, high).get("rear")
    if face is None:
        return
    bar = PLASTIC if rng.random() < 0.7 else toned(WHITE, 0.7)
    face.paint(canvas, rectangle(0.03, float(rng.uniform(0.3, 0.7)), 0.97, 1.0), bar)
    _rear_lamps(canvas, face, lamps, (0.1, 0.6), rng)
    paint_plate(canvas, face, (float(rng.uniform(0.3, 0.7)), 0.6), rng)


def _rear_lamps(
    canvas: Canvas,
    face: Face,
    lamps: Lamps,
    rows: tuple[float, float],
    rng: np.random.Generator,
) -> None:
    width = float(rng.uniform(0.06, 0.2))
    emission = max(0.7 * lamps.tail, lamps.brake)
    for left, right in ((0.02, width), (1 - width, 0.98)):
        paint_lamp(
            canvas, face, rectangle(left, rows[0], right, rows[1]), RED, emission, radius_m=0.18
        )
        if rng.random() < 0.5:
            outer = rectangle(left, rows[0], left + 0.3 * width, rows[1])
            paint_lamp(canvas, face, outer, AMBER, lamps.turn, radius_m=0.1)
