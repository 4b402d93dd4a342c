"""Boxes of vehicles in an image, by a small convolutional network trained on rendered streets.

The network sees the image 640 pixels wide. For each cell of 8 x 8 pixels it gives the score that
the cell is in the middle of a vehicle, that vehicle's box, the sides of its rear or front, and its
kind. Cells of the same vehicle are merged (`training/` makes the network).
"""

from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt

from onboard.observations import ImageBox
from onboard.vision.network import Network

DEFAULT_MODEL = Path(__file__).parent / "models" / "vehicle_detector.onnx"
CELL_PX = 8
"""Side of a cell of the network's output, in pixels of its input."""
COARSEST_PX = 32
"""Sides of the network's input are multiples of it."""
SIDE_UNIT_PX = 32.0
"""Unit of the distances of a vehicle's sides from the middle of a cell."""
WIDTH_PX = 640
"""Width of an image as the network sees it."""
SIDES = 6
"""Left, top, right and bottom of the box; left and right of the rear or front."""
LEAST_SCORE = 0.4
"""Score from which a vehicle is reported."""
_MIN_OVERLAP, _MIN_INSIDE, _MIN_RATIO = 0.45, 0.65, 0.25
"""Two boxes are one vehicle from this intersection over union on, or if so much of the smaller one
is in the larger one and it is not much smaller: farther vehicles are seen beside near ones."""


class VehicleKind(StrEnum):
    """Kinds of vehicles that the network tells apart, in the order of its output."""

    CAR = "car"
    VAN = "van"
    TRUCK = "truck"
    BUS = "bus"
    MOTORCYCLE = "motorcycle"


@dataclass(frozen=True, slots=True)
class VehicleBox:
    """A vehicle in an image."""

    box: ImageBox
    end_px: tuple[float, float] | None
    """Left and right side of its rear or front; `None` if they are not known."""
    kind: VehicleKind
    score: float
    """Score that it is a vehicle, 0 to 1."""


class StreetNetwork:
    """The network, loaded once; not to be shared between threads."""

    def __init__(self, model: Path = DEFAULT_MODEL, *, least_score: float = LEAST_SCORE) -> None:
        """Load the network.

        Args:
            model: ONNX file.
            least_score: of a vehicle that is reported.

        Raises:
            FileNotFoundError: the file is missing.
        """
        self._network = Network(model)
        self._least_score = least_score

    def find(self, image: npt.NDArray[np.uint8], scale: float | None = None) -> list[VehicleBox]:
        """Vehicles in an image, highest score first.

        Args:
            image: (h, w, 3), BGR.
            scale: that of the network's input to the image; `None` is that of a whole one.
        """
        scale = scale or WIDTH_PX / image.shape[1]
        columns, rows = (max(1, round(scale * side)) for side in image.shape[1::-1])
        way = cv2.INTER_AREA if scale < 1 else cv2.INTER_LINEAR
        view = cv2.resize(image, (columns, rows), interpolation=way)
        rims = 0, -rows % COARSEST_PX, 0, -columns % COARSEST_PX
        view = cv2.copyMakeBorder(view, *rims, cv2.BORDER_REPLICATE)
        answer = self._network.run_one(as_input(np.asarray(view, np.uint8)[None]))
        found = decode(answer[0], self._least_score)
        size = np.asarray([image.shape[1], image.shape[0]])
        return [_scaled(vehicle, 1 / scale, size) for vehicle in found]


def as_input(pictures: npt.NDArray[np.uint8]) -> npt.NDArray[np.float32]:
    """Convert (n, h, w, 3) BGR pictures to the network's input (n, 3, h, w).

    Levels become logarithms, so that light only shifts them.
    """
    flat = cv2.LUT(pictures.reshape(-1, pictures.shape[2], 3), _LOGARITHM)
    levels = np.asarray(flat, np.float32).reshape(pictures.shape)
    return np.ascontiguousarray(levels.transpose(0, 3, 1, 2))


_LOGARITHM = ((np.log(np.arange(256) + 12.0) - 4.4) / 0.8).astype(np.float32)


def decode(answer: npt.NDArray[np.float32], least_score: float) -> list[VehicleBox]:
    """Vehicles in the network's output, highest score first.

    Args:
        answer: (1 + 6 + kinds, rows, columns): logit, sides, logits of the kinds.
        least_score: of a vehicle that is reported.
    """
    scores = 1 / (1 + np.exp(-answer[0]))
    rows, columns = np.nonzero(scores >= least_score)
    if not len(rows):
        return []
    strength = scores[rows, columns]
    middles = np.stack([columns, rows], axis=1) * CELL_PX + CELL_PX / 2
    sides = answer[1 : 1 + SIDES, rows, columns].T * SIDE_UNIT_PX + middles[:, [0, 1, 0, 1, 0, 0]]
    kinds = answer[1 + SIDES :, rows, columns]
    found: list[VehicleBox] = []
    free = np.ones(len(rows), bool)
    for best in np.argsort(-strength):
        if not free[best]:
            continue
        same = free & _are_same(sides[:, :4], sides[best, :4])
        same[best] = True
        free &= ~same
        # The cells around the best one know the sides as well: their mean is steadier.
        near = same & (np.abs(middles - middles[best]).max(axis=1) <= CELL_PX)
        weights = strength[near] ** 2
        left, top, right, bottom, *end = (weights @ sides[near] / weights.sum()).tolist()
        kind = list(VehicleKind)[int(np.argmax(kinds[:, near] @ weights))]
        box = ImageBox(left, top, right - left, bottom - top)
        found.append(VehicleBox(box, (end[0], end[1]), kind, float(strength[best])))
    return found


def _are_same(
    boxes: npt.NDArray[np.float32], one: npt.NDArray[np.float32]
) -> npt.NDArray[np.bool_]:
    """Whether boxes (n, 4) are of the same vehicle as one."""
    low, high = np.maximum(boxes[:, :2], one[:2]), np.minimum(boxes[:, 2:], one[2:])
    shared = np.prod(np.maximum(high - low, 0), axis=1)
    areas, area = np.prod(boxes[:, 2:] - boxes[:, :2], axis=1), np.prod(one[2:] - one[:2])
    smaller, larger = np.minimum(areas, area), np.maximum(areas, area)
    is_inside = (shared >= _MIN_INSIDE * smaller) & (smaller >= _MIN_RATIO * larger)
    return np.asarray(is_inside | (shared >= _MIN_OVERLAP * (areas + area - shared)))


def _scaled(vehicle: VehicleBox, factor: float, size: npt.NDArray[np.int_]) -> VehicleBox:
    """The vehicle in an image of another size, its box cut at the image's border."""
    width, height = (float(side) for side in size)
    box = vehicle.box
    left, right = (
        factor * min(max(x, 0.0), width / factor) for x in (box.x_px, box.x_px + box.w_px)
    )
    top, bottom = (
        factor * min(max(y, 0.0), height / factor) for y in (box.y_px, box.y_px + box.h_px)
    )
    end = vehicle.end_px and (factor * vehicle.end_px[0], factor * vehicle.end_px[1])
    return VehicleBox(
        ImageBox(left, top, right - left, bottom - top), end, vehicle.kind, vehicle.score
    )
