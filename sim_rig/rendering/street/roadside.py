"""What stands beside and over the road and is no vehicle."""

from collections.abc import Callable

import numpy as np

from sim_rig.rendering.street.canvas import Bgr, Canvas
from sim_rig.rendering.street.ground import RoadLayout, beside
from sim_rig.rendering.street.lettering import write_on
from sim_rig.rendering.street.paint import body_colour, circle, paint_body, paint_glass, toned
from sim_rig.rendering.street.plants import hedge, tree
from sim_rig.rendering.street.solids import CrossSection, Face, Pose, rectangle, visible_faces
from sim_rig.rendering.street.two_wheelers import draw_person

Draw = Callable[[Canvas, float, RoadLayout, np.random.Generator], None]
"""Draws a thing some metres ahead."""

_STEEL: Bgr = (140.0, 142.0, 142.0)
_SIGNS: tuple[Bgr, ...] = (
    (80.0, 110.0, 20.0),
    (150.0, 80.0, 20.0),
    (40.0, 180.0, 235.0),
    (235.0, 235.0, 235.0),
    (40.0, 35.0, 190.0),
    (30.0, 30.0, 30.0),
)


def _panel(
    canvas: Canvas, ahead_m: float, left_m: float, low_m: float, size_m: tuple[float, float]
) -> Face:
    """An upright face across the road."""
    width_m, height_m = size_m
    corners = [
        (ahead_m, left_m, low_m + height_m),
        (ahead_m, left_m + width_m, low_m + height_m),
        (ahead_m, left_m + width_m, low_m),
        (ahead_m, left_m, low_m),
    ]
    normal = (-1.0, 0.0, 0.0)
    return Face(np.asarray(corners), normal, canvas.level(normal, ahead_m), ahead_m)


def lamp_post(canvas: Canvas, ahead_m: float, layout: RoadLayout, rng: np.random.Generator) -> None:
    """A lamp post, a pole with wires, or a delineator."""
    right_m, height_m = beside(layout, rng, 3.0), float(rng.uniform(0.8, 12.0))
    colour = canvas.seen(
        toned(_STEEL, float(rng.uniform(0.3, 1.2))), canvas.level((-1, 0, 0), ahead_m), ahead_m
    )
    arm_m = float(rng.uniform(0, 3)) * (-1 if right_m > 0 else 1) if height_m > 4 else 0.0
    path = [
        (ahead_m, right_m, 0.0),
        (ahead_m, right_m, 0.9 * height_m),
        (ahead_m, right_m + arm_m, height_m),
    ]
    canvas.line(path, float(rng.uniform(0.08, 0.25)), colour)
    if canvas.light.is_dark and height_m > 4:
        canvas.shine((ahead_m, right_m + arm_m, height_m), 0.3, (150.0, 210.0, 255.0))


def sign(canvas: Canvas, ahead_m: float, layout: RoadLayout, rng: np.random.Generator) -> None:
    """A sign on a pole: a board with lettering, a disc, a triangle or a diamond."""
    right_m, low_m = beside(layout, rng, 6.0), float(rng.uniform(0.5, 3.5))
    is_board = rng.random() < 0.6
    size_m = float(rng.uniform(0.6, 5.0)), float(rng.uniform(0.4, 3.0))
    if not is_board:
        size_m = (size_m[1] * 0.6, size_m[1] * 0.6)
    steel = canvas.seen(_STEEL, canvas.level((-1, 0, 0), ahead_m), ahead_m)
    for side in (0.2, 0.8) if size_m[0] > 2 else (0.5,):
        x_m = right_m + side * size_m[0]
        canvas.line([(ahead_m, x_m, 0.0), (ahead_m, x_m, low_m + size_m[1])], 0.1, steel)
    face = _panel(canvas, ahead_m, right_m, low_m, size_m)
    ground = _SIGNS[int(rng.integers(len(_SIGNS)))]
    rim = toned(ground, 0.4) if sum(ground) > 350 else (235.0, 235.0, 235.0)
    lit = 0.3 * canvas.light.headlamps
    if is_board:
        face.paint(canvas, rectangle(0, 0, 1, 1), rim, emission=lit)
        face.paint(canvas, rectangle(0.03, 0.05, 0.97, 0.95), ground, emission=lit)
        write_on(canvas, face, rectangle(0.1, 0.1, 0.9, 0.9), rng)
        return
    shapes = (
        circle(0.5, 0.5, 0.5, 0.5),
        np.asarray([(0.5, 0.0), (1.0, 1.0), (0.0, 1.0)]),
        np.asarray([(0.5, 0.0), (1.0, 0.5), (0.5, 1.0), (0.0, 0.5)]),
    )
    shape = shapes[int(rng.integers(3))]
    face.paint(canvas, shape, _SIGNS[int(rng.integers(len(_SIGNS)))], emission=lit)
    inner = shape.mean(axis=0) + 0.7 * (shape - shape.mean(axis=0))
    face.paint(canvas, inner, ground, emission=lit)


