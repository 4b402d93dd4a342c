"""Cars, estates, off-roaders, pick-ups and vans: a lower body, a cabin on it, four wheels."""

from dataclasses import dataclass

import cv2
import numpy as np

from sim_rig.rendering.car_art import rear_of_car
from sim_rig.rendering.scene import warp_onto
from sim_rig.rendering.street.canvas import Bgr, Canvas
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

RED: Bgr = (45.0, 35.0, 215.0)
AMBER: Bgr = (30.0, 140.0, 240.0)
WHITE: Bgr = (235.0, 240.0, 245.0)


@dataclass(frozen=True, slots=True)
class CarShape:
    """Proportions of a car; positions along it are shares of its length from the rear."""

    length_m: float
    width_m: float
    height_m: float
    waist: float
    """Height of the lower body, as a share of the height."""
    cabin: tuple[float, float]
    """Rear and front end of the cabin at the waist."""
    roof: tuple[float, float]
    """Rear and front end of the roof."""
    tumblehome: float
    """Width of the roof over the width at the waist."""
    clearance_m: float
    is_closed: bool = False
    """Whether it has no windows behind the driver's, as many vans."""


_RANGES = {
    "sedan": ((4.2, 5.1), (1.70, 1.92), (1.38, 1.52), (0.62, 0.70), (0.10, 0.24), (0.22, 0.34)),
    "hatchback": ((3.5, 4.4), (1.6, 1.82), (1.42, 1.62), (0.58, 0.66), (0.0, 0.03), (0.07, 0.16)),
    "estate": ((4.4, 5.0), (1.7, 1.9), (1.42, 1.58), (0.6, 0.68), (0.0, 0.03), (0.05, 0.1)),
    "off-roader": ((4.2, 5.1), (1.78, 2.02), (1.6, 1.92), (0.56, 0.66), (0.0, 0.02), (0.03, 0.1)),
    "pick-up": ((5.0, 5.9), (1.8, 2.05), (1.72, 1.98), (0.56, 0.62), (0.36, 0.44), (0.38, 0.47)),
    "van": ((4.4, 6.6), (1.8, 2.1), (1.85, 2.8), (0.42, 0.6), (0.0, 0.01), (0.0, 0.03)),
}
"""Length, width, height in m; waist; rear end of the cabin and of the roof."""
_STYLES = ("sedan", "hatchback", "estate", "off-roader", "pick-up")


def random_car(rng: np.random.Generator) -> CarShape:
    """Draw the proportions of a car."""
    return _shape(_STYLES[int(rng.choice(5, p=[0.34, 0.22, 0.1, 0.26, 0.08]))], rng)


def random_van(rng: np.random.Generator) -> CarShape:
    """Draw the proportions of a van."""
    return _shape("van", rng)


def _shape(style: str, rng: np.random.Generator) -> CarShape:
    length, width, height, waist, cabin, roof = (
        float(rng.uniform(*bounds)) for bounds in _RANGES[style]
    )
    is_van = style == "van"
    front = float(rng.uniform(0.78, 0.9) if is_van else rng.uniform(0.68, 0.78))
    return CarShape(
        length_m=length,
        width_m=width,
        height_m=height,
        waist=waist,
        cabin=(cabin, front),
        roof=(max(roof, cabin), front - float(rng.uniform(0.06, 0.2))),
        tumblehome=float(rng.uniform(0.84, 0.96) if is_van else rng.uniform(0.7, 0.86)),
        clearance_m=float(rng.uniform(0.16, 0.32)),
        is_closed=is_van and rng.random() < 0.5,
    )


