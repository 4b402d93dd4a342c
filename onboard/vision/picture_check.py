"""Whether a picture is one of the road at all, before anybody looks for cars in it."""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
import numpy.typing as npt

Image = npt.NDArray[np.uint8]
"""(h, w, 3), BGR."""

_STRIDE = 8
"""Each eighth pixel of each eighth row speaks for the picture."""
BLANK_SIGMA = 2.0
"""In grey levels; pictures by night, of the road with lamps, have 10 and more."""
CUT_CORRELATION = 0.4
"""Two frames in a row correlate by less where a film is cut; light does not change this."""


class Fault(StrEnum):
    """Why a picture is not looked at."""

    CORRUPT = "corrupt_picture"
    BLANK = "blank_picture"


@dataclass(frozen=True, slots=True)
class Verdict:
    """What the check found."""

    fault: Fault | None = None
    detail: str = ""
    is_repeat: bool = False
    """The very same picture as the last: no sensor gives that twice."""
    is_cut: bool = False
    """The picture before showed another place."""


class PictureCheck:
    """Looks at each picture, and compares it with the one before."""

    def __init__(self) -> None:
        self._last: npt.NDArray[np.uint8] | None = None

    def look(self, image: Image) -> Verdict:
        """Judge one picture."""
        if image.ndim != 3 or image.shape[2] != 3 or min(image.shape) == 0:
            return Verdict(Fault.CORRUPT, f"no picture, array of shape {image.shape}")
        sample = image[::_STRIDE, ::_STRIDE].copy()
        last, self._last = self._last, sample
        spread = float(sample.std())
        if spread < BLANK_SIGMA:
            return Verdict(Fault.BLANK, f"mean {sample.mean():.0f}, sigma {spread:.1f}")
        if last is None:
            return Verdict()
        if sample.shape != last.shape:
            return Verdict(is_cut=True)
        if np.array_equal(sample, last):
            return Verdict(is_repeat=True)
        return Verdict(is_cut=_correlation(sample, last) < CUT_CORRELATION)


def _correlation(one: Image, other: Image) -> float:
    """Pearson's, of the green channels."""
    first, second = (np.asarray(sample[..., 1], np.float32) for sample in (one, other))
    first -= first.mean()
    second -= second.mean()
    return float((first * second).mean() / (first.std() * second.std() + 1e-6))
