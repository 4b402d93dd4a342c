"""How wide a plate is, told from its shape, and from a blue band if it has one.

Width by height of one frame is off by a tenth, and kinds lie a quarter apart: each frame by itself
would now and then put a car a quarter nearer than it is. So a car's kind goes by all its sightings,
and kinds that other cars in this drive have are likelier. A car's own sightings are heard once, in
its shape: counted as common as well, they would confirm what they were first taken for.
"""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

PLATE_KINDS = ((0.520, 4.6, 4), (0.400, 3.25, 4), (0.305, 2.1, 4), (0.280, 1.5, 1), (0.200, 1.2, 1))
"""Width in m, width by height as the detector finds it in photographs, and how common: Europe
(520 x 110 mm), Brazil (400 x 130), North America (305 x 152, SAE J686), Europe in two rows,
motorcycles."""
SHAPE_SIGMA = 0.12
"""Of the logarithm of a found plate's width by height, however large it is: photographs have 0.08
to 0.18, made smaller until plates are 95 to 27 px wide. All sightings of one are off alike."""
SMALL_SIGMA, SMALL_PX = 0.02, 80.0
"""What comes to that at so many pixels of width, and falls with their square: with little contrast,
as on light cars, plates of 30 px are found too high."""
BANDED_M, BAND_TELLS = 0.520, 5.0
"""Which kind has a blue band at its left end, and how much likelier that is where one is found: of
photographs of European plates 40 % have one, of the others 8 %, made smaller or not."""
LIKELIER = 2.0
"""By so much another kind must be likelier than the one that a car was taken to have."""
MOST_SAY, SURE = 20, 0.8
"""Sightings of a car that count for what is common in this drive, which is mostly in one country;
and how likely a kind is by the shape alone, so that they do."""

_Shares = npt.NDArray[np.float64]
"""One number for each of `PLATE_KINDS`."""


@dataclass(slots=True)
class MeanLook:
    """What one car's plate looks like, over its sightings: width by height, and banded."""

    weight: float = 0.0
    log_shape: float = 0.0
    sightings: int = 0
    bands: int = 0
    """Of these, with a blue band."""

    def add(self, shape: float, width_px: float, *, has_band: bool = False) -> None:
        """Take in one sighting; its shape weighs as much as its variance is small."""
        self.sightings += 1
        self.bands += has_band
        self.weight += width_px**4
        self.log_shape += width_px**4 / self.weight * (math.log(shape) - self.log_shape)

    @property
    def sigma(self) -> float:
        """Of the logarithm."""
        px_squared = math.sqrt(self.weight / max(self.sightings, 1))
        return math.hypot(SHAPE_SIGMA, SMALL_SIGMA * SMALL_PX**2 / max(px_squared, 1.0))


class PlateKinds:
    """The kinds of plates that there are in a drive."""

    def __init__(self, width_m: float | None = None) -> None:
        """`width_m`: of all plates; `None` tells it from each plate's shape."""
        kinds = PLATE_KINDS if width_m is None else ((width_m, 1.0, 1),)
        self.widths_m = tuple(width_m for width_m, _, _ in kinds)
        """That there are."""
        self.common = np.array([float(common) for _, _, common in kinds])
        """How often each was met."""
        self._usual = np.log([shape for _, shape, _ in kinds])
        self._is_banded = np.array([each == BANDED_M for each in self.widths_m])

    def likely_width_m(self, shape: float, width_px: float, *, has_band: bool = False) -> float:
        """Of the kind that fits a single sighting best."""
        mean = MeanLook()
        mean.add(shape, width_px, has_band=has_band)
        return self.widths_m[int(self.shares(mean, self.common).argmax())]

    def shares(self, look: MeanLook, common: _Shares) -> _Shares:
        """How likely each kind is, of plates that are so common (Bayes)."""
        scores = np.log(common) - 0.5 * ((look.log_shape - self._usual) / look.sigma) ** 2
        scores += self._is_banded * math.log(BAND_TELLS) * look.bands / max(look.sightings, 1)
        likely = np.exp(scores - scores.max())
        return np.asarray(likely / likely.sum(), np.float64)


class CarsKind:
    """The kind of one car's plate, by all its sightings and what is common on other cars."""

    def __init__(self, kinds: PlateKinds) -> None:
        self._kinds = kinds
        self._look = MeanLook()
        self._said = np.zeros(len(kinds.widths_m))
        self._taken: int | None = None
        self._shares = np.ones(1)

    @property
    def width_m(self) -> float | None:
        """What its plate is taken to be; `None` before it was seen."""
        return None if self._taken is None else self._kinds.widths_m[self._taken]

    @property
    def sigma(self) -> float:
        """Of that width, as a share of it: what other kinds are still possible."""
        if self.width_m is None:
            return 0.0
        factors = np.asarray(self._kinds.widths_m) / self.width_m
        return math.sqrt(float(self._shares @ (factors - 1.0) ** 2))

    def add(self, shape: float, width_px: float, *, has_band: bool = False) -> float:
        """Take in one sighting; returns how wide the plate is taken to be."""
        self._look.add(shape, width_px, has_band=has_band)
        common = self._kinds.common - self._said
        self._shares = self._kinds.shares(self._look, common)
        inclined = self._shares.copy()
        if self._taken is not None:
            inclined[self._taken] *= LIKELIER
        self._taken = int(inclined.argmax())
        # What it says to others is what it looks like, not what it heard from them.
        alone = self._kinds.shares(self._look, np.ones(len(common)))
        self._said = min(self._look.sightings, MOST_SAY) * alone * (alone >= SURE)
        self._kinds.common = common + self._said
        return self._kinds.widths_m[self._taken]
