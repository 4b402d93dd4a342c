"""Detection of plates in an image: four corners and a score each.

A small convolutional network runs on the image at a few scales. For each cell of 8 x 8 pixels it
gives a score that the cell is in the middle of a plate, and the offsets of that plate's corners.
Cells of the same plate are merged. A second network refines each candidate, scaled so that the
plate is 84 to 96 pixels wide: its corners are more accurate, and false candidates are dropped. Both
were trained on rendered images only (`training/`).
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt

from onboard.observations import ImageBox
from onboard.vision.network import Network

Image = npt.NDArray[np.uint8]
"""(h, w, 3) BGR or (h, w) grey."""
Corners = npt.NDArray[np.float32]
"""(4, 2): top left, top right, bottom right, bottom left, in pixels from the outer corner of the
top left one."""

CELL_PX = 8
"""Side of a cell of the network's output, in pixels of its input."""
CORNER_UNIT_PX = 32.0
"""Unit of the network's corner offsets, which count from the middle of the cell."""
WIDTHS_PX = (12.0, 130.0)
"""Widths of plates that the network finds at one scale of the image."""
LEAST_SCORE, LEAST_SCORE_AGAIN = 0.5, 0.3
"""Scores from which a plate is reported, and from which a plate of the frame before is found again.
Of photographs with plates of 36 px, 97 % have the first, and 99 % the second."""
DEFAULT_MODEL = Path(__file__).parent / "models" / "plate_detector.onnx"
CORNERS_MODEL = DEFAULT_MODEL.with_name("plate_corners.onnx")
"""The network that refines candidates."""

_SHRINKS = (1.0, 2.0, 8.0)
"""Factors by which the image is reduced for the first network: plates up to 1000 px wide."""
SEARCHED_PX, _FINE_PLATES_PX = 260_000, (20.0, 64.0)
"""Pixels in which an image is searched at full and at half its size together, if half of it has
no more, and the widths of plates for which it is at full size. Narrower ones cannot be read. Wider
ones are high enough at half the size, where narrow European ones are lost."""
_REFINED_VIEW_SIZE = (192, 96)
_REFINED_PLATE_PX = (84.0, 96.0)
"""Smaller plates are enlarged to the first of these widths, larger ones reduced to the second."""
_CUT_PX, _CUT_SHARE = 4.0, 0.5
"""Distance to the border of what a network gets within which a plate may be cut by it, and a factor
for the score of one that is: at half the size, the whole plate then comes first."""
_MAX_CANDIDATES = 8
_MIN_UNSURE_PX = 32.0
"""Least width of a candidate with a low score: a narrower one could hardly be read."""


@dataclass(frozen=True, slots=True, eq=False)
class PlateDetection:
    """A plate in the image."""

    corners_px: Corners
    score: float
    """Score that it is a plate, 0 to 1."""

    @property
    def box(self) -> ImageBox:
        """The upright rectangle around its corners."""
        columns, rows = self.corners_px.T.tolist()
        left, top = min(columns), min(rows)
        return ImageBox(left, top, max(columns) - left, max(rows) - top)

    @property
    def width_px(self) -> float:
        """Mean length of its upper and lower edge."""
        upper = self.corners_px[1] - self.corners_px[0]
        lower = self.corners_px[2] - self.corners_px[3]
        return float(np.hypot(*upper) + np.hypot(*lower)) / 2


