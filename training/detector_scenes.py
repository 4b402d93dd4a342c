"""Rendered scenes for the detector: plates on vehicles in clutter, and their corners."""

import cv2
import numpy as np
import numpy.typing as npt

from sim_rig.rendering.clutter import add_lettering, colour, surroundings
from sim_rig.rendering.lens import photograph
from sim_rig.rendering.plate_art import draw_plate
from sim_rig.rendering.plate_styles import random_plate
from sim_rig.rendering.vehicle_clutter import add_car
from sim_rig.rendering.wear import worn
from training.reader_views import around, draw_recess, in_the_shade, paste, posed

SCENE_SIZE = (256, 192)
"""Width and height of a scene, in pixels of the network's input."""
MAX_PLATES = 2
SMALLEST_PX, LARGEST_PX = 11.0, 140.0
"""Range of plate widths: others are found at another scale of the image."""
_CENTRED, _CENTRED_PX, _MIN_CENTRED_PX = 0.5, (70.0, 105.0), 24.0
"""Share of the plates that are scaled and centred as for refining, their widths then, and the least
width before: with the blur of a small plate."""
_BARE = 0.15
"""Share of the plates on plain bodywork: no recess, no holder, no seam."""
_PX_PER_MM = 0.35
_VEHICLE_TO_PLATE = {"us": 5.9, "eu": 3.5, "br": 4.5, "br motorcycle": 4.0}


def render_scenes(
    count: int, rng: np.random.Generator
) -> tuple[npt.NDArray[np.uint8], npt.NDArray[np.float32]]:
    """Render grey scenes and the corners of their plates.

    Returns:
        scenes: (count, 192, 256).
        corners: (count, 2, 4, 2), NaN for none.
    """
    scenes = np.empty((count, SCENE_SIZE[1], SCENE_SIZE[0]), np.uint8)
    corners = np.full((count, MAX_PLATES, 4, 2), np.nan, np.float32)
    for index in range(count):
        scenes[index] = _scene(corners[index], rng)
    return scenes, corners


def moved(
    scenes: npt.NDArray[np.uint8], corners: npt.NDArray[np.float32], rng: np.random.Generator
) -> tuple[npt.NDArray[np.uint8], npt.NDArray[np.float32]]:
    """Augment scenes: each is scaled, stretched and shifted.

    Args:
        scenes: (n, h, w) grey.
        corners: (n, plates, 4, 2).
        rng: for the changes.
    """
    rows, columns = scenes.shape[1:]
    middle = np.asarray([columns / 2, rows / 2])
    views, places = np.empty_like(scenes), np.empty_like(corners)
    for index, scene in enumerate(scenes):
        scale = np.exp(rng.uniform(-0.25, 0.25) + rng.normal(0, 0.04, 2))
        shift = middle * (1 + rng.uniform(-0.3, 0.3, 2)) - scale * middle
        plate = corners[index, 0]
        width_px = float(np.ptp(plate[:, 0]))  # NaN if there is none
        if width_px >= _MIN_CENTRED_PX and rng.random() < _CENTRED:
            scale = rng.uniform(*_CENTRED_PX) / width_px * np.exp(rng.normal(0, 0.04, 2))
            # As far from the scene's border as from that of a view for refining.
            shift = rng.uniform((96, 48), (columns - 96, rows - 48)) - scale * plate.mean(axis=0)
        matrix = np.column_stack([np.diag(scale), shift + (scale - 1) / 2])
        cv2.warpAffine(
            scene, matrix, (columns, rows), views[index], borderMode=cv2.BORDER_REPLICATE
        )
        places[index] = corners[index] * scale + shift
    return views, places


def mirrored(
    scenes: npt.NDArray[np.uint8], corners: npt.NDArray[np.float32], rng: np.random.Generator
) -> tuple[npt.NDArray[np.uint8], npt.NDArray[np.float32]]:
    """Mirror half of the batches: the detector must find mirrored plates too.

    Args:
        scenes: (n, h, w) grey.
        corners: (n, plates, 4, 2).
        rng: for the choice.
    """
    if rng.random() < 0.5:
        return scenes, corners
    places = corners[:, :, [1, 0, 3, 2]].copy()
    places[..., 0] = scenes.shape[2] - places[..., 0]
    return np.ascontiguousarray(scenes[:, :, ::-1]), places


