"""The width of a plate by its format: from its shape, and from a blue band if it has one.

The measured ratio of width to height is off by a tenth in one frame, and formats are a quarter
apart: the format of single frames would now and then place a vehicle a quarter nearer than it is.
So the format of a track uses all its detections and a prior: the formats of the other vehicles of
this drive. The track's own detections are left out of that prior.
"""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

PLATE_FORMATS = (
    (0.520, 4.6, 4),
    (0.400, 3.25, 4),
    (0.305, 2.1, 4),
    (0.280, 1.5, 1),
    (0.200, 1.2, 1),
)
"""Width in m; width by height as the detector finds it in photographs; prior count. Europe (520
x 110 mm), Brazil (400 x 130), North America (305 x 152, SAE J686), Europe in two rows,
motorcycles."""
SHAPE_SIGMA = 0.12
"""Sigma of the logarithm of a detected plate's width by height, at any size: 0.08 to 0.18 in
photographs scaled down to plates of 95 to 27 px. All detections of one plate share this error."""
SMALL_SIGMA, SMALL_PX = 0.02, 80.0
"""Further sigma at this width in pixels; it falls with the square of the width: at low contrast, as
on light vehicles, plates of 30 px are detected too high."""
BANDED_WIDTH_M, BAND_LIKELIHOOD_RATIO = 0.520, 5.0
"""Width of the format with a blue band at its left end, and the likelihood ratio of a detected
band: 40 % of European plates in photographs have one, of the others 8 %, scaled down or not."""
SWITCH_RATIO = 2.0
"""Factor by which another format must be likelier than the track's before it replaces it."""
MAX_COUNTED, MIN_COUNTED_PROBABILITY = 20, 0.8
"""Detections of one track that count for the prior of this drive, which is mostly in one country;
and the probability of its format by shape alone from which they do."""

_Shares = npt.NDArray[np.float64]
"""One number for each of `PLATE_FORMATS`."""


@dataclass(slots=True)
class MeanAppearance:
    """Mean shape of one track's plate, and how often a blue band was found."""

    weight: float = 0.0
    log_shape: float = 0.0
    detections: int = 0
    bands: int = 0
    """Detections with a blue band."""

    def add(self, shape: float, width_px: float, *, has_band: bool = False) -> None:
        """Add one detection; its shape is weighted by the inverse of its variance.

        Args:
            shape: width by height.
            width_px: width of the plate.
            has_band: whether a blue band was found.
        """
        self.detections += 1
        self.bands += has_band
        self.weight += width_px**4
        self.log_shape += width_px**4 / self.weight * (math.log(shape) - self.log_shape)

    @property
    def sigma(self) -> float:
        """Sigma of `log_shape`."""
        px_squared = math.sqrt(self.weight / max(self.detections, 1))
        return math.hypot(SHAPE_SIGMA, SMALL_SIGMA * SMALL_PX**2 / max(px_squared, 1.0))


class PlateFormats:
    """The formats of plates, and how often each occurs in this drive."""

    def __init__(self, width_m: float | None = None) -> None:
        """Take `width_m` for all plates; `None` derives it from each plate's shape."""
        formats = PLATE_FORMATS if width_m is None else ((width_m, 1.0, 1),)
        self.widths_m = tuple(width_m for width_m, _, _ in formats)
        """Widths of the formats."""
        self.prior = np.array([float(prior) for _, _, prior in formats])
        """Prior count of each format."""
        self._usual = np.log([shape for _, shape, _ in formats])
        self._is_banded = np.array([each == BANDED_WIDTH_M for each in self.widths_m])

    def likely_width_m(self, shape: float, width_px: float, *, has_band: bool = False) -> float:
        """The width of the format that fits a single detection best.

        Args:
            shape: width by height.
            width_px: width of the plate.
            has_band: whether a blue band was found.
        """
        mean = MeanAppearance()
        mean.add(shape, width_px, has_band=has_band)
        return self.widths_m[int(self.shares(mean, self.prior).argmax())]

    def shares(self, appearance: MeanAppearance, prior: _Shares) -> _Shares:
        """Probability of each format, from a track's mean shape and prior counts (Bayes)."""
        scores = (
            np.log(prior) - 0.5 * ((appearance.log_shape - self._usual) / appearance.sigma) ** 2
        )
        scores += (
            self._is_banded
            * math.log(BAND_LIKELIHOOD_RATIO)
            * appearance.bands
            / max(appearance.detections, 1)
        )
        likely = np.exp(scores - scores.max())
        return np.asarray(likely / likely.sum(), np.float64)


class TrackPlateFormat:
    """The format of one track's plate, by all its detections and the prior of the other tracks."""

    def __init__(self, formats: PlateFormats) -> None:
        self._formats = formats
        self._appearance = MeanAppearance()
        self._counted = np.zeros(len(formats.widths_m))
        self._chosen: int | None = None
        self._shares = np.ones(1)

    @property
    def width_m(self) -> float | None:
        """Width of the likeliest format; `None` before the first detection."""
        return None if self._chosen is None else self._formats.widths_m[self._chosen]

    @property
    def sigma(self) -> float:
        """Relative sigma of that width, by the formats that are still possible."""
        if self.width_m is None:
            return 0.0
        factors = np.asarray(self._formats.widths_m) / self.width_m
        return math.sqrt(float(self._shares @ (factors - 1.0) ** 2))

    def add(self, shape: float, width_px: float, *, has_band: bool = False) -> float:
        """Add one detection; returns the width of the likeliest format.

        Args:
            shape: width by height.
            width_px: width of the plate.
            has_band: whether a blue band was found.
        """
        self._appearance.add(shape, width_px, has_band=has_band)
        prior = self._formats.prior - self._counted
        self._shares = self._formats.shares(self._appearance, prior)
        weighted = self._shares.copy()
        if self._chosen is not None:
            weighted[self._chosen] *= SWITCH_RATIO
        self._chosen = int(weighted.argmax())
        # The track adds to the prior of the others only what its own shape shows.
        alone = self._formats.shares(self._appearance, np.ones(len(prior)))
        self._counted = (
            min(self._appearance.detections, MAX_COUNTED)
            * alone
            * (alone >= MIN_COUNTED_PROBABILITY)
        )
        self._formats.prior = prior + self._counted
        return self._formats.widths_m[self._chosen]
