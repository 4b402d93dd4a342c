"""Sky, hills, verges, and the road with its markings, patches and shadows."""

from dataclasses import dataclass
from itertools import pairwise

import cv2
import numpy as np
import numpy.typing as npt

from sim_rig.rendering.street.canvas import Bgr, Canvas, Points
from sim_rig.rendering.street.paint import toned
from sim_rig.rendering.street.textures import roughen, tile

_AHEAD_M = np.geomspace(1.0, 500.0, 26)
_VERGES: tuple[Bgr, ...] = (
    (60.0, 120.0, 90.0),
    (50.0, 85.0, 60.0),
    (110.0, 160.0, 185.0),
    (90.0, 120.0, 140.0),
    (130.0, 135.0, 140.0),
    (150.0, 190.0, 205.0),
    (235.0, 232.0, 228.0),
)
_PAINTS: tuple[Bgr, ...] = ((235.0, 238.0, 240.0), (210.0, 215.0, 218.0), (60.0, 190.0, 235.0))


@dataclass(frozen=True, slots=True)
class RoadLayout:
    """Lanes beside the host's, and what separates the oncoming ones."""

    lane_width_m: float
    lanes_left: int
    lanes_right: int
    lanes_oncoming: int
    median_m: float
    """Between the oncoming lanes and the own ones."""
    shoulder_m: float
    offset_m: float
    """Of the camera from the middle of its lane, positive to the right."""

    def middle_of(self, lane: int) -> float:
        """Middle of a lane to the right of the camera; lane 0 is the host's, -1 left of it."""
        return lane * self.lane_width_m - self.offset_m

    @property
    def left_m(self) -> float:
        """Left edge of the own lanes, to the right of the camera."""
        return self.middle_of(-self.lanes_left) - self.lane_width_m / 2

    @property
    def right_m(self) -> float:
        """Right edge of the own lanes."""
        return self.middle_of(self.lanes_right) + self.lane_width_m / 2

    def oncoming_middle(self, lane: int) -> float:
        """Middle of an oncoming lane, counted from the own ones."""
        return self.left_m - self.median_m - (lane + 0.5) * self.lane_width_m

    @property
    def oncoming_left_m(self) -> float:
        """Left edge of the oncoming lanes."""
        return self.left_m - self.median_m - self.lanes_oncoming * self.lane_width_m


def random_layout(rng: np.random.Generator) -> RoadLayout:
    """Draw a road."""
    is_wide = rng.random() < 0.5
    return RoadLayout(
        lane_width_m=float(rng.uniform(2.8, 3.8)),
        lanes_left=int(rng.integers(0, 4 if is_wide else 2)),
        lanes_right=int(rng.integers(0, 4 if is_wide else 2)),
        lanes_oncoming=int(rng.integers(0, 4 if is_wide else 3)),
        median_m=float(rng.uniform(1.5, 9.0) if is_wide else rng.uniform(0.0, 0.3)),
        shoulder_m=float(rng.uniform(0.2, 3.5)),
        offset_m=float(rng.normal(0, 0.4)),
    )


def beside(layout: RoadLayout, rng: np.random.Generator, reach_m: float = 14.0) -> float:
    """Draw a place beside the road, metres to the right of the camera."""
    away_m = layout.shoulder_m + float(rng.uniform(0.4, reach_m))
    if rng.random() < 0.5:
        return layout.right_m + away_m
    if layout.lanes_oncoming and layout.median_m > 2.0 and rng.random() < 0.3:
        return layout.left_m - layout.median_m / 2
    left_m = layout.oncoming_left_m if layout.lanes_oncoming else layout.left_m
    return left_m - away_m


def draw_ground(canvas: Canvas, layout: RoadLayout, rng: np.random.Generator) -> None:
    """Draw everything without height, and the sky."""
    _sky(canvas, rng)
    _hills(canvas, rng)
    light = canvas.light
    level = light.ambient + light.sun * max(0.0, light.towards_sun[2])
    verge = _varied(_VERGES[int(rng.integers(len(_VERGES)))], rng)
    far = canvas.camera.project([(400.0, -3000.0, 0.0), (400.0, 3000.0, 0.0)])
    width, height = canvas.camera.size_px
    below = np.asarray([(4.0 * width, 4.0 * height), (-4.0 * width, 4.0 * height)])
    canvas.fill_px(np.vstack([far, below]), canvas.seen(verge, level, 60.0))
    road: Bgr = _varied(toned((110.0, 108.0, 106.0), float(rng.uniform(0.35, 1.5))), rng, 6)
    edges = [(layout.left_m - layout.shoulder_m, layout.right_m + layout.shoulder_m)]
    if layout.lanes_oncoming:
        inner = layout.left_m - layout.median_m
        edges.append((layout.oncoming_left_m - layout.shoulder_m, inner + 0.3))
    for left_m, right_m in edges:
        _strip(canvas, left_m, right_m, road, level)
    for _ in range(int(rng.integers(0, 5))):
        _patch(canvas, layout, road, level, rng)
    _markings(canvas, layout, level, rng)
    for _ in range(int(rng.integers(0, 4)) if rng.random() < 0.5 else 0):
        _shadow(canvas, layout, rng)
    _roughen_ground(canvas, rng)


