"""What perception knows of the camera for one size of its frames: geometry, and what searches them.

A camera may change its size while driving, or turn out to look elsewhere than was assumed; then the
calibration is adapted, and all that was made from it is made anew.
"""

import math
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
import numpy.typing as npt

from onboard.observations import ImageBox
from onboard.vision.box_model import BoxModel
from onboard.vision.detection import Detection, SearchPlan
from onboard.vision.free_lane import FreeLane
from onboard.vision.horizon import Horizon
from onboard.vision.lane import LaneMarkingDetector
from onboard.vision.perspective import Perspective, RoadPosition
from onboard.vision.plate_formats import PlateFormats
from onboard.vision.plates import PlateFinder, PlateRecognizer, TextReader
from onboard.vision.settings import Calibration, VisionSettings, guessed_calibration
from onboard.vision.syntax import PlateSyntax
from onboard.vision.tags import TagDetector
from onboard.vision.vehicle_detector import VehicleBoxDetector, VehicleDetector
from onboard.vision.vehicle_finder import VehicleFinder

CALIBRATED_SLOPE, GUESSED_SLOPE = 0.04, 0.15
"""Error of heights above the road, as a share of the distance: by pitching and the slope of the
road; and with a camera whose mounting is not calibrated."""
GUESSED_LENS_SIGMA = 0.5
"""Relative sigma of distances and speeds without a calibrated lens: cameras in cars see 35 to 120
degrees, which is 1.8 to 0.33 times the assumed focal length."""
SMALLEST_PX, LARGEST_PX = 64, 8192
"""Sides of a frame."""


@dataclass(frozen=True, slots=True)
class Networks:
    """The networks to run; `None` leaves that kind of detection out."""

    plate_finder: PlateFinder | None = None
    plate_reader: TextReader | None = None
    vehicle_model: VehicleFinder | BoxModel | None = None

    @property
    def finds_vehicles(self) -> bool:
        """Whether vehicles are detected as such."""
        return self.vehicle_model is not None


class Detector(Protocol):
    """Detects vehicles by one kind of feature: plate, tag or whole vehicle."""

    def find(self, image: npt.NDArray[np.uint8], plan: SearchPlan) -> list[Detection]:
        """Detections in an (h, w, 3) BGR image, in the regions of `plan`."""
        ...


@dataclass(frozen=True, slots=True, eq=False)
class SizedCamera:
    """The camera with frames of one size."""

    size_px: tuple[int, int]
    """Width and height."""
    perspective: Perspective
    road: ImageBox | None
    """Part of the image in which plates can be; `None` is all of it, without a calibration."""
    markings: LaneMarkingDetector | None
    """Needs a calibration."""
    free_lane: FreeLane | None
    """Needs a calibrated mounting."""
    horizon: Horizon | None
    """Needs a calibrated mounting."""
    detectors: list[Detector] = field(default_factory=list)

    def detect(self, image: npt.NDArray[np.uint8], plan: SearchPlan) -> list[Detection]:
        """Detections of all kinds in an (h, w, 3) BGR image, in the regions of `plan`."""
        return [found for detector in self.detectors for found in detector.find(image, plan)]