def _scene(corners: npt.NDArray[np.float32], rng: np.random.Generator) -> npt.NDArray[np.uint8]:
    columns, rows = SCENE_SIZE
    image = surroundings(rows, columns, rng)
    count = int(rng.choice([0, 1, 2], p=[0.2, 0.6, 0.2]))
    plates: list[tuple[npt.NDArray[np.uint8], npt.NDArray[np.float32], bool]] = []
    for _ in range(max(1, count)):
        text, plate_format = random_plate(rng)
        width_px = float(np.exp(rng.uniform(np.log(SMALLEST_PX), np.log(LARGEST_PX))))
        height_px = width_px * plate_format.height_mm / plate_format.width_mm
        centre = (rng.uniform(0.05, 0.95) * columns, rng.uniform(0.08, 0.92) * rows)
        if rng.random() < 0.9:
            share = _VEHICLE_TO_PLATE[plate_format.name] * rng.uniform(0.8, 1.2)
            add_car(image, centre, width_px * share, rng)
        if rng.random() < 0.5:
            add_lettering(image, rng, rng.uniform(0.08, 0.25) * width_px)
        quad = posed(width_px, height_px, rng) + np.asarray(centre, np.float32)
        if all(_apart(quad, other) for _, other, _ in plates):
            is_bare = bool(rng.random() < _BARE)
            if is_bare:
                _plain_body(image, quad, rng)
            art = worn(draw_plate(text, plate_format, _PX_PER_MM), rng)
            plates.append((art, quad, is_bare))
    finest_px = 1.0
    for place, (art, quad, is_bare) in enumerate(plates[:count]):
        if not is_bare:
            _housing(image, quad, art, rng)
        paste(image, in_the_shade(art, rng), quad)
        corners[place] = quad
        finest_px = min(finest_px, float(np.ptp(quad[:, 0])) / 40)
    picture = photograph(image, rng, max(0.5, finest_px))
    return np.asarray(cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY), np.uint8)


def _apart(one: npt.NDArray[np.float32], other: npt.NDArray[np.float32]) -> bool:
    """Whether two plates and their housings do not touch."""
    reach = (np.ptp(one, axis=0) + np.ptp(other, axis=0)) * 0.8
    return bool((np.abs(one.mean(axis=0) - other.mean(axis=0)) > reach).any())


def _plain_body(
    image: npt.NDArray[np.uint8], quad: npt.NDArray[np.float32], rng: np.random.Generator
) -> None:
    """Draw bodywork of any colour, often wider than a view for refining."""
    body = around(quad, rng.uniform((0.2, 0.6, 0.2, 0.6), (2.0, 5.0, 2.0, 5.0)))
    cv2.fillConvexPoly(image, np.rint(body * 16).astype(np.int32), colour(rng), cv2.LINE_AA, 4)


def _housing(
    image: npt.NDArray[np.uint8],
    quad: npt.NDArray[np.float32],
    art: npt.NDArray[np.uint8],
    rng: np.random.Generator,
) -> None:
    """Draw the mounting of a plate: a recess or its edges, a holder, lettering on either."""
    if rng.random() < 0.15:  # a white plate on a white car
        body = around(quad, rng.uniform(0.1, 1.5, 4))
        shade = (np.median(art, axis=(0, 1)) + rng.normal(0, 15)).clip(0, 255).tolist()
        cv2.fillConvexPoly(image, np.rint(body * 16).astype(np.int32), shade, cv2.LINE_AA, 4)
    if rng.random() < 0.5:
        recess = around(quad, rng.uniform(-0.05, 0.4, 4).clip(0))
        draw_recess(image, recess, rng)
    if rng.random() < 0.5:
        holder = around(quad, rng.uniform(0.01, 0.07, 4) * (1, 2, 1, 2))
        shade = (rng.integers(0, 90) if rng.random() < 0.75 else rng.integers(90, 250)).repeat(3)
        shade = (shade + rng.normal(0, 8, 3)).clip(0, 255).tolist()
        cv2.fillConvexPoly(image, np.rint(holder * 16).astype(np.int32), shade, cv2.LINE_AA, 4)
