"""Checks of a frame before it is searched.

Corrupt, blank, upside down, over-exposed, repeated, after a cut.
"""

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
SKY_LEVEL, SKY_STEP, DAY_LEVEL = 100.0, 40.0, 80.0
"""Least grey levels of a lowest quarter that is sky, by itself and over the highest quarter, and
least mean of a frame by day: headlights also light what is below."""
UPSIDE_DOWN_FRAMES = 300
"""Successive frames with the sky below after which the camera is upside down: on a bright road
under trees, single ones look so."""
CLIPPED_LEVEL, HIDING_SHARE, BLINDING_SHARE = 250, 0.25, 0.6
"""Grey level of all colours from which a sample is clipped, and the shares of these on the road
from which vehicles may be hidden, and nothing is told. Clips and photographs have at most 0.12;
with twice the light 0.41, with which leads are found, with four times mostly 0.6 and more."""
OVER_EXPOSED_FRAMES = 45
"""Successive frames after which nothing is told by them (3 s at 15 a second): at the end of a
tunnel, a camera is dazzled for a moment."""
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
    UPSIDE_DOWN = "upside_down_frame"
    OVER_EXPOSED = "over_exposed_frame"


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
    may_hide_vehicles: bool = False
    """A lane without any is not known to be free: it looks upside down, or is over-exposed."""
    is_over_exposed: bool = False


class FrameCheck:
    """Checks each frame, and compares it with the one before."""

    def __init__(self) -> None:
        self._last: npt.NDArray[np.uint8] | None = None
        self._with_sky_below = self._over_exposed = 0
        """Successive frames."""

    def check(self, image: Image) -> FrameVerdict:
        """Check one frame; an empty array is one that did not decode."""
        if image.ndim != 3 or image.shape[2] != 3 or min(image.shape) == 0:
            return FrameVerdict(FrameFault.CORRUPT, f"no image, array of shape {image.shape}")
        sample = image[::_STRIDE, ::_STRIDE].copy()
        last, self._last = self._last, sample
        spread = _spread(sample)
        if spread < BLANK_SIGMA:
            return FrameVerdict(FrameFault.BLANK, f"mean {sample.mean():.0f}, sigma {spread:.1f}")
        has_sky_below = _has_sky_below(sample)
        self._with_sky_below = self._with_sky_below + 1 if has_sky_below else 0
        if self._with_sky_below > UPSIDE_DOWN_FRAMES:
            return FrameVerdict(FrameFault.UPSIDE_DOWN, "the sky is below: turn the camera over")
        clipped = _clipped_share(sample)
        self._over_exposed = self._over_exposed + 1 if clipped >= BLINDING_SHARE else 0
        if self._over_exposed > OVER_EXPOSED_FRAMES:
            return FrameVerdict(FrameFault.OVER_EXPOSED, f"{clipped:.0%} of the road is white")
        is_same_size = last is not None and sample.shape == last.shape
        if last is not None and is_same_size and _is_repeat(sample, last):
            return FrameVerdict(is_repeat=True)
        is_cut = last is not None and (
            not is_same_size or _correlation(sample, last) < CUT_CORRELATION
        )
        is_over_exposed = clipped >= HIDING_SHARE
        return FrameVerdict(
            is_cut=is_cut,
            may_hide_vehicles=has_sky_below or is_over_exposed,
            is_over_exposed=is_over_exposed,
        )


def _spread(sample: Image) -> float:
    """Standard deviation over the frame, of the colour that has most; noise is averaged out.

    A covered lens gives dark noise, and a cable without a signal a blue frame.
    """
    rows, columns = (max(side // _COARSE, _MIN_COARSE) for side in sample.shape[:2])
    coarse = cv2.resize(sample, (columns, rows), interpolation=cv2.INTER_AREA)
    return float(cv2.meanStdDev(coarse)[1].max())


def _has_sky_below(sample: Image) -> bool:
    quarter = max(1, len(sample) // 4)
    above, below, level = (_mean(each) for each in (sample[:quarter], sample[-quarter:], sample))
    is_day = level >= DAY_LEVEL
    return is_day and below >= max(SKY_LEVEL, above + SKY_STEP)


def _mean(image: Image) -> float:
    return sum(cv2.mean(image)[:3]) / 3


def _clipped_share(sample: Image) -> float:
    """Share of the road, which is in the lower half, that is white and shows nothing."""
    rows = len(sample)
    road = sample[rows // 2 : rows - round(_RIM * rows)]
    clipped = cv2.inRange(road, (CLIPPED_LEVEL,) * 3, (255,) * 3)
    return cv2.countNonZero(clipped) / clipped.size


def _is_repeat(sample: Image, last: Image) -> bool:
    rim = round(_RIM * len(sample))
    road, before = (each[rim : len(each) - rim] for each in (sample, last))
    odd = np.count_nonzero(np.maximum.reduce(cv2.split(cv2.absdiff(road, before))))
    return bool(odd <= math.ceil(MAX_ODD * road[..., 0].size))


def _correlation(one: Image, other: Image) -> float:
    """Pearson's correlation of the green channels."""
    first, second = (np.asarray(sample[..., 1], np.float32).ravel() for sample in (one, other))
    first -= first.mean()
    second -= second.mean()
    return float(first @ second / (np.sqrt((first @ first) * (second @ second)) + 1e-6))