class SizedCameras:
    """Makes the camera of each size that frames have."""

    def __init__(
        self, calibration: Calibration | None, settings: VisionSettings, networks: Networks
    ) -> None:
        """Take what all sizes have in common.

        Args:
            calibration: of the camera; `None` assumes a lens of 60 degrees.
            settings: what to detect.
            networks: that detect it.
        """
        self._calibration = calibration
        self._settings = settings
        self._networks = networks
        self._syntax = PlateSyntax(settings.plate_patterns)
        self.formats = PlateFormats(settings.plate_width_m)
        """Formats of plates in this drive."""
        self._turned_rad = 0.0
        self.has_mounting = calibration is not None and calibration.has_mounting
        """Whether it is known where the camera looks."""
        self.slope = CALIBRATED_SLOPE if self.has_mounting else GUESSED_SLOPE
        """Error of heights above the road, as a share of the distance."""
        has_lens = calibration is not None and calibration.has_lens
        self.lens_sigma = 0.0 if has_lens else GUESSED_LENS_SIGMA
        """Relative sigma of distances and speeds by the lens."""
        self._latest: SizedCamera | None = None

    def reset(self) -> None:
        """Forget where the camera looks: the next frame is of another drive."""
        if self._turned_rad:
            self.turn(-self._turned_rad)

    def turn(self, by_rad: float) -> None:
        """Turn the camera to the left: the vehicle heads so far to the right of where it looked."""
        self._turned_rad += by_rad
        self._latest = None

    def for_size(self, width_px: int, height_px: int) -> SizedCamera | None:
        """The camera with frames of this size, the same object while it does not change.

        `None` if it is too small or too large, or has another shape than the calibration.
        """
        if self._latest is not None and self._latest.size_px == (width_px, height_px):
            return self._latest
        if not SMALLEST_PX <= min(width_px, height_px) <= max(width_px, height_px) <= LARGEST_PX:
            return None
        calibration = (
            self._calibration.for_size(width_px, height_px)
            if self._calibration is not None
            else guessed_calibration(width_px, height_px)
        )
        if calibration is None:
            return None
        yaw_rad = calibration.yaw_rad - self._turned_rad
        calibration = calibration.model_copy(update={"yaw_rad": yaw_rad})
        self._latest = self._sized(Perspective(calibration), width_px, height_px)
        return self._latest

    def describe(self, width_px: int, height_px: int) -> str:
        """A size that is not possible, beside the one that is expected."""
        expected = self._calibration
        shape = f", calibrated for {expected.width_px} x {expected.height_px}" if expected else ""
        return f"{width_px} x {height_px} px{shape}"

    def _sized(self, perspective: Perspective, width_px: int, height_px: int) -> SizedCamera:
        given, lane_m = self._calibration, self._settings.lane_width_m
        return SizedCamera(
            size_px=(width_px, height_px),
            perspective=perspective,
            road=_below_horizon(perspective, self.slope, width_px, height_px) if given else None,
            markings=LaneMarkingDetector(perspective, lane_m) if given else None,
            free_lane=FreeLane(perspective, lane_m) if self.has_mounting else None,
            horizon=Horizon(perspective, lane_m) if self.has_mounting else None,
            detectors=self._detectors(perspective),
        )

    def _detectors(self, perspective: Perspective) -> list[Detector]:
        settings, networks = self._settings, self._networks
        detectors: list[Detector] = []
        if settings.tag_dictionary is not None:
            tags = TagDetector(settings.tag_dictionary, settings.tag_side_m, perspective)
            detectors.append(tags)
        if networks.plate_finder is not None and networks.plate_reader is not None:
            plates = PlateRecognizer(
                networks.plate_finder,
                networks.plate_reader,
                self._syntax,
                perspective,
                self.formats,
            )
            detectors.append(plates)
        if isinstance(networks.vehicle_model, VehicleFinder):
            detectors.append(VehicleDetector(networks.vehicle_model, perspective))
        elif networks.vehicle_model is not None and settings.vehicle_model is not None:
            every_n_frames = settings.vehicle_model.every_n_frames
            detectors.append(
                VehicleBoxDetector(networks.vehicle_model, every_n_frames, perspective)
            )
        return detectors


def _below_horizon(
    perspective: Perspective, slope: float, width_px: int, height_px: int
) -> ImageBox:
    """Part of the image in which plates can be: below a line a little above the horizon."""
    _, horizon_px = perspective.project(RoadPosition(1e6, 0.0, 0.0))
    top_px = float(np.clip(horizon_px - slope * perspective.width_px(1.0, 1.0), 0, height_px / 2))
    # The detector shrinks it by 2 and 8: whole multiples are averaged many times faster.
    rows_px = min(8 * math.ceil((height_px - top_px) / 8), height_px)
    return ImageBox(0.0, height_px - rows_px, width_px, rows_px)
