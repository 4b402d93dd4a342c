"""Checks of a frame before it is searched: corrupt, blank, repeated, or the first after a cut."""

import math
from dataclasses import dataclass
from enum import StrEnum

import cv2
import numpy as np
import numpy.typing as npt

Image = npt.NDArray[np.uint8]
"""(h, w, 3), BGR."""

_STRIDE = 8
"""Only each eighth pixel of each eighth row is examined."""
_COARSE, _MIN_COARSE = 5, 4
"""Samples that are averaged each way to remove noise, and the least number left."""
BLANK_SIGMA = 2.0
"""Sigma of a blank frame in grey levels, of one colour, without the sensor's noise; frames by
night, of the road with lamps, have 7 and more."""
_RIM = 1 / 8
"""Share of the height at top and bottom that is ignored: cameras write the time there."""
MAX_ODD = 0.0005
"""Share of a repeated frame's pixels that may differ, such as noisy ones."""
CUT_CORRELATION = 0.4
"""Correlation of two successive frames below which there is a cut; light does not change it."""


class FrameFault(StrEnum):
    """Reasons to discard a frame."""

    CORRUPT = "corrupt_frame"
    BLANK = "blank_frame"


@dataclass(frozen=True, slots=True)
class FrameVerdict:
    """Result of the check."""

    fault: FrameFault | None = None
    detail: str = ""
    is_repeat: bool = False
    """Equal to the frame before, but for its rim and single pixels: no sensor delivers that
    twice."""
    is_cut: bool = False
    """The frame before showed another scene."""


class FrameCheck:
    """Checks each frame, and compares it with the one before."""

    def __init__(self) -> None:
        self._last: npt.NDArray[np.uint8] | None = None

    def check(self, image: Image) -> FrameVerdict:
        """Check one frame; an empty array is one that did not decode."""
        if image.ndim != 3 or image.shape[2] != 3 or min(image.shape) == 0:
            return FrameVerdict(FrameFault.CORRUPT, f"no image, array of shape {image.shape}")
        sample = image[::_STRIDE, ::_STRIDE].copy()
        last, self._last = self._last, sample
        spread = _spread(sample)
        if spread < BLANK_SIGMA:
            return FrameVerdict(FrameFault.BLANK, f"mean {sample.mean():.0f}, sigma {spread:.1f}")
        if last is None:
            return FrameVerdict()
        if sample.shape != last.shape:
            return FrameVerdict(is_cut=True)
        if _is_repeat(sample, last):
            return FrameVerdict(is_repeat=True)
        return FrameVerdict(is_cut=_correlation(sample, last) < CUT_CORRELATION)


def _spread(sample: Image) -> float:
    """Standard deviation over the frame, of the colour that has most; noise is averaged out.

    A covered lens gives dark noise, and a cable without a signal a blue frame.
    """
    rows, columns = (max(side // _COARSE, _MIN_COARSE) for side in sample.shape[:2])
    coarse = cv2.resize(sample, (columns, rows), interpolation=cv2.INTER_AREA)
    return float(np.std(coarse, axis=(0, 1)).max())


def _is_repeat(sample: Image, last: Image) -> bool:
    rim = round(_RIM * len(sample))
    road, before = (each[rim : len(each) - rim] for each in (sample, last))
    odd = np.count_nonzero((road != before).any(axis=2))
    return bool(odd <= math.ceil(MAX_ODD * road[..., 0].size))


def _correlation(one: Image, other: Image) -> float:
    """Pearson's correlation of the green channels."""
    first, second = (np.asarray(sample[..., 1], np.float32) for sample in (one, other))
    first -= first.mean()
    second -= second.mean()
    return float((first * second).mean() / (first.std() * second.std() + 1e-6))