def gantry(canvas: Canvas, ahead_m: float, layout: RoadLayout, rng: np.random.Generator) -> None:
    """A truss over the road with signs on it, or a bare one, or a beam."""
    left_m, right_m = layout.left_m - layout.shoulder_m - 1, layout.right_m + layout.shoulder_m + 1
    low_m, depth_m = float(rng.uniform(4.5, 7.0)), float(rng.uniform(0.4, 2.2))
    level = canvas.level((-1, 0, 0), ahead_m) * float(rng.uniform(0.3, 1.1))
    steel = canvas.seen(_STEEL, level, ahead_m)
    for x_m in (left_m, right_m)[int(rng.random() < 0.3) :]:
        canvas.line([(ahead_m, x_m, 0), (ahead_m, x_m, low_m + depth_m)], 0.4, steel)
    for up_m in (low_m, low_m + depth_m):
        canvas.line([(ahead_m, left_m, up_m), (ahead_m, right_m, up_m)], 0.18, steel)
    step_m = depth_m * float(rng.uniform(0.6, 1.6))
    at_m = left_m
    while at_m < right_m:
        ends = [(ahead_m, at_m, low_m), (ahead_m, at_m + step_m, low_m + depth_m)]
        canvas.line(ends, 0.1, steel)
        if rng.random() < 0.9:
            ends = [(ahead_m, at_m, low_m + depth_m), (ahead_m, at_m + step_m, low_m)]
            canvas.line(ends, 0.1, steel)
        canvas.line([(ahead_m, at_m, low_m), (ahead_m, at_m, low_m + depth_m)], 0.1, steel)
        at_m += step_m
    for _ in range(int(rng.integers(0, 4))):
        size_m = float(rng.uniform(1.0, 7.0)), float(rng.uniform(1.0, 3.5))
        x_m = float(rng.uniform(left_m, right_m - 1))
        face = _panel(canvas, ahead_m - 0.3, x_m, low_m - float(rng.uniform(0, 0.8)), size_m)
        ground = _SIGNS[int(rng.integers(len(_SIGNS)))]
        lit = 0.3 * canvas.light.headlamps
        face.paint(canvas, rectangle(0, 0, 1, 1), (230.0, 230.0, 230.0), emission=lit)
        face.paint(canvas, rectangle(0.02, 0.03, 0.98, 0.97), ground, emission=lit)
        write_on(canvas, face, rectangle(0.1, 0.1, 0.9, 0.9), rng)


def bridge(canvas: Canvas, ahead_m: float, layout: RoadLayout, rng: np.random.Generator) -> None:
    """A bridge over the road with its piers, rail and the dark below."""
    low_m, depth_m = float(rng.uniform(4.2, 7.5)), float(rng.uniform(0.8, 2.5))
    tone = toned((165.0, 168.0, 170.0), float(rng.uniform(0.3, 1.1)))
    lean = float(rng.normal(0, 0.12))
    far_m = ahead_m + float(rng.uniform(6, 25))
    level = canvas.level((-1, 0, 0), ahead_m)
    reach_m = 60.0

    def slab(at_m: float, low: float, high: float, factor: float) -> None:
        quad = [
            (at_m, -reach_m, high - lean * reach_m),
            (at_m, reach_m, high + lean * reach_m),
            (at_m, reach_m, low + lean * reach_m),
            (at_m, -reach_m, low - lean * reach_m),
        ]
        canvas.fill(quad, canvas.seen(toned(tone, factor), level, at_m))

    for x_m in (layout.left_m - layout.shoulder_m - 1, layout.right_m + layout.shoulder_m + 1):
        half_m = float(rng.uniform(0.4, 2.0))
        pier = visible_faces(
            canvas,
            Pose((ahead_m + far_m) / 2, x_m),
            CrossSection(-(far_m - ahead_m) / 2, (far_m - ahead_m) / 2, half_m, 0.0),
            CrossSection(-(far_m - ahead_m) / 2, (far_m - ahead_m) / 2, half_m, low_m + 1),
        )
        for face in pier.values():
            face.paint(canvas, rectangle(0, 0, 1, 1), toned(tone, 0.8))
    under = [
        (far_m, -reach_m, low_m),
        (far_m, reach_m, low_m),
        (ahead_m, reach_m, low_m),
        (ahead_m, -reach_m, low_m),
    ]
    canvas.fill(under, canvas.seen(toned(tone, 0.3), level, ahead_m))
    slab(ahead_m, low_m, low_m + depth_m, 1.0)
    slab(ahead_m, low_m + depth_m, low_m + depth_m + 0.15, 1.2)
    if rng.random() < 0.6:
        for x_m in np.arange(-30.0, 30.0, 1.5):
            foot = low_m + depth_m + lean * x_m
            steel = canvas.seen(_STEEL, level, ahead_m)
            canvas.line([(ahead_m, x_m, foot), (ahead_m, x_m, foot + 1.1)], 0.06, steel)