def _varied(bgr: Bgr, rng: np.random.Generator, sigma: float = 18.0) -> Bgr:
    blue, green, red = np.clip(np.asarray(bgr) + rng.normal(0, sigma, 3), 3, 250).tolist()
    return blue, green, red


def _sky(canvas: Canvas, rng: np.random.Generator) -> None:
    height, width = canvas.image.shape[:2]
    low = np.asarray(canvas.light.haze_bgr, np.float32)
    high = np.asarray(canvas.light.sky_bgr, np.float32)
    horizon = max(2.0, canvas.camera.centre_px[1])
    share = np.clip(np.arange(height, dtype=np.float32) / horizon, 0, 1)[:, None]
    rows = high * (1 - share) + low * share
    canvas.image[:] = rows[:, None].astype(np.uint8)
    if rng.random() < 0.6:
        clouds = tile((height, width), float(rng.uniform(0.02, 0.2)), rng)
        roughen(canvas.image, np.clip(clouds, 0.5, 1.6))


def _hills(canvas: Canvas, rng: np.random.Generator) -> None:
    """Hills, woods and roofs on the horizon."""
    width = canvas.camera.size_px[0]
    for _ in range(int(rng.integers(0, 4))):
        ahead_m = float(rng.uniform(300, 900))
        columns = np.linspace(-0.2 * width, 1.2 * width, int(rng.integers(8, 80)))
        size = rng.uniform(0.005, 0.09) * width
        steps = np.cumsum(rng.normal(0, 1.0, len(columns)))
        rough = rng.normal(0, 0.4, len(columns)) if rng.random() < 0.6 else 0.0
        shape = steps - np.linspace(steps[0], steps[-1], len(columns))
        top = canvas.camera.centre_px[1] - np.abs(size * (0.4 + 0.25 * shape + rough))
        base = canvas.camera.centre_px[1] + 0.03 * width
        outline = np.column_stack([columns, top])
        ends = np.asarray([(columns[-1], base), (columns[0], base)])
        wood = _varied((55.0, 85.0, 65.0), rng, 25)
        colour = canvas.seen(wood, canvas.light.ambient * 1.2, ahead_m * float(rng.uniform(0.1, 1)))
        canvas.fill_px(np.vstack([outline, ends]), colour)


def _outline(left_m: float, right_m: float, ahead_m: npt.NDArray[np.float64]) -> Points:
    """A strip of the road, (2 n, 3)."""
    zero = np.zeros_like(ahead_m)
    left = np.column_stack([ahead_m, zero + left_m, zero])
    right = np.column_stack([ahead_m, zero + right_m, zero])
    return np.vstack([left, right[::-1]])


def _strip(canvas: Canvas, left_m: float, right_m: float, bgr: Bgr, level: float) -> None:
    """A strip along the road, by night bright in the own headlamps."""
    light = canvas.light
    cuts = (0, len(_AHEAD_M)) if light.headlamps < 0.05 else (0, 8, 10, 12, 14, 17, len(_AHEAD_M))
    for first, last in pairwise(cuts):
        ahead = _AHEAD_M[first : last + 1]
        near = light.headlamps * min(1.0, (12.0 / float(ahead.mean())) ** 1.5) * 0.7
        colour = canvas.seen(bgr, level + near, 0.3 * float(ahead[0]) + 20.0)
        canvas.fill(_outline(left_m, right_m, ahead), colour)


def _patch(
    canvas: Canvas, layout: RoadLayout, road: Bgr, level: float, rng: np.random.Generator
) -> None:
    """New tarmac, a seam along or across, a lid, concrete, or a wet place."""
    near_m = float(rng.uniform(3, 60))
    middle_m = float(rng.uniform(layout.left_m, layout.right_m))
    kind = int(rng.integers(5))
    size = (
        (rng.uniform(2, 40), rng.uniform(0.5, 4.0)),
        (rng.uniform(20, 200), rng.uniform(0.05, 0.25)),
        (rng.uniform(0.1, 0.5), rng.uniform(5.0, 20.0)),
        (rng.uniform(0.6, 1.0), rng.uniform(0.6, 1.0)),
        (rng.uniform(20, 100), 40.0),
    )[kind]
    tone = toned(road, float(rng.uniform(0.4, 0.85) if rng.random() < 0.7 else rng.uniform(1, 1.7)))
    ahead = np.linspace(near_m, near_m + float(size[0]), 5)
    half_m = float(size[1]) / 2
    left_m = max(middle_m - half_m, layout.left_m - layout.shoulder_m)
    right_m = min(middle_m + half_m, layout.right_m + layout.shoulder_m)
    canvas.fill(_outline(left_m, right_m, ahead), canvas.seen(tone, level, near_m))