def draw_car(canvas: Canvas, pose: Pose, shape: CarShape, rng: np.random.Generator) -> None:
    """Draw a car; `pose` is that of its middle on the road."""
    bgr, lamps = body_colour(rng), random_lamps(canvas, rng)
    half_m, waist_m = shape.width_m / 2, shape.waist * shape.height_m
    radius_m = float(rng.uniform(0.29, 0.38))

    def along(share: float) -> float:
        return (share - 0.5) * shape.length_m

    wheels = (along(rng.uniform(0.16, 0.22)), along(rng.uniform(0.78, 0.84)))
    _tyres(canvas, pose, wheels, half_m, radius_m)
    bulge = float(rng.uniform(0.94, 0.99))
    belt_m = float(rng.uniform(0.5, 0.75)) * waist_m
    sills = CrossSection(along(0.015), along(0.985), bulge * half_m, shape.clearance_m)
    belt = CrossSection(along(0.0), along(1.0), half_m, belt_m)
    waist = CrossSection(along(0.015), along(rng.uniform(0.95, 0.98)), bulge * half_m, waist_m)
    upper = visible_faces(canvas, pose, belt, waist)
    lower = visible_faces(canvas, pose, sills, belt)
    accent = PLASTIC if rng.random() < 0.35 else toned(bgr, float(rng.uniform(0.75, 1.0)))
    for name, face in (*lower.items(), *upper.items()):
        is_lower = face is lower.get(name)
        tone = toned(accent, 0.9) if is_lower and name in ("rear", "front") else bgr
        paint_body(canvas, face, tone, rng)
    for side in ("left", "right"):
        if side in lower:
            _side_of_body(
                canvas,
                *(lower[side], upper.get(side), shape, rng),
                wheels=wheels,
                radius_m=radius_m,
                rear_is_left=side == "right",
            )
    cabin = visible_faces(
        canvas,
        pose,
        CrossSection(along(shape.cabin[0]), along(shape.cabin[1]), 0.97 * bulge * half_m, waist_m),
        CrossSection(
            along(shape.roof[0]), along(shape.roof[1]), shape.tumblehome * half_m, shape.height_m
        ),
    )
    for name, face in cabin.items():
        paint_body(canvas, face, bgr if rng.random() < 0.9 else (20.0, 20.0, 20.0), rng)
        if name == "front" or (name == "rear" and not shape.is_closed):
            inset = float(rng.uniform(0.05, 0.13))
            bottom = float(rng.uniform(0.62, 0.97))
            window = rectangle(inset, float(rng.uniform(0.06, 0.2)), 1 - inset, bottom)
            paint_glass(canvas, face, window, rng)
            if name == "rear" and rng.random() < 0.3:
                _third_brake_lamp(canvas, face, lamps)
        elif name in ("left", "right"):
            _side_windows(canvas, face, name, shape, rng)
    if "rear" in upper and "rear" in lower:
        faces = upper["rear"], lower["rear"], cabin.get("rear")
        _rear(canvas, faces, shape, lamps, rng)
    if "front" in upper and "front" in lower:
        _front(canvas, upper["front"], lower["front"], lamps, rng)