def building(canvas: Canvas, ahead_m: float, layout: RoadLayout, rng: np.random.Generator) -> None:
    """A house, a hall or a shed with windows, doors and at times a shop's sign."""
    depth_m, half_m = float(rng.uniform(2, 25)), float(rng.uniform(1.2, 14))
    side_m = beside(layout, rng, 12.0)
    right_m = side_m + half_m if side_m > 0 else side_m - half_m
    height_m = float(np.exp(rng.uniform(np.log(2.0), np.log(40.0))))
    pose = Pose(ahead_m + depth_m / 2, right_m, float(rng.normal(0, 0.1)))
    level = CrossSection(-depth_m / 2, depth_m / 2, half_m, 0.0)
    bgr = body_colour(rng)
    faces = visible_faces(
        canvas, pose, level, CrossSection(-depth_m / 2, depth_m / 2, half_m, height_m)
    )
    floors, columns = max(1, round(height_m / 3.2)), int(rng.integers(2, 9))
    for face in faces.values():
        face.paint(canvas, rectangle(0, 0, 1, 1), bgr)
        if rng.random() < 0.2:
            continue
        for floor in range(min(floors, 9)):
            top = (floor + 0.25) / min(floors, 9)
            bottom = (floor + float(rng.uniform(0.6, 0.9))) / min(floors, 9)
            for column in range(columns):
                left = (column + 0.2) / columns
                window = rectangle(left, top, left + 0.6 / columns, bottom)
                face.paint(canvas, window, toned((60.0, 55.0, 50.0), float(rng.uniform(0.5, 2))))
    if "rear" in faces and rng.random() < 0.4:
        write_on(canvas, faces["rear"], rectangle(0.1, 0.7, 0.9, 0.85), rng)


def rail(canvas: Canvas, ahead_m: float, layout: RoadLayout, rng: np.random.Generator) -> None:
    """A guard rail, a concrete barrier, a fence, a hedge or a noise barrier along the road."""
    kind = int(rng.integers(5))
    height_m = (0.75, float(rng.uniform(0.6, 1.2)), 1.8, float(rng.uniform(0.5, 2.0)), 4.0)[kind]
    is_right = rng.random() < 0.5
    x_m = layout.right_m + layout.shoulder_m + 0.2 if is_right else layout.left_m - 0.8
    end_m = ahead_m + float(rng.uniform(8, 60))
    steps = np.linspace(ahead_m, end_m, 6)
    level = canvas.level((0.0, -1.0 if is_right else 1.0, 0.0), ahead_m)
    tones: tuple[Bgr, ...] = (
        (165.0, 166.0, 166.0),
        (170.0, 176.0, 180.0),
        (110.0, 115.0, 120.0),
        (45.0, 85.0, 60.0),
        (120.0, 125.0, 130.0),
    )
    tone = toned(tones[kind], float(rng.uniform(0.5, 1.2)))
    if kind in (0, 2):
        posts = np.arange(ahead_m, min(end_m, ahead_m + 50), 2.5)
        steel = canvas.seen(toned(tone, 0.6), level, ahead_m)
        for at_m in posts[::-1]:
            canvas.line([(at_m, x_m, 0), (at_m, x_m, height_m)], 0.1, steel)
    low_m = 0.4 if kind == 0 else 0.0
    if kind == 2:
        for up_m in (0.3, 0.9, height_m):
            steel = canvas.seen(tone, level, ahead_m)
            canvas.line([(at_m, x_m, up_m) for at_m in steps], 0.05, steel)
        return
    for near_m, far_m in zip(steps[-2::-1], steps[:0:-1], strict=True):
        quad = [
            (near_m, x_m, low_m),
            (near_m, x_m, height_m),
            (far_m, x_m, height_m),
            (far_m, x_m, low_m),
        ]
        factor = float(rng.uniform(0.9, 1.1))
        canvas.fill(quad, canvas.seen(toned(tone, factor), level, float(near_m)))
        if kind == 0:
            quad = [(at, x, 0.57 + 0.1 * (up > 0.5)) for at, x, up in quad]
            canvas.fill(quad, canvas.seen(toned(tone, 0.6), level, float(near_m)))


