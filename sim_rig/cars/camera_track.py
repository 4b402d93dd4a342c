"""Model of one camera track, without images: gap, closing speed and plate, with their errors.

The tables were measured on rendered JPEG images with `onboard.vision.perception`, with the lens and
frame rate of the rig's cameras; `tests/sim_rig/cars/test_camera_model.py` compares model and
perception. What the plate is read as follows photographs instead (`plate_readings.py`): rendered
plates are easier to read.
"""

import math
from statistics import NormalDist

import numpy as np

from onboard.observations import PlateCandidate, VehicleDetection
from onboard.vision.detection import DetectionKind
from onboard.vision.lead import MAX_MISSED_S
from onboard.vision.parameters import DEFAULT_PARAMETERS
from onboard.vision.plate_posterior import PlatePosterior
from onboard.vision.plate_reader import CERTAIN
from onboard.vision.plates import MIN_PX
from onboard.vision.vehicle_track import BEARING_SIGMA, SIZE_SIGMA
from sim_rig.cars.camera_projection import CameraProjection
from sim_rig.cars.camera_view import LENS
from sim_rig.cars.gauss_markov import wandered
from sim_rig.cars.plate_readings import PlateReadings
from sim_rig.rendering.scene import SceneCar

WIDTHS_PX = (20.0, 23.0, 26.0, 29.0, 33.0, 36.0, 40.0, 44.0, 49.0, 64.0, 92.0)
"""Plate width in the image, for the tables below; linear in between, constant outside.
Measured on 15 cars in five colours from 42 m to 6 m ahead (`python -m tools.camera_tables`)."""
FOUND = (0.04, 0.72, 0.93, 0.96, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0)
"""Share of the frames in which the plate is detected."""
GAP_BIAS = (-0.054, -0.038, 0.0, 0.016, 0.033, 0.043, 0.011, 0.003, 0.0, 0.001, 0.004)
"""Mean relative error of the gap. Its standard deviation between cars, by colour, is 0.05 at 33 px
and 0.01 at 49 px, which is not modelled."""
GAP_SIGMA = (0.012, 0.021, 0.008, 0.006, 0.01, 0.011, 0.009, 0.006, 0.005, 0.001, 0.002)
CLOSING_SIGMA_M_S = (0.57, 0.42, 0.2, 0.19, 0.26, 0.32, 0.24, 0.14, 0.11, 0.06, 0.04)
REAR_WIDTHS_PX = (29.0, 33.0, 38.0, 44.0, 52.0, 62.0, 76.0, 96.0, 140.0, 200.0, 320.0)
"""Width of a rear in the image, for the following tables. Measured on 15 cars without a plate from
110 m ahead by the same command; narrower ones are not found."""
REAR_GAP_BIAS = (0.15, 0.09, 0.04, 0.02, -0.01, -0.04, -0.08, -0.07, -0.02, -0.02, -0.05)
REAR_GAP_SIGMA = (0.027, 0.016, 0.01, 0.01, 0.01, 0.009, 0.01, 0.016, 0.01, 0.022, 0.037)
REAR_CLOSING_SIGMA_M_S = (0.78, 0.61, 0.35, 0.3, 0.27, 0.21, 0.46, 0.28, 0.14, 0.13, 0.14)
REAR_PERIOD_S = DEFAULT_PARAMETERS.search_period_without_lead_s
"""Time between two detections of a rear whose plate is not found."""
CORRELATION_S = 0.5
"""Correlation time of the errors, which depend on the plate's position on the pixel grid."""
CLOSING_LAG_S = 0.3
"""Time constant with which the closing speed follows the true one."""
GAP_SIGMA_STATED = {DetectionKind.TAG: 0.02, DetectionKind.PLATE: 0.06, DetectionKind.VEHICLE: 0.11}
BEARING_SIGMA_RAD = 0.004
"""Typical sigmas that perception reports, those of gaps relative to them."""
CONFIRMED_DETECTIONS = 3
MIN_TAG_PX = 12.0
"""AR tags are detected and read without error from this width on. Their gaps, and the directions of
all rears, have the errors that perception assumes (`onboard/vision/vehicle_track.py`)."""


