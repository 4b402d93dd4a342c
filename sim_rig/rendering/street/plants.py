"""Trees, bushes and hedges beside the road."""

import cv2
import numpy as np
import numpy.typing as npt

from sim_rig.rendering.street.canvas import FINE, Bgr, Canvas
from sim_rig.rendering.street.ground import RoadLayout, beside
from sim_rig.rendering.street.textures import tile

_BARK: Bgr = (50.0, 60.0, 75.0)


def tree(canvas: Canvas, ahead_m: float, layout: RoadLayout, rng: np.random.Generator) -> None:
    """A stem with branches and a crown, or a bush."""
    right_m, height_m = beside(layout, rng, 25.0), float(rng.uniform(0.8, 14.0))
    radius_m = height_m * float(rng.uniform(0.18, 0.5))
    foot_m = float(rng.uniform(0.0, 0.5)) * height_m if height_m > 2.5 else 0.0
    middle_m = (foot_m + height_m) / 2
    if height_m > 2.5:
        bark = canvas.seen(_BARK, canvas.level((-1, 0, 0), ahead_m), ahead_m)
        stem_m = 0.04 * height_m
        canvas.line([(ahead_m, right_m, 0), (ahead_m, right_m, middle_m)], stem_m, bark)
        for _ in range(int(rng.integers(2, 9))):
            across_m, up_m = rng.uniform(-0.8, 0.8) * radius_m, rng.uniform(middle_m, height_m)
            fork = (ahead_m, right_m, float(rng.uniform(0.3, 0.9)) * middle_m)
            canvas.line([fork, (ahead_m, right_m + across_m, up_m)], 0.35 * stem_m, bark)
    leaf = np.clip(np.asarray((40.0, 90.0, 60.0)) * rng.uniform(0.3, 1.6), 4, 230)
    leaf = np.clip(leaf + rng.normal(0, 15, 3), 4, 250)
    box_m = (right_m - radius_m, foot_m, right_m + radius_m, height_m)
    _leaves(canvas, ahead_m, box_m, leaf, rng)


def hedge(canvas: Canvas, ahead_m: float, layout: RoadLayout, rng: np.random.Generator) -> None:
    """Bushes in a row along the road."""
    x_m = beside(layout, rng, 3.0)
    size_m, step_m = float(rng.uniform(0.6, 2.5)), float(rng.uniform(1.5, 8.0))
    leaf = np.clip(np.asarray((45.0, 100.0, 75.0)) * rng.uniform(0.4, 1.8), 4, 250)
    for number in range(int(rng.integers(2, 9)), 0, -1):
        at_m = ahead_m + number * step_m
        side_m = size_m * float(rng.uniform(0.6, 1.2))
        box_m = (x_m - side_m / 2, 0.0, x_m + side_m / 2, 0.8 * side_m)
        _leaves(canvas, at_m, box_m, leaf, rng)


def _leaves(
    canvas: Canvas,
    ahead_m: float,
    box_m: tuple[float, float, float, float],
    leaf: npt.NDArray[np.float64],
    rng: np.random.Generator,
) -> None:
    """An oval of leaves with gaps, lit from above, in a box (left, low, right, high)."""
    left_m, low_m, right_m, high_m = box_m
    corners = canvas.camera.project([(ahead_m, left_m, high_m), (ahead_m, right_m, low_m)])
    width, height = canvas.camera.size_px
    (left, top), (right, bottom) = corners.tolist()
    if right - left < 2 or bottom - top < 2 or right - left > 4 * width:
        return
    x0, y0 = max(0, round(left)), max(0, round(top))
    x1, y1 = min(width, round(right)), min(height, round(bottom))
    if x1 - x0 < 2 or y1 - y0 < 2:
        return
    y, x = np.ogrid[y0:y1, x0:x1]
    across = (2 * x - left - right) / (right - left)
    down = (2 * y - top - bottom) / (bottom - top)
    fine = tile((y1 - y0, x1 - x0), 1.0, rng) - 1
    inside = (across**2 + down**2 + float(rng.uniform(0.1, 0.4)) * fine < 0.85).astype(np.uint8)
    level = canvas.level((-0.7, 0.0, 0.7), ahead_m) * (0.9 - 0.4 * down)
    shade = np.clip(level * (1 + float(rng.uniform(0.1, 0.5)) * fine), 0.02, 2)[..., None]
    sight = np.exp(-ahead_m / canvas.light.sight_m)
    veil = np.asarray(canvas.light.haze_bgr) * (1 - sight)
    tones = np.clip(shade * leaf * sight + veil, 0, 255).astype(np.uint8)
    cv2.copyTo(tones, inside, canvas.image[y0:y1, x0:x1])
    owners = canvas.owners[y0 // FINE : y1 // FINE, x0 // FINE : x1 // FINE]
    hidden = cv2.resize(inside, owners.shape[::-1], interpolation=cv2.INTER_NEAREST)
    owners[hidden > 0] = 0
