"""One car ahead as vision follows it, without pictures: how far, how fast, which plate.

Each figure was measured on the rendered path (picture, JPEG, `Sight`), with the lens and the rate
of the rig's cameras; `tests/sim_rig/test_camera_model.py` holds the model against it.
"""

import math

import numpy as np

from onboard.observations import VehicleDetection
from onboard.vision.identity import PlateVote
from onboard.vision.plate_reader import ALPHABET
from onboard.vision.plates import LEAST_PX
from onboard.vision.settings import VisionSettings
from sim_rig.cars.camera_view import FPS, LENS
from sim_rig.rendering.scene import SceneCar

PLATE_WIDTH_M, PLATE_HEIGHT_M = 0.52, 0.11
PLATE_OVER_ROAD_M = 0.6

WIDTHS_PX = (26.0, 29.0, 33.0, 36.0, 40.0, 44.0, 49.0, 64.0, 92.0)
"""Of the plate in the picture, for the tables below; linear in between, constant outside.
Measured on 15 cars in five colours from 36 m to 6 m ahead (`python -m tools.camera_tables`)."""
FOUND = (0.18, 0.88, 0.97, 1.0, 0.98, 1.0, 1.0, 1.0, 1.0)
"""Part of the frames in which the plate is found."""
CERTAIN = (0.0, 0.0, 0.0, 0.0, 0.08, 0.38, 0.79, 0.98, 1.0)
"""Part of the plates looked at that are read rightly and with certainty."""
DOUBTFUL = (0.0, 0.0, 0.03, 0.20, 0.48, 0.47, 0.18, 0.02, 0.0)
"""Part that are read rightly and with doubt."""
WRONG = (0.0, 0.0, 0.01, 0.18, 0.24, 0.10, 0.03, 0.0, 0.0)
"""Part that are read with a wrong character, always with doubt. The rest is not read."""
CERTAIN_CONFIDENCE, WRONG_CONFIDENCE = 0.98, 0.50
DOUBTFUL_CONFIDENCE = (0.38, 0.38, 0.38, 0.52, 0.58, 0.68, 0.79, 0.78, 0.78)
LEGIBILITY_SIGMA = 0.1
"""Plates differ: each is read as if it were wider or narrower by this share of its width."""
GAP_BIAS = (0.020, 0.026, 0.037, 0.044, 0.008, 0.001, -0.003, 0.002, 0.004)
"""Mean error of the gap, as a share of it. From car to car, by colour, it differs by 0.05 at 33 px
and 0.01 at 49 px (one sigma), which is not modelled."""
GAP_SIGMA = (0.017, 0.005, 0.010, 0.011, 0.008, 0.005, 0.004, 0.002, 0.002)
CLOSING_SIGMA_M_S = (0.44, 0.28, 0.31, 0.32, 0.25, 0.14, 0.10, 0.06, 0.04)
CORRELATION_S = 0.5
"""Errors depend on how the plate lies on the pixels, and change slowly: 1/e is left after this."""
CLOSING_LAG_S = 0.3
"""The closing speed follows the true one by about this."""
GAP_SIGMA_STATED, BEARING_SIGMA_RAD = 0.05, 0.004
"""What vision states of its own errors, roughly."""
CONFIRMED_SIGHTINGS = 3
LEAST_TAG_PX = 12.0
"""AR tags are found and read from this width on, without error."""

_KEPT = math.exp(-1 / FPS / CORRELATION_S)
_FRESH = math.sqrt(1 - _KEPT**2)
_LAG = math.exp(-1 / FPS / CLOSING_LAG_S)


class CameraTrack:
    """A car in view, from its first sighting on."""

    def __init__(self, track_id: int, settings: VisionSettings, rng: np.random.Generator) -> None:
        self.track_id = track_id
        self._read_every_s = settings.read_known_every_s
        self._rng = rng
        self._ballot = PlateVote(settings.identity_confidence)
        self._read_at = -math.inf
        self._car: SceneCar | None = None
        self._true_closing_m_s = 0.0
        self._errors = rng.standard_normal(2)
        self._fooled_by = rng.random(2)
        self._legibility = 1.0 + LEGIBILITY_SIGMA * float(rng.standard_normal())
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

    def sensed(self, stamp_s: float) -> VehicleDetection:
        """As vision tells it to shared sensing, with what it states of its own errors."""
        gap_m = self.gap_m(stamp_s)
        range_m = math.hypot(gap_m, self.right_m)
        return VehicleDetection(
            stamp_s=stamp_s,
            track_id=self.track_id,
            range_m=range_m,
            range_sigma_m=GAP_SIGMA_STATED * gap_m,
            bearing_rad=math.atan2(self.right_m, gap_m),
            bearing_sigma_rad=BEARING_SIGMA_RAD,
            text=self.text,
        )

    def look(self, car: SceneCar, stamp_s: float) -> bool:
        """A frame shows the car in full view; whether its plate or tag is found."""
        # Always the same number of draws: settings change fates, not the fates of others.
        found, read = self._rng.random(2)
        self._errors = _KEPT * self._errors + _FRESH * self._rng.standard_normal(2)
        width_px = plate_width_px(car)
        if found >= _chance_to_find(car, width_px):
            return False
        self._measure(car, width_px, stamp_s)
        self.last_read = (None, 0.0)
        if self.text is None or stamp_s - self._read_at >= self._read_every_s:
            self._read_at = stamp_s
            text, confidence = self.last_read = self._read(car, width_px, read)
            if text is not None:
                self._ballot.vote(text, confidence, (), stamp_s)
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

    def _read(self, car: SceneCar, width_px: float, chance: float) -> tuple[str | None, float]:
        """Text and confidence of one look at the plate."""
        if car.tag_id is not None:
            return f"TAG{car.tag_id}", 1.0
        width_px *= self._legibility
        certain, doubtful = at(CERTAIN, width_px), at(DOUBTFUL, width_px)
        if car.plate is None or chance >= certain + doubtful + at(WRONG, width_px):
            return None, 0.0
        if chance < certain:
            return car.plate, CERTAIN_CONFIDENCE
        if chance < certain + doubtful:
            return car.plate, at(DOUBTFUL_CONFIDENCE, width_px)
        return self._misread(car.plate), WRONG_CONFIDENCE

    def _misread(self, plate: str) -> str:
        """With a wrong character: in one plate always the same, as a reader is fooled."""
        place, letter = self._fooled_by
        index = int(place * len(plate))
        others = ALPHABET.replace(plate[index], "")
        return f"{plate[:index]}{others[int(letter * len(others))]}{plate[index + 1 :]}"


def plate_width_px(car: SceneCar) -> float:
    """How wide its plate, or its tag, is in the picture."""
    width_m = PLATE_WIDTH_M if car.tag_id is None else car.tag_side_m
    return LENS.focal_x_px * width_m / car.ahead_m


def _chance_to_find(car: SceneCar, width_px: float) -> float:
    """Of its plate or tag, in one frame; vision drops plates narrower than `LEAST_PX`."""
    if car.tag_id is not None:
        return float(width_px >= LEAST_TAG_PX)
    return at(FOUND, width_px) if width_px >= LEAST_PX else 0.0


def at(values: tuple[float, ...], width_px: float) -> float:
    """One of the tables above, at a width."""
    return float(np.interp(width_px, WIDTHS_PX, values))
