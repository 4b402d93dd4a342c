"""Rendered plates for the reader, cut out as by the detector."""

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from onboard.vision.plate_reader import rectified_views, rectify
from sim_rig.rendering.lens import photograph
from sim_rig.rendering.plate_art import PlateFormat, draw_plate
from sim_rig.rendering.plate_styles import random_plate
from sim_rig.rendering.wear import worn

View = npt.NDArray[np.uint8]
"""(64, 160), grey."""
Quad = npt.NDArray[np.float32]
_Frame = tuple[View, Quad]
"""A picture of a plate, and the corners that a detector gives."""

_PX_PER_MM = 0.9
_VIEWS_PER_PLATE = 4
"""Drawing a plate takes longer than another image of it."""
_SMALL, _SMALL_PX = 0.6, (3.0, 7.0)
"""Share of the plates that are small, as of a vehicle at the safety distance, and their width for
each character, in pixels. Each is seen in up to `_MOST_FRAMES` frames, as `plate_views` averages
them."""
_MOST_FRAMES, _FRAME_SHIFT_PX = 8, 1.5
"""Frames of a small plate, and how far it moves in them to either side."""
_SMALL_ERROR_PX, _FRAME_ERROR_PX = 0.35, 0.15
"""Sigma of the edges of a small plate as the detector finds them, in all frames and in each. On
rendered drives, plates of 24 to 32 px are off by 0.4 and 0.15 px."""
_WRONG_OUTLINE = 0.22
"""Share of the views whose corners are those of the recess or holder around the plate."""


@dataclass(frozen=True, slots=True)
class _Drawn:
    text: str
    plate_format: PlateFormat
    art: npt.NDArray[np.uint8]


def render_views(count: int, rng: np.random.Generator) -> tuple[View, list[str]]:
    """Render `count` views for training, (count, 64, 160), and their texts."""
    found, texts = _photographed(count, rng, held_back=False)
    return np.stack([_mean([rectify(*frame) for frame in frames]) for frames in found]), texts


def render_validation_plates(count: int, rng: np.random.Generator) -> tuple[View, list[str]]:
    """Render `count` plates in fonts held back, (count, views, 64, 160), and their texts."""
    found, texts = _photographed(count, rng, held_back=True)
    views = [_mean([rectified_views(*frame) for frame in frames]) for frames in found]
    return np.stack(views), texts


def _mean(views: list[View]) -> View:
    return np.asarray(np.rint(np.mean(views, axis=0)), np.uint8)


def _photographed(
    count: int, rng: np.random.Generator, *, held_back: bool
) -> tuple[list[list[_Frame]], list[str]]:
    """Render the frames of plates with the corners that a detector gives, and the texts."""
    found: list[list[_Frame]] = []
    texts: list[str] = []
    while len(found) < count:
        text, plate_format = random_plate(rng, validation_font=held_back)
        drawn = _Drawn(text, plate_format, worn(draw_plate(text, plate_format, _PX_PER_MM), rng))
        found += [_photograph(drawn, rng) for _ in range(_VIEWS_PER_PLATE)]
        texts += [text] * _VIEWS_PER_PLATE
    return found[:count], texts[:count]


def _photograph(drawn: _Drawn, rng: np.random.Generator) -> list[_Frame]:
    shape = drawn.plate_format
    characters = max(5, len(drawn.text))
    is_small = rng.random() < _SMALL
    # From barely legible to larger than the view; small ones are harder, so there are more.
    least_px, most_px = _SMALL_PX if is_small else (7.0, 30.0)
    width_px = float(np.exp(rng.uniform(np.log(least_px), np.log(most_px)))) * characters
    if shape.width_mm < 250:
        width_px *= 0.7
    height_px = width_px * shape.height_mm / shape.width_mm
    quad = posed(width_px, height_px, rng)
    mistaken = rng.random() < _WRONG_OUTLINE
    recess = around(quad, rng.uniform(-0.1, 0.32, 4).clip(0)) if mistaken else quad
    least, most = recess.min(axis=0), recess.max(axis=0)
    size = np.ceil(most - least) + np.asarray([0.3 * width_px, 0.8 * height_px])
    size += 2 * _FRAME_SHIFT_PX * is_small
    columns, rows = (int(value) for value in size)
    shift = (size - most - least).astype(np.float32) / 2
    quad, recess = quad + shift, recess + shift
    scene = _surroundings(rows, columns, quad, rng)
    if mistaken:
        draw_recess(scene, recess, rng)
    found = quad.copy()
    if shape.name == "eu" and rng.random() < 0.25:  # a detector may leave out the blue band
        found[[0, 3]] += np.float32(rng.uniform(0.04, 0.1)) * (quad[[1, 2]] - quad[[0, 3]])
    found = _as_found(recess if mistaken else found, rng)
    art, fine_px = in_the_shade(drawn.art, rng), width_px / characters / 6
    if not is_small:
        paste(scene, art, quad)
        return [(photograph(scene, rng, fine_px), found)]
    found += rng.normal(0, _SMALL_ERROR_PX, (4, 2)).astype(np.float32)
    camera = int(rng.integers(2**32))
    frames: list[_Frame] = []
    for _ in range(int(rng.integers(1, _MOST_FRAMES + 1))):
        moved = rng.uniform(-_FRAME_SHIFT_PX, _FRAME_SHIFT_PX, 2).astype(np.float32)
        seen = _moved(scene, moved)
        paste(seen, art, quad + moved)
        # The same camera; the plate moves over its grain.
        picture = photograph(seen, np.random.default_rng(camera), fine_px)
        error = rng.normal(0, _FRAME_ERROR_PX, (4, 2)).astype(np.float32)
        frames.append((picture, found + moved + error))
    return frames