def draw_flat_rear(canvas: Canvas, pose: Pose, rng: np.random.Generator) -> None:
    """Draw the rear of a car as the rig's camera shows it: a flat picture."""
    lamps, bgr = random_lamps(canvas, rng), body_colour(rng)
    few = [int(value) // 32 * 32 + 16 for value in bgr]
    rear = rear_of_car(1.8, 1.5, (few[0], few[1], few[2]), lamps.brake > 0)
    corners = [(side * 0.9, up) for side, up in ((-1, 1.5), (1, 1.5), (1, 0.0), (-1, 0.0))]
    quad = canvas.camera.project([(pose.ahead_m, pose.right_m + x, up) for x, up in corners])
    canvas.claim(quad)
    level = min(1.0, canvas.level((-1.0, 0.0, 0.0), pose.ahead_m))
    lit = np.asarray(rear * np.asarray([level, level, level, 1.0]), np.uint8)
    size = max(2, round(float(np.ptp(quad[:, 0])))), max(2, round(float(np.ptp(quad[:, 1]))))
    if size[0] < lit.shape[1]:
        lit = np.asarray(cv2.resize(lit, size, interpolation=cv2.INTER_AREA), np.uint8)
    warp_onto(canvas.image, lit, quad.astype(np.float32))


def _tyres(
    canvas: Canvas, pose: Pose, wheels: tuple[float, float], half_m: float, radius_m: float
) -> None:
    """Tyres as seen from behind and from the front, and the dark below the floor."""
    for along_m in sorted(wheels, reverse=True):
        for side in (-1, 1):
            inner, outer = side * (half_m - 0.23), side * (half_m - 0.02)
            quad = [
                (along_m, inner, radius_m),
                (along_m, outer, radius_m),
                (along_m, outer, 0.0),
                (along_m, inner, 0.0),
            ]
            points = pose.place(quad)
            canvas.fill(points, canvas.seen(RUBBER, 0.7, float(points[0, 0])))
    floor = [
        (along_m, side * 0.8 * half_m, up_m)
        for along_m in wheels
        for side, up_m in ((-1, 0.45), (1, 0.45), (1, 0.12), (-1, 0.12))
    ]
    floors = pose.place(floor)
    for part in (floors[:4], floors[4:]):
        canvas.fill(part, canvas.seen((14.0, 14.0, 14.0), 0.7, float(part[0, 0])))


def _wheel(
    canvas: Canvas, face: Face, centre: tuple[float, float], size: tuple[float, float], rim: Bgr
) -> None:
    u, v = centre
    face.paint(canvas, circle(u, v, 1.18 * size[0], 1.18 * size[1]), (14.0, 14.0, 14.0))
    face.paint(canvas, circle(u, v, *size), RUBBER)
    face.paint(canvas, circle(u, v, 0.62 * size[0], 0.62 * size[1]), rim)
    face.paint(canvas, circle(u, v, 0.2 * size[0], 0.2 * size[1]), toned(rim, 0.5))


def _side_of_body(
    canvas: Canvas,
    lower: Face,
    upper: Face | None,
    shape: CarShape,
    rng: np.random.Generator,
    *,
    wheels: tuple[float, float],
    radius_m: float,
    rear_is_left: bool,
) -> None:
    """Seams, handles and wheels of the side."""
    rim: Bgr = (150.0, 150.0, 150.0) if rng.random() < 0.7 else (40.0, 40.0, 40.0)
    down_m = float(np.linalg.norm(lower.corners_m[3] - lower.corners_m[0]))
    up_m = down_m + shape.clearance_m
    for along_m in wheels:
        share = along_m / shape.length_m + 0.5
        u = share if rear_is_left else 1 - share
        size = (radius_m / shape.length_m, radius_m / down_m)
        _wheel(canvas, lower, (u, (up_m - radius_m) / down_m), size, rim)
    if upper is None:
        return
    for seam in rng.uniform(0.3, 0.72, 3):
        upper.paint(canvas, rectangle(seam, 0.0, seam + 0.004, 1.0), PLASTIC)
    for handle in (0.45, 0.65):
        upper.paint(canvas, rectangle(handle, 0.2, handle + 0.03, 0.3), PLASTIC)


def _side_windows(
    canvas: Canvas, face: Face, name: str, shape: CarShape, rng: np.random.Generator
) -> None:
    first, last = 0.05, 0.95
    if shape.is_closed:  # the driver's window only
        first, last = (0.72, 0.95) if name == "right" else (0.05, 0.28)
    ends = np.linspace(first, last, 2 if shape.is_closed else int(rng.integers(3, 5)))
    top, bottom = float(rng.uniform(0.1, 0.2)), float(rng.uniform(0.85, 0.97))
    for left, right in zip(ends[:-1] + 0.008, ends[1:] - 0.008, strict=True):
        paint_glass(canvas, face, rectangle(left, top, right, bottom), rng, 0.15)


def _third_brake_lamp(canvas: Canvas, face: Face, lamps: Lamps) -> None:
    shape = rectangle(0.42, 0.02, 0.58, 0.07)
    paint_lamp(canvas, face, shape, RED, lamps.brake, radius_m=0.05)


def _rear(
    canvas: Canvas,
    faces: tuple[Face, Face, Face | None],
    shape: CarShape,
    lamps: Lamps,
    rng: np.random.Generator,
) -> None:
    """Rear lamps, plate, bumper, badge on the upper and lower body and the cabin."""
    upper, lower, cabin = faces
    emission = max(lamps.tail * 0.7, lamps.brake)
    width, top = float(rng.uniform(0.1, 0.32)), float(rng.uniform(0.0, 0.25))
    bottom = float(rng.uniform(top + 0.25, 1.0))
    is_high = shape.cabin[0] < 0.04 and rng.random() < 0.4
    if not is_high and rng.random() < 0.12:  # a band of light across
        paint_lamp(
            canvas, upper, rectangle(0.05, top, 0.95, top + 0.15), RED, lamps.tail, radius_m=0.05
        )
    for left, right in ((0.01, width), (1 - width, 0.99)):
        at = rectangle(left, top, right, bottom)
        if rng.random() < 0.5:  # tapering towards the middle
            inner = 1 if left < 0.5 else 0
            at[inner, 1] += 0.4 * (bottom - top)
        paint_lamp(canvas, upper, at, RED, emission, radius_m=0.16)
        part = rectangle(left, top + 0.6 * (bottom - top), right, bottom)
        if rng.random() < 0.4:
            tone = AMBER if rng.random() < 0.5 else WHITE
            paint_lamp(canvas, upper, part, tone, lamps.turn if left < 0.5 else 0.0, radius_m=0.1)
        if is_high and cabin is not None:
            near = (0.0, 0.09) if left < 0.5 else (0.91, 1.0)
            pillar = rectangle(near[0], float(rng.uniform(0.1, 0.5)), near[1], 1.0)
            paint_lamp(canvas, cabin, pillar, RED, emission, radius_m=0.14)
    if rng.random() < 0.6:
        chrome = toned(WHITE, float(rng.uniform(0.3, 0.9)))
        upper.paint(canvas, rectangle(0.35, 0.5, 0.65, 0.56), chrome)
    upper.paint(canvas, circle(0.5, 0.25, 0.035, 0.12), (150.0, 150.0, 150.0))
    dark = rectangle(0.1, float(rng.uniform(0.6, 0.85)), 0.9, 1.0)
    lower.paint(canvas, dark, PLASTIC)
    for left in (0.06, 0.86):  # reflectors
        if rng.random() < 0.5:
            lower.paint(canvas, rectangle(left, 0.45, left + 0.08, 0.55), RED)
    if rng.random() < 0.92:
        if rng.random() < 0.6:
            paint_plate(canvas, upper, (0.5, float(rng.uniform(0.55, 0.85))), rng)
        else:
            paint_plate(canvas, lower, (0.5, float(rng.uniform(0.2, 0.5))), rng)


def _front(
    canvas: Canvas, upper: Face, lower: Face, lamps: Lamps, rng: np.random.Generator
) -> None:
    """Headlamps, grille, intake, plate."""
    width, top = float(rng.uniform(0.14, 0.28)), float(rng.uniform(0.05, 0.35))
    bottom = float(rng.uniform(top + 0.25, 0.9))
    grille = rectangle(0.3, top, 0.7, float(rng.uniform(0.6, 1.0)))
    upper.paint(canvas, grille, PLASTIC)
    for bar in np.linspace(grille[0, 1], grille[2, 1], int(rng.integers(3, 6)))[1:-1]:
        upper.paint(canvas, rectangle(0.31, bar, 0.69, bar + 0.04), (130.0, 130.0, 130.0))
    glass = toned(WHITE, float(rng.uniform(0.5, 1.0)))
    for left, right in ((0.02, width), (1 - width, 0.98)):
        at = rectangle(left, top, right, bottom)
        inner = 1 if left < 0.5 else 0
        at[inner, 1] += float(rng.uniform(0, 0.5)) * (bottom - top)
        paint_lamp(canvas, upper, at, glass, lamps.head, radius_m=0.3)
    lower.paint(canvas, rectangle(0.15, 0.45, 0.85, float(rng.uniform(0.7, 1.0))), PLASTIC)
    for left in (0.04, 0.86):
        lower.paint(canvas, rectangle(left, 0.4, left + 0.1, 0.7), PLASTIC)
    if rng.random() < 0.75:
        paint_plate(canvas, lower, (0.5, float(rng.uniform(0.1, 0.4))), rng)
