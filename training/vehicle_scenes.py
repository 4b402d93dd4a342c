"""Rendered streets for the vehicle detector, and their vehicles as rows of numbers."""

import cv2
import numpy as np
import numpy.typing as npt

from onboard.vision.vehicle_network import VehicleKind
from sim_rig.rendering.street.street import SeenVehicle, random_street

SCENE_SIZE = (416, 256)
"""Width and height of a scene, which is larger than a view of it."""
VIEW_SIZE = (320, 192)
"""Width and height of what the network sees of it in training: multiples of its coarsest cell."""
MAX_VEHICLES = 11
LEFT, TOP, RIGHT, BOTTOM, END_LEFT, END_RIGHT, KIND, VISIBLE = range(8)
"""Columns of a vehicle's row; pixels, but for the last two."""
_SCALES = 0.75, 1.35
"""Change of size of a scene between two looks at it."""


def render_vehicle_scenes(
    count: int, rng: np.random.Generator
) -> tuple[npt.NDArray[np.uint8], npt.NDArray[np.float32]]:
    """Render streets.

    Returns:
        scenes: (count, 256, 416, 3) BGR.
        vehicles: (count, 11, 8), the nearest last, NaN for none.
    """
    scenes = np.empty((count, SCENE_SIZE[1], SCENE_SIZE[0], 3), np.uint8)
    vehicles = np.full((count, MAX_VEHICLES, 8), np.nan, np.float32)
    for index in range(count):
        street = random_street(SCENE_SIZE, rng)
        scenes[index] = street.image
        order = sorted(street.vehicles, key=lambda vehicle: -vehicle.ahead_m)[-MAX_VEHICLES:]
        for row, vehicle in enumerate(order):
            vehicles[index, row] = _row(vehicle)
    return scenes, vehicles


def _row(vehicle: SeenVehicle) -> tuple[float, ...]:
    end_px = vehicle.end_px or (np.nan, np.nan)
    kind = list(VehicleKind).index(vehicle.kind)
    return *vehicle.box_px, *end_px, kind, vehicle.visible


def viewed(
    scenes: npt.NDArray[np.uint8], vehicles: npt.NDArray[np.float32], rng: np.random.Generator
) -> tuple[npt.NDArray[np.uint8], npt.NDArray[np.float32]]:
    """Look at a part of each scene: scaled, stretched, shifted, half of them mirrored.

    Gain, contrast, tint, sharpness and compression differ from look to look as well.

    Args:
        scenes: (n, 256, 416, 3).
        vehicles: (n, 11, 8).
        rng: for the changes.

    Returns:
        views: (n, 192, 320, 3).
        places: the vehicles in them.
    """
    columns, rows = VIEW_SIZE
    views = np.empty((len(scenes), rows, columns, 3), np.uint8)
    places = vehicles.copy()
    for index, scene in enumerate(scenes):
        scale = np.exp(rng.uniform(*np.log(_SCALES)) + rng.normal(0, 0.03, 2))
        spare = np.asarray(VIEW_SIZE) - scale * np.asarray(SCENE_SIZE)
        shift = rng.uniform(0, 1, 2) * spare
        if rng.random() < 0.5:
            scale[0], shift[0] = -scale[0], columns - shift[0]
        matrix = np.column_stack([np.diag(scale), shift + (scale - 1) / 2])
        cv2.warpAffine(
            scene, matrix, (columns, rows), views[index], borderMode=cv2.BORDER_REPLICATE
        )
        views[index] = _exposed(views[index], rng)
        place = places[index]
        place[:, [LEFT, RIGHT, END_LEFT, END_RIGHT]] *= np.float32(scale[0])
        place[:, [LEFT, RIGHT, END_LEFT, END_RIGHT]] += np.float32(shift[0])
        place[:, [TOP, BOTTOM]] = place[:, [TOP, BOTTOM]] * scale[1] + shift[1]
        if scale[0] < 0:
            place[:, [LEFT, RIGHT, END_LEFT, END_RIGHT]] = place[
                :, [RIGHT, LEFT, END_RIGHT, END_LEFT]
            ]
    return views, places


def _exposed(view: npt.NDArray[np.uint8], rng: np.random.Generator) -> npt.NDArray[np.uint8]:
    """The (h, w, 3) view as another camera would record it."""
    gain = np.exp(rng.normal(0, 0.2) + rng.normal(0, 0.06, 3))
    gamma = np.exp(rng.normal(0, 0.2))
    levels = (np.arange(256)[:, None] / 255) ** gamma * gain * 255
    table = np.clip(levels, 0, 255).astype(np.uint8)
    view = np.asarray(cv2.LUT(view, table[None]), np.uint8)
    if rng.random() < 0.3:
        sigma = float(rng.uniform(0.5, 1.4))
        view = np.asarray(cv2.GaussianBlur(view, (0, 0), sigma), np.uint8)
    if rng.random() < 0.3:
        quality = int(rng.integers(15, 70))
        _, code = cv2.imencode(".jpg", view, [cv2.IMWRITE_JPEG_QUALITY, quality])
        view = np.asarray(cv2.imdecode(code, cv2.IMREAD_COLOR), np.uint8)
    return view
