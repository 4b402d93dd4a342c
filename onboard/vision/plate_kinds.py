"""How wide a plate is, told from its shape.

Width by height of one frame is off by a tenth, and kinds lie a quarter apart: each frame by itself
would now and then put a car a quarter nearer than it is. So a car's kind goes by all its sightings,
and kinds that are common in this drive are likelier.
"""

import math
from dataclasses import dataclass

import numpy as np

PLATE_KINDS = ((0.520, 4.6, 4), (0.400, 3.25, 4), (0.305, 2.1, 4), (0.280, 1.5, 1), (0.200, 1.2, 1))
"""Width in m, width by height as the detector finds it in photographs, and how common: Europe
(520 x 110 mm), Brazil (400 x 130), North America (305 x 152, SAE J686), Europe in two rows,
motorcycles."""
SHAPE_SIGMA = 0.12
"""Of the logarithm of a found plate's width by height."""
LIKELIER = 2.0
"""By so much another kind must be likelier than the one that a car was taken to have."""


@dataclass(slots=True)
class MeanShape:
    """Width by height of one car's plate, in the mean of its sightings."""

    weight: float = 0.0
    log_shape: float = 0.0

    def add(self, shape: float, width_px: float) -> None:
        """Take in one sighting.

        That of a plate 40 px wide is off by a quarter, of one of 80 px by a twentieth.
        """
        self.weight += width_px**4
        self.log_shape += width_px**4 / self.weight * (math.log(shape) - self.log_shape)


class PlateKinds:
    """The kinds of plates that there are in a drive."""

    def __init__(self, width_m: float | None = None) -> None:
        """`width_m`: of all plates; `None` tells it from each plate's shape."""
        self._width_m = width_m
        self._seen = np.array([float(common) for _, _, common in PLATE_KINDS])

    @property
    def widths_m(self) -> tuple[float, ...]:
        """That there are."""
        if self._width_m is not None:
            return (self._width_m,)
        return tuple(width_m for width_m, _, _ in PLATE_KINDS)

    def likely_width_m(self, log_shape: float, taken_m: float | None = None) -> float:
        """Of the kind that fits best; `taken_m`: what this plate was taken for."""
        if self._width_m is not None:
            return self._width_m
        scores = np.log(self._seen)
        for index, (width_m, usual, _) in enumerate(PLATE_KINDS):
            scores[index] -= 0.5 * ((log_shape - math.log(usual)) / SHAPE_SIGMA) ** 2
            if width_m == taken_m:
                scores[index] += math.log(LIKELIER)
        return PLATE_KINDS[int(scores.argmax())][0]

    def count(self, width_m: float) -> None:
        """A plate of this kind was seen once more."""
        for index, (usual_m, _, _) in enumerate(PLATE_KINDS):
            self._seen[index] += usual_m == width_m