class PlateDetector:
    """Both networks, loaded once; not to be shared between threads."""

    def __init__(
        self,
        model: Path = DEFAULT_MODEL,
        corners_model: Path = CORNERS_MODEL,
        *,
        least_score: float = LEAST_SCORE,
    ) -> None:
        """Load the networks.

        Args:
            model: ONNX file that finds candidates.
            corners_model: ONNX file that refines them.
            least_score: of a plate that is reported.

        Raises:
            FileNotFoundError: a file is missing.
        """
        self._candidate_network = Network(model)
        self._refining_network = Network(corners_model)
        self._least_score = least_score

    def find(self, image: Image, region: ImageBox | None = None) -> list[PlateDetection]:
        """Plates in the image, or in `region` of it, highest score first."""
        part, origin = _cut(image, region)
        if min(part.shape[:2]) < CELL_PX:
            return []
        grey = part if part.ndim == 2 else cv2.cvtColor(part, cv2.COLOR_BGR2GRAY).astype(np.uint8)
        firsts = _without_overlaps(self._candidates(grey))[:_MAX_CANDIDATES]
        seconds = _without_overlaps(self._refined(grey, first) for first in firsts)
        return [
            PlateDetection(found.corners_px + origin, found.score)
            for found in seconds
            if found.score >= self._least_score
        ]

    def _candidates(self, grey: Image) -> Iterator[PlateDetection]:
        """Candidates of the first network, at each scale of the image."""
        # Least scores with which the final score can reach `least_score`: if the second network is
        # certain, and if it is as sure as the first.
        least, sure = self._least_score**3, self._least_score**2
        least_px, most_px = _FINE_PLATES_PX
        for shrink in _SHRINKS:
            is_fine = shrink == min(_SHRINKS)
            height, width = grey.shape
            left, top, right, bottom = (
                fine_part(width, height) if is_fine else (0, 0, width, height)
            )
            part = grey[top:bottom, left:right]
            size = (round(part.shape[1] / shrink), round(part.shape[0] / shrink))
            if min(size) < CELL_PX:
                continue
            view = cv2.resize(part, size, interpolation=cv2.INTER_AREA)
            scale = np.asarray([part.shape[1] / size[0], part.shape[0] / size[1]], np.float32)
            for found in _run(self._candidate_network, np.asarray(view, np.uint8), least, sure):
                if is_fine and not least_px <= found.width_px < most_px:
                    continue
                plate = PlateDetection(found.corners_px * scale + (left, top), found.score)
                if is_fine and _is_cut(plate.box, left, top, right, bottom):
                    plate = replace(plate, score=_CUT_SHARE * plate.score)
                if plate.score >= sure or plate.width_px >= _MIN_UNSURE_PX:
                    yield plate

    def find_again(self, image: Image, last: Corners) -> PlateDetection | None:
        """The plate that was at `last` in the frame before, by one run: several times cheaper.

        It is found within about half its width of `last`; one that is farther, of which the view
        may have a part only, is not.
        """
        middle, reach = last.mean(axis=0), 1.5 * float(np.ptp(last[:, 0])) + CELL_PX
        left, top = (float(value) for value in middle - reach)
        part, origin = _cut(image, ImageBox(left, top, 2 * reach, 2 * reach))
        if min(part.shape[:2]) < CELL_PX:
            return None
        grey = part if part.ndim == 2 else np.asarray(cv2.cvtColor(part, cv2.COLOR_BGR2GRAY))
        first = PlateDetection(last - origin, 1.0)
        found = self._refined(np.asarray(grey, np.uint8), first)
        aside_px = found.corners_px[:, 0] - first.corners_px[:, 0].mean()
        across_px = _REFINED_VIEW_SIZE[0] / 2 + _refined_scale(first.width_px) * aside_px
        is_whole = _is_between(across_px.min(), across_px.max(), 0, _REFINED_VIEW_SIZE[0])
        if not is_whole or found.score < min(LEAST_SCORE_AGAIN, self._least_score):
            return None
        return PlateDetection(found.corners_px + origin, found.score)

    def _refined(self, grey: Image, first: PlateDetection) -> PlateDetection:
        """Refine a candidate, in a view centred on it with the plate 84 to 96 px wide.

        The score is the geometric mean of both networks'. Where the second one's is higher, it
        counts twice: it gets a small plate at the size at which networks are best.
        """
        scale = _refined_scale(first.width_px)
        middle = first.corners_px.mean(axis=0)
        width, height = _REFINED_VIEW_SIZE
        if scale < 0.7:
            # Averages first: sparse sampling of a large plate would alias.
            size = (max(2, round(grey.shape[1] * scale)), max(2, round(grey.shape[0] * scale)))
            shrunk = np.asarray([size[0] / grey.shape[1], size[1] / grey.shape[0]], np.float32)
            small = np.asarray(cv2.resize(grey, size, interpolation=cv2.INTER_AREA), np.uint8)
            found = self._refined(small, PlateDetection(first.corners_px * shrunk, first.score))
            return PlateDetection(found.corners_px / shrunk, found.score)
        shift = np.asarray([width / 2, height / 2]) - scale * middle
        # OpenCV warps between the middles of pixels.
        inner = shift + (scale - 1) / 2
        matrix = np.asarray([[scale, 0, inner[0]], [0, scale, inner[1]]])
        view = cv2.warpAffine(grey, matrix, (width, height), borderMode=cv2.BORDER_REPLICATE)
        found_again = _run(self._refining_network, np.asarray(view, np.uint8), 0.05, 0.05)
        if not found_again:
            return PlateDetection(first.corners_px, 0.0)
        centre = np.asarray([width / 2, height / 2])
        # The plate of the candidate is the one in the middle.
        best = max(
            found_again,
            key=lambda found: (
                found.score
                - np.hypot(*(found.corners_px.mean(axis=0) - centre)) / _REFINED_PLATE_PX[0]
            ),
        )
        corners = (best.corners_px - shift.astype(np.float32)) / np.float32(scale)
        both = best.score * first.score
        return PlateDetection(corners, max(both ** (1 / 2), (both * best.score) ** (1 / 3)))


def _refined_scale(width_px: float) -> float:
    """Pixels of the refining view for one of an image with a plate that is so wide."""
    width_px = max(width_px, 4.0)
    return float(np.clip(width_px, *_REFINED_PLATE_PX)) / width_px


def fine_part(width_px: int, height_px: int) -> tuple[int, int, int, int]:
    """Left, top, right and bottom of the part that is searched at full size: the middle.

    With half the size it has `SEARCHED_PX`, so that the cost of a search has no steps: it is all of
    a small image, and nothing of a large one.
    """
    spare = SEARCHED_PX / (width_px * height_px) - 1 / 4
    share = min(1.0, max(0.0, spare)) ** 0.5
    across, down = (
        CELL_PX * round((1.0 - share) * px / 2 / CELL_PX) for px in (width_px, height_px)
    )
    return across, down, width_px - across, height_px - down