class CameraTrack:
    """The track of one car, from its first detection on."""

    def __init__(
        self,
        track_id: int,
        plate: PlateReadings,
        projection: CameraProjection,
        rng: np.random.Generator,
        rate_hz: float,
        *,
        finds_rears: bool,
    ) -> None:
        """Start a track.

        Args:
            track_id: number of the track.
            plate: readings of the car's plate by this camera.
            projection: of the camera.
            rng: source of the other errors.
            rate_hz: frames a second.
            finds_rears: whether vehicles are found by more than plates and tags.
        """
        self.track_id = track_id
        self._read_every_s = DEFAULT_PARAMETERS.read_period_identified_s
        self._plate = plate
        self._finds_rears = finds_rears
        self._marked_at = -math.inf  # when its plate or tag was last found
        self.kind = DetectionKind.VEHICLE
        """Of the last detection."""
        self._projection = projection
        self._rng = rng
        self._period_s = 1 / rate_hz
        self._times = self._period_s / CORRELATION_S
        self._lag = math.exp(-self._period_s / CLOSING_LAG_S)
        self._posterior = PlatePosterior()
        self._read_at = -math.inf
        self._car: SceneCar | None = None
        self._true_closing_m_s = 0.0
        self._errors = rng.standard_normal(4)
        """Of gap, closing speed, lateral position and detection, in standard deviations."""
        self._gap_m = 0.0
        self.seen_at = -math.inf
        self.detections = 0
        self.closing_speed_m_s = 0.0
        self.right_m = 0.0
        self.candidates: tuple[PlateCandidate, ...] = ()
        """Texts that the plate may bear, by all readings."""
        self.last_read: tuple[str | None, float] = (None, 0.0)
        """Text and confidence of the last reading of the plate."""

    @property
    def text(self) -> str | None:
        """What the camera by itself is certain that the plate bears."""
        likeliest = next(iter(self.candidates), None)
        is_certain = likeliest is not None and likeliest.probability >= CERTAIN
        return likeliest.text if likeliest is not None and is_certain else None

    @property
    def is_confirmed(self) -> bool:
        """Whether the track has enough detections to be reported."""
        return self.detections >= CONFIRMED_DETECTIONS

    def gap_m(self, stamp_s: float) -> float:
        """Gap predicted from the last measurement to `stamp_s`, m."""
        return self._gap_m - self.closing_speed_m_s * (stamp_s - self.seen_at)

    @property
    def gap_sigma_stated(self) -> float:
        """Sigma that perception reports of the gap, relative to it."""
        return GAP_SIGMA_STATED[self.kind]

    def detection(self, stamp_s: float) -> VehicleDetection:
        """Return the detection for shared sensing, with its reported sigmas."""
        gap_m = self.gap_m(stamp_s)
        range_m = math.hypot(gap_m, self.right_m)
        return VehicleDetection(
            stamp_s=stamp_s,
            track_id=self.track_id,
            range_m=range_m,
            range_sigma_m=self.gap_sigma_stated * gap_m,
            bearing_rad=math.atan2(self.right_m, gap_m),
            bearing_sigma_rad=BEARING_SIGMA_RAD,
            text=self.text,
        )

    def update(self, car: SceneCar, stamp_s: float) -> DetectionKind | None:
        """Process a frame in which the car is unoccluded.

        Returns:
            By what it is detected, if it is.
        """
        # The number of draws is constant, so that settings do not change other cars' errors.
        fresh = self._rng.standard_normal(len(self._errors))
        self._errors = wandered(self._errors, 1.0, self._times, fresh)
        self._plate.advance()
        width_px = self._projection.plate_width_px(car)
        if NormalDist().cdf(self._errors[3]) >= _detection_probability(car, width_px):
            return self._find_rear(car, stamp_s)
        self._marked_at = stamp_s
        self.kind = DetectionKind.PLATE if car.tag_id is None else DetectionKind.TAG
        self._measure(car, stamp_s)
        self.last_read = (None, 0.0)
        if self.text is None or stamp_s - self._read_at >= self._read_every_s:
            self._read_at = stamp_s
            if candidates := self._read(car, width_px):
                self.last_read = candidates[0].text, candidates[0].probability
                self._posterior.update(candidates, stamp_s)
                self.candidates = self._posterior.candidates()
        return self.kind

    def _find_rear(self, car: SceneCar, stamp_s: float) -> DetectionKind | None:
        is_wide_enough = self._projection.rear_width_px(car) >= REAR_WIDTHS_PX[0]
        if not (self._finds_rears and is_wide_enough) or stamp_s - self._marked_at <= MAX_MISSED_S:
            return None
        if stamp_s - self.seen_at < REAR_PERIOD_S - 0.5 * self._period_s:
            return None
        self.kind = DetectionKind.VEHICLE
        self._measure(car, stamp_s)
        return self.kind

    def _measure(self, car: SceneCar, stamp_s: float) -> None:
        if self._car is not None:
            true_m_s = (self._car.ahead_m - car.ahead_m) / (stamp_s - self.seen_at)
            self._true_closing_m_s += (true_m_s - self._true_closing_m_s) * (1 - self._lag)
        share, closing_sigma_m_s = SIZE_SIGMA[DetectionKind.TAG] * self._errors[0], 0.0
        # At the same width, the gap is as many times longer as the focal length.
        longer = self._projection.lens.focal_x_px / LENS.focal_x_px
        if self.kind is DetectionKind.PLATE:
            width_px = self._projection.plate_width_px(car)
            share = at(GAP_BIAS, width_px) + at(GAP_SIGMA, width_px) * self._errors[0]
            closing_sigma_m_s = longer * at(CLOSING_SIGMA_M_S, width_px)
        elif self.kind is DetectionKind.VEHICLE:
            width_px = self._projection.rear_width_px(car)
            share = _at_rear(REAR_GAP_BIAS, width_px)
            share += _at_rear(REAR_GAP_SIGMA, width_px) * self._errors[0]
            closing_sigma_m_s = longer * _at_rear(REAR_CLOSING_SIGMA_M_S, width_px)
        closing_error_m_s = closing_sigma_m_s * self._errors[1]
        self._gap_m = float(car.ahead_m * (1 + share))
        self.closing_speed_m_s = float(self._true_closing_m_s + closing_error_m_s)
        self.right_m = float(car.lateral_m + BEARING_SIGMA * car.ahead_m * self._errors[2])
        self._car, self.seen_at = car, stamp_s
        self.detections += 1

    def _read(self, car: SceneCar, width_px: float) -> tuple[PlateCandidate, ...]:
        """One reading of plate or tag."""
        if car.tag_id is not None:
            return (PlateCandidate(f"TAG{car.tag_id}", 1.0),)
        return () if car.plate is None else self._plate.read(car.plate, width_px)


def _detection_probability(car: SceneCar, width_px: float) -> float:
    """Probability of detecting plate or tag in a frame; plates below `MIN_PX` are dropped."""
    if car.tag_id is not None:
        return float(width_px >= MIN_TAG_PX)
    return at(FOUND, width_px) if width_px >= MIN_PX else 0.0


def at(values: tuple[float, ...], width_px: float) -> float:
    """Interpolate one of the tables above at a plate width."""
    return float(np.interp(width_px, WIDTHS_PX, values))


def _at_rear(values: tuple[float, ...], width_px: float) -> float:
    return float(np.interp(width_px, REAR_WIDTHS_PX, values))