def _markings(canvas: Canvas, layout: RoadLayout, level: float, rng: np.random.Generator) -> None:
    """Lines along the edges and between lanes, and at times across or in a lane."""
    if rng.random() < 0.1:
        return
    paint = _PAINTS[int(rng.choice(3, p=[0.55, 0.3, 0.15]))]
    bright = level * float(rng.uniform(0.5, 1.0)) + 0.5 * canvas.light.headlamps
    half_m = float(rng.uniform(0.05, 0.12))
    lines = [(layout.left_m, True), (layout.right_m, True)]
    lines += [
        (layout.left_m + number * layout.lane_width_m, False)
        for number in range(1, layout.lanes_left + layout.lanes_right + 1)
    ]
    if layout.lanes_oncoming:
        inner = layout.left_m - layout.median_m
        lines += [(inner, True), (layout.oncoming_left_m, True)]
        lines += [
            (inner - number * layout.lane_width_m, False)
            for number in range(1, layout.lanes_oncoming)
        ]
    period_m, dash_m = float(rng.uniform(6, 14)), float(rng.uniform(2, 5))
    start_m = float(rng.uniform(0, period_m))
    colour = canvas.seen(paint, bright, 30.0)
    yellow = canvas.seen(_PAINTS[2], bright, 30.0)
    for at_m, is_whole in lines:
        tone = yellow if at_m == layout.left_m and rng.random() < 0.35 else colour
        if is_whole:
            if rng.random() < 0.85:
                canvas.fill(_outline(at_m - half_m, at_m + half_m, _AHEAD_M), tone)
            continue
        for near_m in np.arange(start_m, 120.0, period_m):
            ahead = np.linspace(max(near_m, 1.0), near_m + dash_m, 3)
            canvas.fill(_outline(at_m - half_m, at_m + half_m, ahead), tone)
    if rng.random() < 0.15:  # a line to stop at, or a crossing
        near_m = float(rng.uniform(5, 40))
        bars = int(rng.integers(1, 3))
        if rng.random() < 0.5:
            ahead = np.asarray([near_m, near_m + 0.5])
            canvas.fill(_outline(layout.left_m, layout.right_m, ahead), colour)
        else:
            for left_m in np.arange(layout.left_m, layout.right_m, 1.0):
                ahead = np.asarray([near_m, near_m + 3.0 * bars])
                canvas.fill(_outline(left_m, left_m + 0.5, ahead), colour)
    if rng.random() < 0.2:  # an arrow or a word
        near_m, at_m = float(rng.uniform(6, 40)), layout.middle_of(int(rng.integers(-1, 2)))
        stem = _outline(at_m - 0.1, at_m + 0.1, np.asarray([near_m, near_m + 3.0]))
        canvas.fill(stem, colour)
        tip = [(near_m + 3, at_m - 0.5, 0), (near_m + 3, at_m + 0.5, 0), (near_m + 5, at_m, 0)]
        canvas.fill(tip, colour)


def _shadow(canvas: Canvas, layout: RoadLayout, rng: np.random.Generator) -> None:
    """Shadow of a tree, a bridge or a wall beside the road, without what throws it."""
    near_m = float(rng.uniform(3, 50))
    factor = float(rng.uniform(0.35, 0.8))
    left_m, right_m = layout.left_m - 6, layout.right_m + 6
    if rng.random() < 0.4:
        ahead = np.asarray([near_m, near_m + float(rng.uniform(2, 15))])
        canvas.darken(_outline(left_m, right_m, ahead), factor, 2.0)
        return
    for _ in range(int(rng.integers(2, 12))):
        middle = near_m + rng.uniform(0, 6), rng.uniform(left_m, right_m)
        turn = np.linspace(0, 2 * np.pi, 9)[:-1]
        reach = rng.uniform(0.3, 2.5) * rng.uniform(0.6, 1.3, 8)
        spot = np.column_stack(
            [middle[0] + reach * np.cos(turn), middle[1] + 1.5 * reach * np.sin(turn), 0 * turn]
        )
        canvas.darken(spot, factor, float(rng.uniform(1, 4)))


def _roughen_ground(canvas: Canvas, rng: np.random.Generator) -> None:
    """Grain of tarmac and grass, finer with distance, and broad shades."""
    height, width = canvas.image.shape[:2]
    horizon = int(np.clip(canvas.camera.centre_px[1], 0, height - 8))
    shape = height - horizon, width
    part = canvas.image[horizon:]
    near = tile((shape[0], shape[1]), 1.0, rng)
    flat = np.asarray(
        [(0, 0), (width, 0), (width, shape[0]), (0, shape[0])],
        np.float32,
    )
    spread = width * float(rng.uniform(0.5, 3.0))
    far = np.asarray(
        [(0, 0), (width, 0), (width + spread, shape[0]), (-spread, shape[0])], np.float32
    )
    warped = cv2.warpPerspective(
        near, cv2.getPerspectiveTransform(flat, far), (width, shape[0]), borderMode=cv2.BORDER_WRAP
    )
    strength = np.float32(rng.uniform(0.01, 0.16))
    roughen(part, np.asarray(1 + strength * (np.asarray(warped, np.float32) - 1), np.float32))