def _is_cut(box: ImageBox, left: int, top: int, right: int, bottom: int) -> bool:
    """Whether the border of this part of an image may cut the box; the image's own is at 0."""
    is_inside = (left == 0 or _is_between(box.x_px, box.x_px + box.w_px, left, right)) and (
        top == 0 or _is_between(box.y_px, box.y_px + box.h_px, top, bottom)
    )
    return not is_inside


def _is_between(low: float, high: float, first: int, last: int) -> bool:
    """Whether what spans these pixels is not cut by the borders of what a network gets."""
    return first + _CUT_PX <= low and high <= last - _CUT_PX


def _run(network: Network, grey: Image, least: float, sure: float) -> list[PlateDetection]:
    """Run a network on a grey view.

    Args:
        network: for candidates or for refining.
        grey: (h, w) view.
        least: score of a plate.
        sure: score of a cell that counts in the corners of a plate with a higher score.
    """
    rows, columns = (-(-side // CELL_PX) * CELL_PX for side in grey.shape)
    padded = cv2.copyMakeBorder(
        grey, 0, rows - grey.shape[0], 0, columns - grey.shape[1], cv2.BORDER_REPLICATE
    )
    answer = network.run_one(as_input(np.asarray(padded, np.uint8)[None]))[0]
    scores = 1 / (1 + np.exp(-answer[0]))
    return _merged(scores, answer[1:], least, sure)


def as_input(grey: npt.NDArray[np.uint8]) -> npt.NDArray[np.float32]:
    """Convert (n, h, w) grey images to the network's input (n, 1, h, w).

    Levels become logarithms, so that light only shifts them.
    """
    values = cv2.LUT(grey.reshape(-1, grey.shape[-1]), _LOGARITHM)
    return np.asarray(values, np.float32).reshape(len(grey), 1, *grey.shape[1:])


_LOGARITHM = ((np.log(np.arange(256) + 10.0) - 4.3) / 0.9).astype(np.float32)


def _cut(image: Image, region: ImageBox | None) -> tuple[Image, npt.NDArray[np.float32]]:
    if region is None:
        return image, np.zeros(2, np.float32)
    left, top = max(0, int(region.x_px)), max(0, int(region.y_px))
    right, bottom = int(region.x_px + region.w_px + 1), int(region.y_px + region.h_px + 1)
    part = image[top : max(top, bottom), left : max(left, right)]
    return part, np.asarray([left, top], np.float32)


def _merged(
    scores: npt.NDArray[np.float32], offsets: npt.NDArray[np.float32], least: float, sure: float
) -> list[PlateDetection]:
    """Merge cells to plates: each best cell absorbs the cells of the same plate."""
    rows, columns = np.nonzero(scores >= least)
    if not len(rows):
        return []
    strength = scores[rows, columns]
    order = np.argsort(-strength)[:400]
    rows, columns, strength = rows[order], columns[order], strength[order]
    middles = np.stack([columns, rows], axis=1) * CELL_PX + (CELL_PX - 1) / 2
    corners = offsets[:, rows, columns].T.reshape(-1, 4, 2) * CORNER_UNIT_PX + middles[:, None]
    centres, (widths, heights) = corners.mean(axis=1), np.ptp(corners, axis=1).T
    plates: list[PlateDetection] = []
    free = np.ones(len(rows), bool)
    while free.any():
        best = int(free.argmax())
        away = np.abs(centres - centres[best])
        same = free & (away[:, 0] < 0.5 * widths[best]) & (away[:, 1] < 0.6 * heights[best])
        same[best] = True
        free &= ~same
        same &= strength >= min(sure, strength[best])
        weights = (strength[same] ** 2).astype(np.float64)
        mean = (corners[same] * weights[:, None, None]).sum(axis=0) / weights.sum()
        plates.append(PlateDetection(mean.astype(np.float32), float(strength[best])))
    return plates


def _without_overlaps(found: Iterable[PlateDetection]) -> list[PlateDetection]:
    """The best of each set of overlapping plates, highest score first."""
    kept: list[tuple[PlateDetection, ImageBox]] = []
    for plate in sorted(found, key=lambda plate: -plate.score):
        box = plate.box
        if all(_overlap(box, other) < 0.3 for _, other in kept):
            kept.append((plate, box))
    return [plate for plate, _ in kept]


def _overlap(one: ImageBox, other: ImageBox) -> float:
    """Intersection over the smaller of the two."""
    width = min(one.x_px + one.w_px, other.x_px + other.w_px) - max(one.x_px, other.x_px)
    height = min(one.y_px + one.h_px, other.y_px + other.h_px) - max(one.y_px, other.y_px)
    if width <= 0 or height <= 0:
        return 0.0
    return width * height / max(1e-6, min(one.w_px * one.h_px, other.w_px * other.h_px))
