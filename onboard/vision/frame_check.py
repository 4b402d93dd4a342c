"""Whether a picture is one of the road at all, before anybody looks for cars in it."""

import math
from dataclasses import dataclass
from enum import StrEnum

import cv2
import numpy as np
import numpy.typing as npt

Image = npt.NDArray[np.uint8]
"""(h, w, 3), BGR."""

_STRIDE = 8
"""Each eighth pixel of each eighth row speaks for the picture."""
_COARSE, _LEAST_COARSE = 5, 4
"""So many of those each way are averaged for what is to be seen, and so many are left at least."""
BLANK_SIGMA = 2.0
"""In grey levels, of one colour, without the sensor's noise; pictures by night, of the road with
lamps, have 7 and more."""
_RIM = 1 / 8
"""Of the picture's height, above and below: there cameras write the time."""
MOST_ODD = 0.0005
"""Share of a frozen picture's pixels that may differ all the same, such as a noisy one."""
CUT_CORRELATION = 0.4
"""Two frames in a row correlate by less where a film is cut; light does not change this."""


class Fault(StrEnum):
    """Why a picture is not looked at."""

    CORRUPT = "corrupt_picture"
    BLANK = "blank_picture"


@dataclass(frozen=True, slots=True)
class FrameVerdict:
    """What the check found."""

    fault: Fault | None = None
    detail: str = ""
    is_repeat: bool = False
    """The same picture as the last, to the bit, but for the time in its rim and an odd pixel or
    two: no sensor gives that twice."""
    is_cut: bool = False
    """The picture before showed another place."""


class PictureCheck:
    """Looks at each picture, and compares it with the one before."""

    def __init__(self) -> None:
        self._last: npt.NDArray[np.uint8] | None = None

    def look(self, image: Image) -> FrameVerdict:
        """Judge one picture."""
        if image.ndim != 3 or image.shape[2] != 3 or min(image.shape) == 0:
            return FrameVerdict(Fault.CORRUPT, f"no picture, array of shape {image.shape}")
        sample = image[::_STRIDE, ::_STRIDE].copy()
        last, self._last = self._last, sample
        spread = _spread(sample)
        if spread < BLANK_SIGMA:
            return FrameVerdict(Fault.BLANK, f"mean {sample.mean():.0f}, sigma {spread:.1f}")
        if last is None:
            return FrameVerdict()
        if sample.shape != last.shape:
            return FrameVerdict(is_cut=True)
        if _is_repeat(sample, last):
            return FrameVerdict(is_repeat=True)
        return FrameVerdict(is_cut=_correlation(sample, last) < CUT_CORRELATION)


def _spread(sample: Image) -> float:
    """Standard deviation over the picture, of the colour that has most; noise is averaged away.

    A covered lens gives dark noise, and a wire without a signal a blue picture.
    """
    rows, columns = (max(side // _COARSE, _LEAST_COARSE) for side in sample.shape[:2])
    coarse = cv2.resize(sample, (columns, rows), interpolation=cv2.INTER_AREA)
    return float(np.std(coarse, axis=(0, 1)).max())


def _is_repeat(sample: Image, last: Image) -> bool:
    rim = round(_RIM * len(sample))
    road, before = (each[rim : len(each) - rim] for each in (sample, last))
    odd = np.count_nonzero((road != before).any(axis=2))
    return bool(odd <= math.ceil(MOST_ODD * road[..., 0].size))


def _correlation(one: Image, other: Image) -> float:
    """Pearson's, of the green channels."""
    first, second = (np.asarray(sample[..., 1], np.float32) for sample in (one, other))
    first -= first.mean()
    second -= second.mean()
    return float((first * second).mean() / (first.std() * second.std() + 1e-6))