def furniture(canvas: Canvas, ahead_m: float, layout: RoadLayout, rng: np.random.Generator) -> None:
    """A box without lamps or wheels: bin, container, hut, bale, crash cushion, toll booth."""
    half_m, height_m = float(rng.uniform(0.2, 1.3)), float(rng.uniform(0.4, 3.0))
    depth_m = float(rng.uniform(0.3, 4.0))
    pose = Pose(ahead_m, beside(layout, rng, 5.0), float(rng.uniform(-0.6, 0.6)))
    low = CrossSection(-depth_m / 2, depth_m / 2, half_m, 0.0)
    high = CrossSection(-depth_m / 2, depth_m / 2, half_m * float(rng.uniform(0.7, 1.0)), height_m)
    bgr = body_colour(rng)
    for face in visible_faces(canvas, pose, low, high).values():
        paint_body(canvas, face, bgr, rng)
        if rng.random() < 0.3:
            paint_glass(canvas, face, rectangle(0.1, 0.1, 0.9, 0.5), rng)
        elif rng.random() < 0.4:
            write_on(canvas, face, rectangle(0.1, 0.2, 0.9, 0.8), rng)
        elif rng.random() < 0.3:
            for number in range(0, 8, 2):
                stripe = rectangle(0, number / 8, 1, (number + 1) / 8)
                face.paint(canvas, stripe, _SIGNS[2 + number // 4])


def cones(canvas: Canvas, ahead_m: float, layout: RoadLayout, rng: np.random.Generator) -> None:
    """Cones or bollards in a row."""
    x_m = beside(layout, rng, 1.0)
    level = canvas.level((-1, 0, 0), ahead_m)
    for at_m in np.arange(ahead_m + 30, ahead_m, -float(rng.uniform(3, 8))):
        shape = [(at_m, x_m - 0.2, 0), (at_m, x_m + 0.2, 0), (at_m, x_m, 0.75)]
        canvas.fill(shape, canvas.seen((40.0, 90.0, 240.0), level, float(at_m)))
        band = [(at_m, x_m - 0.1, 0.35), (at_m, x_m + 0.1, 0.35), (at_m, x_m, 0.55)]
        canvas.fill(band, canvas.seen((235.0, 235.0, 235.0), level, float(at_m)))


def person(canvas: Canvas, ahead_m: float, layout: RoadLayout, rng: np.random.Generator) -> None:
    """Somebody on foot beside the road."""
    draw_person(canvas, Pose(ahead_m, beside(layout, rng, 4.0)), rng)


def traffic_light(
    canvas: Canvas, ahead_m: float, layout: RoadLayout, rng: np.random.Generator
) -> None:
    """Signal heads on a pole or an arm, one lamp lit."""
    x_m = beside(layout, rng, 2.0)
    low_m = float(rng.uniform(2.0, 5.5))
    steel = canvas.seen(toned(_STEEL, 0.5), canvas.level((-1, 0, 0), ahead_m), ahead_m)
    over_m = float(rng.uniform(0, 6)) * (-1 if x_m > 0 else 1)
    path = [(ahead_m, x_m, 0), (ahead_m, x_m, low_m + 1), (ahead_m, x_m + over_m, low_m + 1)]
    canvas.line(path, 0.15, steel)
    face = _panel(canvas, ahead_m - 0.2, x_m + over_m - 0.18, low_m, (0.36, 1.0))
    face.paint(canvas, rectangle(0, 0, 1, 1), (20.0, 20.0, 20.0))
    lamps: tuple[Bgr, ...] = ((40.0, 40.0, 240.0), (30.0, 190.0, 250.0), (120.0, 240.0, 60.0))
    lit = int(rng.integers(3))
    for number, tone in enumerate(lamps):
        shape = circle(0.5, (number + 0.5) / 3, 0.35, 0.13)
        face.paint(
            canvas,
            shape,
            toned(tone, 0.2 if number != lit else 1.0),
            emission=1.2 * (number == lit),
        )
        if number == lit:
            canvas.shine(face.points([(0.5, (number + 0.5) / 3)])[0], 0.12, toned(tone, 0.6))


THINGS: tuple[tuple[Draw, float], ...] = (
    (tree, 0.27),
    (hedge, 0.05),
    (lamp_post, 0.12),
    (sign, 0.13),
    (gantry, 0.06),
    (bridge, 0.03),
    (building, 0.09),
    (rail, 0.12),
    (furniture, 0.06),
    (cones, 0.02),
    (person, 0.02),
    (traffic_light, 0.03),
)
"""Each thing, and its share of what stands beside roads."""
