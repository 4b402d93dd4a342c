"""One car ahead as vision follows it, without pictures: how far, how fast, which plate.

Each figure was measured on the rendered path (picture, JPEG, `Sight`), with the lens and the rate
of the rig's cameras; `tests/sim_rig/test_camera_model.py` holds the model against it.
"""

import math

import numpy as np

from onboard.vision.identity import Ballot
from onboard.vision.settings import VisionSettings
from sim_rig.cars.camera_view import FPS, LENS
from sim_rig.picture.scene import SceneCar

PLATE_WIDTH_M, PLATE_HEIGHT_M = 0.52, 0.11
PLATE_OVER_ROAD_M = 0.6

WIDTHS_PX = (23.0, 26.0, 31.0, 39.0, 50.0, 69.0, 100.0)
"""Of the plate in the picture, for the tables below; linear in between, constant outside."""
FOUND = (0.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0)
"""Part of the frames in which the plate is found."""
READ = (0.0, 0.0, 0.0, 0.2, 0.5, 1.0, 1.0)
"""Part of the plates looked at that are read."""
MISREAD = (0.0, 0.0, 0.0, 0.5, 0.2, 0.0, 0.0)
"""Part of the read plates that are read with a wrong character."""
CONFIDENCE = (0.0, 0.0, 0.0, 0.5, 0.8, 0.97, 0.99)
"""Of a plate that is read rightly; of one that is not, half as much."""
GAP_BIAS = (-0.04, -0.03, -0.01, 0.01, 0.01, 0.03, 0.055)
"""Mean error of the gap, as a share of it."""
GAP_SIGMA = (0.06, 0.05, 0.04, 0.025, 0.02, 0.015, 0.012)
CLOSING_SIGMA_M_S = (1.6, 1.0, 0.5, 0.4, 0.3, 0.2, 0.15)
CORRELATION_S = 0.5
"""Errors depend on how the plate lies on the pixels, and change slowly: 1/e is left after this."""
CLOSING_LAG_S = 0.3
"""The closing speed follows the true one by about this."""
CONFIRMED_SIGHTINGS = 3
LEAST_TAG_PX = 12.0
"""AR tags are found and read from this width on, without error."""

_KEPT = math.exp(-1 / FPS / CORRELATION_S)
_FRESH = math.sqrt(1 - _KEPT**2)
_LAG = math.exp(-1 / FPS / CLOSING_LAG_S)
_LETTERS = "ABCDEFGHJKLMNPRSTUVWXYZ"


class SeenCar:
    """A car in view, from its first sighting on."""

    def __init__(self, settings: VisionSettings, rng: np.random.Generator) -> None:
        self._read_every_s = settings.read_every_s
        self._rng = rng
        self._ballot = Ballot(settings.identity_confidence)
        self._read_at = -math.inf
        self._car: SceneCar | None = None
        self._true_closing_m_s = 0.0
        self._errors = rng.standard_normal(2)
        self._gap_m = 0.0
        self.seen_at = -math.inf
        self.sightings = 0
        self.closing_speed_m_s = 0.0
        self.right_m = 0.0
        self.last_read: tuple[str | None, float] = (None, 0.0)
        """Text and confidence of the last look at the plate."""

    @property
    def text(self) -> str | None:
        """The voted plate."""
        return self._ballot.text

    @property
    def is_confirmed(self) -> bool:
        """Whether it was sighted often enough to be believed."""
        return self.sightings >= CONFIRMED_SIGHTINGS

    def gap_m(self, stamp_s: float) -> float:
        """As last measured, and moved on to `stamp_s`."""
        return self._gap_m - self.closing_speed_m_s * (stamp_s - self.seen_at)

    def look(self, car: SceneCar, stamp_s: float) -> bool:
        """A frame shows the car in full view; whether its plate or tag is found."""
        # Always the same number of draws: settings change fates, not the fates of others.
        found, read, misread = self._rng.random(3)
        self._errors = _KEPT * self._errors + _FRESH * self._rng.standard_normal(2)
        width_px = plate_width_px(car)
        if found >= (width_px >= LEAST_TAG_PX if car.tag_id is not None else at(FOUND, width_px)):
            return False
        self._measure(car, width_px, stamp_s)
        self.last_read = (None, 0.0)
        if self.text is None or stamp_s - self._read_at >= self._read_every_s:
            self._read(car, width_px, (read, misread), stamp_s)
        return True

    def _measure(self, car: SceneCar, width_px: float, stamp_s: float) -> None:
        if self._car is not None:
            true_m_s = (self._car.ahead_m - car.ahead_m) / (stamp_s - self.seen_at)
            self._true_closing_m_s += (true_m_s - self._true_closing_m_s) * (1 - _LAG)
        share, closing_error_m_s = 0.0, 0.0
        if car.tag_id is None:
            share = at(GAP_BIAS, width_px) + at(GAP_SIGMA, width_px) * self._errors[0]
            closing_error_m_s = at(CLOSING_SIGMA_M_S, width_px) * self._errors[1]
        self._gap_m = float(car.ahead_m * (1 + share))
        self.closing_speed_m_s = float(self._true_closing_m_s + closing_error_m_s)
        self.right_m = car.lateral_m
        self._car, self.seen_at = car, stamp_s
        self.sightings += 1

    def _read(
        self, car: SceneCar, width_px: float, chances: tuple[float, float], stamp_s: float
    ) -> None:
        self._read_at = stamp_s
        if car.tag_id is not None:
            text, confidence = f"TAG{car.tag_id}", 1.0
        elif car.plate is None or chances[0] >= at(READ, width_px):
            return
        else:
            text, confidence = car.plate, at(CONFIDENCE, width_px)
            if chances[1] < at(MISREAD, width_px):
                text, confidence = self._misread(text), confidence / 2
        self.last_read = text, confidence
        self._ballot.vote(text, confidence, (), stamp_s)

    def _misread(self, plate: str) -> str:
        place = int(self._rng.integers(len(plate)))
        letter = self._rng.choice(list(_LETTERS.replace(plate[place], "")))
        return f"{plate[:place]}{letter}{plate[place + 1 :]}"


def plate_width_px(car: SceneCar) -> float:
    """How wide its plate, or its tag, is in the picture."""
    width_m = PLATE_WIDTH_M if car.tag_id is None else car.tag_side_m
    return LENS.focal_x_px * width_m / car.ahead_m


def at(values: tuple[float, ...], width_px: float) -> float:
    """One of the tables above, at a width."""
    return float(np.interp(width_px, WIDTHS_PX, values))
