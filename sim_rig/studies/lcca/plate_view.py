"""What a camera reads of one lead's plate, by the model of photographs, from image to image."""

import numpy as np

from onboard.lcca.events import CandidateCar
from onboard.vision.plate_posterior import PlatePosterior
from sim_rig.cars.plate_readings import PlateReadings
from sim_rig.studies.lcca.study_lcca import car_id_of

DERIVED_AN_IMAGE = 2
"""Texts whose IDs are derived between two images, at 34 ms each; the cores know no others."""


class PlateView:
    """The readings of one plate (`sim_rig/cars/plate_readings.py`), and the IDs derived so far."""

    def __init__(self, plate: str, rng: np.random.Generator) -> None:
        """Have read nothing yet."""
        self._plate = plate
        self._readings, self._posterior = PlateReadings(rng), PlatePosterior()
        self._derived: set[str] = set()

    def look(self, width_px: float, now: float) -> tuple[CandidateCar, ...]:
        """Take one image, in which the plate is so wide; return what it may bear."""
        self._readings.advance()
        self._posterior.update(self._readings.read(self._plate, width_px), now)
        likeliest = self._posterior.candidates()
        missing = [each.text for each in likeliest if each.text not in self._derived]
        self._derived.update(missing[:DERIVED_AN_IMAGE])
        return tuple(
            CandidateCar(each.text, car_id_of(each.text), each.probability)
            for each in likeliest
            if each.text in self._derived
        )
