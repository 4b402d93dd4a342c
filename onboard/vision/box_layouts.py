"""What the outputs of the usual detectors mean: boxes in pixels of the input, and a score each.

`yolo` is YOLOv8 and its like, or YOLOv5 with `has_objectness`; `yolox` Ge et al. 2021; `nanodet`
NanoDet-Plus as its authors export it (Li et al. 2020, Generalized focal loss: the distance of a
side is the mean of a distribution over eight bins); `ssd` Liu et al. 2016, as the TensorFlow Object
Detection API exports it.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from onboard.vision.settings import BoxModelSettings

Floats = npt.NDArray[np.float32]
Outputs = Mapping[str, Floats]
"""The outputs of a network by name."""

_YOLOX_STRIDES, _NANODET_STRIDES = (8, 16, 32), (8, 16, 32, 64)
"""Sides of the cells, in pixels of the input."""
_BINS = 8
"""Of the distance of a side, in NanoDet."""
_NANODET_MEAN, _NANODET_SIGMA = (103.53, 116.28, 123.675), (57.375, 57.12, 58.395)
"""Of the levels of blue, green and red that NanoDet is trained with (those of ImageNet)."""
_SSD_OUTPUTS = ("detection_boxes", "detection_scores", "detection_classes")


class LayoutError(ValueError):
    """The outputs of a network are not of the layout; the text says what was expected."""


@dataclass(frozen=True, slots=True)
class Boxes:
    """Boxes in pixels of the network's input."""

    sides: Floats
    """(n, 4): left, top, width, height."""
    scores: Floats
    """(n,)"""


def network_input(
    image: npt.NDArray[np.uint8], settings: BoxModelSettings
) -> npt.NDArray[np.generic]:
    """The input of the layout for an (h, w, 3) BGR image of the settings' size."""
    match settings.layout:
        case "ssd":
            return np.ascontiguousarray(image[None, :, :, ::-1])
        case "nanodet":
            levels = (image.astype(np.float32) - _NANODET_MEAN) / _NANODET_SIGMA
            return np.ascontiguousarray(levels.transpose(2, 0, 1)[None], np.float32)
        case "yolox":
            return np.asarray(cv2.dnn.blobFromImage(image), np.float32)
        case "yolo":
            return np.asarray(cv2.dnn.blobFromImage(image, 1 / 255.0, swapRB=True), np.float32)


def boxes(outputs: Outputs, settings: BoxModelSettings) -> Boxes:
    """Boxes of the settings' classes, those that are no numbers left out.

    Raises:
        LayoutError: the outputs are not of the layout, or have not these classes.
    """
    found = _ssd(outputs, settings) if settings.layout == "ssd" else _of_rows(outputs, settings)
    are_numbers = np.isfinite(found.sides).all(axis=1) & np.isfinite(found.scores)
    return Boxes(found.sides[are_numbers], found.scores[are_numbers])


def _of_rows(outputs: Outputs, settings: BoxModelSettings) -> Boxes:
    output = next(iter(outputs.values()))
    rows = output[0] if output.ndim == 3 else np.zeros((0, 0), np.float32)
    if settings.layout == "nanodet":
        return _nanodet(rows, output.shape, settings)
    if rows.shape[1] > rows.shape[0]:
        rows = rows.T
    has_objectness = settings.has_objectness or settings.layout == "yolox"
    columns = [(5 if has_objectness else 4) + number for number in settings.classes]
    if rows.shape[1] <= max(columns):
        raise LayoutError(
            f"output of shape {output.shape}, but (1, rows, {max(columns) + 1} values or more) "
            "fits has_objectness and classes"
        )
    scores = rows[:, columns].max(axis=1)
    if has_objectness:
        scores = scores * rows[:, 4]
    if settings.layout == "yolox":
        rows = _yolox_pixels(rows, settings)
    sides = rows[:, 2:4]
    return Boxes(np.hstack([rows[:, :2] - sides / 2, sides]), scores)


def _yolox_pixels(rows: Floats, settings: BoxModelSettings) -> Floats:
    """Rows with centres and sides in input pixels."""
    cells = _cells(settings, _YOLOX_STRIDES, len(rows))
    pixels = rows.copy()
    pixels[:, :2] = rows[:, :2] * cells[:, 2:] + cells[:, :2]
    pixels[:, 2:4] = np.exp(np.minimum(rows[:, 2:4], 10.0)) * cells[:, 2:]
    return pixels


def _nanodet(rows: Floats, shape: tuple[int, ...], settings: BoxModelSettings) -> Boxes:
    classes = rows.shape[1] - 4 * _BINS
    if classes <= max(settings.classes):
        least = max(settings.classes) + 1 + 4 * _BINS
        raise LayoutError(f"output of shape {shape}, but (1, rows, {least} or more) fits classes")
    cells = _cells(settings, _NANODET_STRIDES, len(rows))
    bins = rows[:, classes:].reshape(-1, 4, _BINS)
    shares = np.exp(bins - bins.max(axis=2, keepdims=True))
    shares /= shares.sum(axis=2, keepdims=True)
    left, top, right, bottom = (shares @ np.arange(_BINS, dtype=np.float32) * cells[:, 2:]).T
    x, y = cells[:, 0], cells[:, 1]
    sides = np.stack([x - left, y - top, left + right, top + bottom], axis=1)
    return Boxes(sides, rows[:, list(settings.classes)].max(axis=1))


def _cells(settings: BoxModelSettings, strides: Sequence[int], rows: int) -> Floats:
    """(n, 3): x and y of the corner of each cell in pixels, and its side.

    Raises:
        LayoutError: there are not as many cells as rows.
    """
    width, height = settings.input_width_px, settings.input_height_px
    cells = [
        (x * side, y * side, side)
        for side in strides
        for y in range(-(-height // side))
        for x in range(-(-width // side))
    ]
    if len(cells) != rows:
        raise LayoutError(
            f"{settings.layout} has {len(cells)} rows for an input of {width} x {height} px, but "
            f"{settings.file} gives {rows}"
        )
    return np.asarray(cells, np.float32)


def _ssd(outputs: Outputs, settings: BoxModelSettings) -> Boxes:
    """Corners are shares of the sides, with y before x; classes count from 1."""
    named = {name.partition(":")[0]: values for name, values in outputs.items()}
    if not set(_SSD_OUTPUTS) <= set(named):
        raise LayoutError(
            f"outputs {', '.join(outputs)}, but {', '.join(_SSD_OUTPUTS)} are those of ssd"
        )
    corners, scores, classes = (named[name].squeeze(axis=0) for name in _SSD_OUTPUTS)
    if corners.shape != (len(scores), 4) or scores.shape != classes.shape:
        shapes = ", ".join(str(named[name].shape) for name in _SSD_OUTPUTS)
        raise LayoutError(
            f"outputs of shapes {shapes}, but (1, n, 4), (1, n), (1, n) are those of ssd"
        )
    size = settings.input_width_px, settings.input_height_px
    low, high = corners[:, [1, 0]] * size, corners[:, [3, 2]] * size
    counts = np.isin(classes, settings.classes)
    sides = np.hstack([low, high - low]).astype(np.float32)
    return Boxes(sides[counts], scores[counts])
