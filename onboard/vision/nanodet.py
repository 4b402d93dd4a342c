"""Vehicles in an image, by a network that has seen photographs: NanoDet-g (Lyu 2020), from COCO.

The image is scaled to `AREA_PX`. For each cell of 8, 16 and 32 pixels, the network gives a logit of
each class, and a distribution over the distance of each side from the cell's middle (Li et al.
2020, Generalized focal loss). `models/NOTICE` says where its weights come from.
"""

import math
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt

from onboard.observations import ImageBox
from onboard.vision.network import Network
from onboard.vision.vehicle_network import LEAST_SCORE, VehicleBox, VehicleKind

DEFAULT_MODEL = Path(__file__).parent / "models" / "nanodet.onnx"
AREA_PX = 307_200
"""Pixels of the network's input: 736 x 416 of a frame of 16:9."""
CLASSES = {
    2: VehicleKind.CAR,
    3: VehicleKind.MOTORCYCLE,
    5: VehicleKind.BUS,
    7: VehicleKind.TRUCK,
}
"""Numbers in COCO, in the order of the network's output."""
BINS = 11
"""Of the distance of a side, in cells."""
_CELLS_PX = (8, 16, 32)
_MEAN, _SIGMA = (103.53, 116.28, 123.675), (57.375, 57.12, 58.395)
"""Of the levels of blue, green and red that it is trained with (those of ImageNet)."""
_GREY = (114, 114, 114)
_MIN_OVERLAP = 0.5
"""Intersection over union from which two boxes are one vehicle."""

Floats = npt.NDArray[np.float32]


class NanoDet:
    """The network, loaded once; not to be shared between threads."""

    def __init__(self, *, least_score: float = LEAST_SCORE) -> None:
        """Load the network.

        Args:
            least_score: of a vehicle that is reported.
        """
        self._network = Network(DEFAULT_MODEL)
        self._least_score = least_score

    def find(self, image: npt.NDArray[np.uint8], scale: float | None = None) -> list[VehicleBox]:
        """Vehicles in an image, highest score first; their rears are not known.

        Args:
            image: (h, w, 3), BGR.
            scale: that of the network's input to the image; `None` is that of a whole one.
        """
        height, width = image.shape[:2]
        scale = scale or input_scale(width, height)
        size = max(1, round(scale * width)), max(1, round(scale * height))
        way = cv2.INTER_AREA if scale < 1 else cv2.INTER_LINEAR
        view = cv2.resize(image, size, interpolation=way)
        columns, rows = (-(-side // _CELLS_PX[-1]) * _CELLS_PX[-1] for side in size)
        rims = 0, rows - size[1], 0, columns - size[0]
        view = cv2.copyMakeBorder(view, *rims, cv2.BORDER_CONSTANT, value=_GREY)
        answer = self._network.run_one(as_input(np.asarray(view, np.uint8)))[0]
        boxes, scores, kinds = _decoded(answer, (columns, rows), self._least_score)
        boxes = np.clip(boxes / scale, 0, [width, height, width, height])
        sides = np.hstack([boxes[:, :2], boxes[:, 2:] - boxes[:, :2]])
        kept = cv2.dnn.NMSBoxes(sides.tolist(), scores.tolist(), self._least_score, _MIN_OVERLAP)
        return [
            VehicleBox(ImageBox(*map(float, sides[at])), None, kinds[at], float(scores[at]))
            for at in kept
        ]


def input_size(width_px: int, height_px: int) -> tuple[int, int]:
    """Width and height of the network's input for an image, multiples of the largest cell."""
    largest, shape = _CELLS_PX[-1], width_px / height_px
    columns = max(1, round(math.sqrt(AREA_PX * shape) / largest))
    return largest * columns, largest * max(1, round(columns / shape))


def input_scale(width_px: int, height_px: int) -> float:
    """Scale of the network's input to an image."""
    columns, rows = input_size(width_px, height_px)
    return min(columns / width_px, rows / height_px)


def as_input(image: npt.NDArray[np.uint8]) -> Floats:
    """Convert an (h, w, 3) BGR image to the network's input (1, 3, h, w)."""
    pairs = zip(cv2.split(image), _NORMALISED, strict=True)
    return np.asarray([[cv2.LUT(levels, values) for levels, values in pairs]], np.float32)


_NORMALISED = [
    (np.arange(256, dtype=np.float32) - np.float32(mean)) / np.float32(sigma)
    for mean, sigma in zip(_MEAN, _SIGMA, strict=True)
]
"""The network's input for each level of blue, green and red."""


def _decoded(
    answer: Floats, size_px: tuple[int, int], least_score: float
) -> tuple[Floats, Floats, list[VehicleKind]]:
    """Left, top, right, bottom (n, 4), scores (n,) and kinds of what is likely a vehicle.

    Args:
        answer: (cells, classes + 4 bins).
        size_px: of the input.
        least_score: of a vehicle that is reported.
    """
    logits = answer[:, : len(CLASSES)]
    is_likely = logits.max(axis=1) >= math.log(least_score / (1 - least_score))
    logits, bins = logits[is_likely], answer[is_likely, len(CLASSES) :].reshape(-1, 4, BINS)
    shares = np.exp(bins - bins.max(axis=2, keepdims=True))
    shares /= shares.sum(axis=2, keepdims=True)
    middles, cells_px = _cells(*size_px)
    middles, cells_px = middles[is_likely], cells_px[is_likely, None]
    reach = shares @ np.arange(BINS, dtype=np.float32) * cells_px
    boxes = np.hstack([middles - reach[:, :2], middles + reach[:, 2:]])
    kinds = [list(CLASSES.values())[number] for number in logits.argmax(axis=1)]
    return boxes, 1 / (1 + np.exp(-logits.max(axis=1))), kinds


def _cells(width_px: int, height_px: int) -> tuple[Floats, Floats]:
    """Middles (n, 2) and sides (n,) of the cells, row by row from the smallest ones."""
    middles, sides = [], []
    for cell_px in _CELLS_PX:
        rows, columns = np.mgrid[: height_px // cell_px, : width_px // cell_px] + 0.5
        middles.append(np.stack([columns, rows], axis=-1).reshape(-1, 2) * cell_px)
        sides.append(np.full(rows.size, cell_px))
    return np.concatenate(middles).astype(np.float32), np.concatenate(sides).astype(np.float32)