def _moved(scene: View, by_px: npt.NDArray[np.float32]) -> View:
    matrix = np.asarray([[1, 0, by_px[0]], [0, 1, by_px[1]]])
    rows, columns = scene.shape[:2]
    moved = cv2.warpAffine(scene, matrix, (columns, rows), borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(moved, np.uint8)


def posed(width_px: float, height_px: float, rng: np.random.Generator) -> Quad:
    """Corners around (0, 0), rotated and in perspective.

    Args:
        width_px: of the plate.
        height_px: of the plate.
        rng: for the pose.
    """
    x, y = width_px / 2, height_px / 2
    corners = np.asarray([(-x, -y), (x, -y), (x, y), (-x, y)])
    squeeze = 1 - abs(rng.normal(0, 0.12))
    shear = rng.normal(0, 0.07)
    angle = np.deg2rad(rng.normal(0, 4.5))
    turn = np.asarray([(np.cos(angle), -np.sin(angle)), (np.sin(angle), np.cos(angle))])
    tilt = np.asarray([(squeeze, shear), (rng.normal(0, 0.05), 1.0)])
    keystone = 1 + np.sign(corners[:, :1]) * rng.normal(0, 0.03)
    return np.asarray(corners * keystone @ tilt.T @ turn.T, np.float32)


def _surroundings(rows: int, columns: int, quad: Quad, rng: np.random.Generator) -> View:
    """Draw bodywork, a holder around the plate, and edges nearby."""
    scene = np.empty((rows, columns, 3), np.uint8)
    paint = rng.integers(5, 240) + rng.normal(0, 25, 3)
    share = np.linspace(-1, 1, rows)[:, None, None] * rng.normal(0, 30)
    scene[:] = np.clip(paint + share, 0, 255).astype(np.uint8)
    for _ in range(rng.integers(0, 4)):
        grey = rng.integers(0, 255, 3).tolist()
        if rng.random() < 0.2:  # a lamp, a handle, a badge
            place = rng.integers(0, (columns, rows)).tolist()
            axes = rng.integers(1, max(2, rows // 3) + 1, 2).tolist()
            cv2.ellipse(scene, place, axes, 0, 0, 360, grey, cv2.FILLED, cv2.LINE_AA)
            continue
        start, end = rng.integers(0, max(rows, columns), (2, 2)).tolist()
        cv2.line(scene, start, end, grey, int(rng.integers(1, max(2, rows // 10) + 1)), cv2.LINE_AA)
    if rng.random() < 0.65:
        _holder(scene, quad, rng.uniform(1.01, 1.18, 2), rng)
    if rng.random() < 0.3:  # an edge of a recess or a lamp beside it, as upright as a 1
        for _ in range(rng.integers(1, 3)):
            side, other = quad[[1, 2]], quad[[0, 3]]
            width = rng.uniform(1.0, 1.12) * (side - other)
            bar = other + width if rng.random() < 0.6 else side - width
            shade = rng.integers(0, 255, 3).tolist()
            line = np.rint(bar).astype(int).tolist()
            thickness = int(rng.integers(1, max(2, rows // 14) + 1))
            cv2.line(scene, line[0], line[1], shade, thickness, cv2.LINE_AA)
    return scene


def _holder(
    scene: View, quad: Quad, share: npt.NDArray[np.float64], rng: np.random.Generator
) -> None:
    """Draw a holder or a recess, `share` times as wide and high as the plate."""
    middle = quad.mean(axis=0)
    around = middle + (quad - middle) * share
    dark = rng.random() < 0.8
    shade = (rng.integers(0, 90) if dark else rng.integers(90, 250)) + rng.normal(0, 8, 3)
    corners = np.rint(around * 16).astype(np.int32)
    cv2.fillConvexPoly(scene, corners, shade.clip(0, 255).tolist(), cv2.LINE_AA, 4)


def around(quad: Quad, shares: npt.NDArray[np.float64]) -> Quad:
    """Corners moved outward at the left, top, right and bottom, in shares of the plate's size."""
    left, top, right, bottom = shares
    along, down = quad[1] - quad[0], quad[3] - quad[0]
    outward = np.asarray([(-left, -top), (right, -top), (right, bottom), (-left, bottom)])
    return np.asarray(quad + outward[:, :1] * along + outward[:, 1:] * down, np.float32)


def draw_recess(scene: View, recess: Quad, rng: np.random.Generator) -> None:
    """Draw a recess: bodywork of another shade, or only its edges.

    Args:
        scene: (h, w, 3) BGR; is changed.
        recess: its corners.
        rng: for the shades.
    """
    corners = np.rint(recess * 16).astype(np.int32)
    shade, edge = rng.integers(0, 255, 2).repeat(3).reshape(2, 3) + rng.normal(0, 12, (2, 3))
    if rng.random() < 0.6:
        cv2.fillConvexPoly(scene, corners, shade.clip(0, 255).tolist(), cv2.LINE_AA, 4)
    if rng.random() < 0.7:
        thickness = int(rng.integers(1, max(2, scene.shape[0] // 20) + 1))
        colour = edge.clip(0, 255).tolist()
        cv2.polylines(scene, [corners], True, colour, thickness, cv2.LINE_AA, 4)


def in_the_shade(art: View, rng: np.random.Generator) -> View:
    """Shade the plate: one in six is darker than the bodywork around it."""
    if rng.random() > 1 / 6:
        return art
    light = rng.uniform(0.2, 0.65)
    if rng.random() < 0.4:  # below the edge of a lid: the upper part only
        rows = np.linspace(-1.0, 2.0, len(art)).clip(0, 1)[:, None, None]
        return np.asarray(art * (light + (1 - light) * rows), np.uint8)
    return np.asarray(art * light, np.uint8)


def paste(scene: View, art: View, quad: Quad) -> None:
    """Draw the plate into the scene, reduced first against aliasing.

    Args:
        scene: (h, w, 3) BGR; is changed.
        art: the plate, BGR.
        quad: its corners in the scene.
    """
    width_px = float(np.hypot(*(quad[1] - quad[0])))
    height_px = float(np.hypot(*(quad[3] - quad[0])))
    if width_px < art.shape[1]:
        size = (max(2, round(1.3 * width_px)), max(2, round(1.3 * height_px)))
        art = np.asarray(cv2.resize(art, size, interpolation=cv2.INTER_AREA), np.uint8)
    height, width = art.shape[:2]
    source = np.asarray([(0, 0), (width, 0), (width, height), (0, height)], np.float32) - 0.5
    matrix = cv2.getPerspectiveTransform(source.astype(np.float32), quad - np.float32(0.5))
    size = (scene.shape[1], scene.shape[0])
    warped = cv2.warpPerspective(art, matrix, size, borderMode=cv2.BORDER_REPLICATE)
    mask = np.zeros(scene.shape[:2], np.uint8)
    cv2.fillConvexPoly(mask, np.rint((quad - 0.5) * 16).astype(np.int32), 255, cv2.LINE_AA, 4)
    cv2.copyTo(warped, mask, scene)


def _as_found(quad: Quad, rng: np.random.Generator) -> Quad:
    """The corners with a detector's errors: shifted, scaled, each a little off."""
    middle = quad.mean(axis=0)
    along, down = (quad[1] - quad[0]), (quad[3] - quad[0])
    wild = 2.0 if rng.random() < 0.15 else 1.0
    scale = 1 + wild * rng.normal(0.006, 0.047, 2)
    offset = wild * (rng.normal(0, 0.018, (4, 2)) + rng.normal(0, 0.022, 2))
    sides = np.asarray([(-1, -1), (1, -1), (1, 1), (-1, 1)]) / 2 * scale + offset
    return np.asarray(middle + sides[:, :1] * along + sides[:, 1:] * down, np.float32)
