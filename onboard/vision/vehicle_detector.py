"""Vehicles as sightings, by a model that the user brings.

A vehicle's distance shows in two ways: by its width, which differs from car to car, and by the
place where it meets the road, which the pitching of the own car moves. Both are taken, weighted by
their variances.
"""

import math

import numpy as np
import numpy.typing as npt

from onboard.observations import ImageBox
from onboard.vision.box_model import BoxModel
from onboard.vision.perspective import Perspective, RoadPosition
from onboard.vision.plate_observation import Cue, Search, Sighting
from onboard.vision.settings import VehicleModelSettings

WIDTH_SIGMA = 0.1
"""Of the width of cars, as a share of it."""
PITCH_SIGMA_RAD = 0.01
"""Of the own car's pitch while it drives, with the road's own slope."""
EDGE_SIGMA_PX = 2.0
"""Of a box's sides."""


class VehicleDetector:
    """Vehicles as sightings, in each n-th picture."""

    def __init__(
        self, detector: BoxModel, settings: VehicleModelSettings, perspective: Perspective
    ) -> None:
        self._detector = detector
        self._settings = settings
        self._perspective = perspective
        self._frames = 0

    def find(
        self,
        image: npt.NDArray[np.uint8],
        search: Search,  # noqa: ARG002 (the model always looks at all of the picture)
    ) -> list[Sighting]:
        """Vehicles in the picture."""
        self._frames += 1
        if (self._frames - 1) % self._settings.every_n_frames:
            return []
        return [self._sighting(box) for box, _ in self._detector.find(image)]

    def _sighting(self, box: ImageBox) -> Sighting:
        left, right = box.x_px, box.x_px + box.w_px
        top, bottom = box.y_px, box.y_px + box.h_px
        corners = np.array([(left, top), (right, top), (right, bottom), (left, bottom)], np.float32)
        width_m = self._settings.vehicle_width_m
        by_width = self._perspective.locate_upright(corners, width_m)
        share = math.hypot(WIDTH_SIGMA, 1.4 * EDGE_SIGMA_PX / max(box.w_px, 1.0))
        ahead_m, variance = by_width.ahead_m, (share * by_width.ahead_m) ** 2
        foot = self._perspective.locate_on_road((left + right) / 2, bottom)
        if foot is not None:
            # The ray falls by height / distance: an error in that slope counts distance times.
            slope_sigma = math.hypot(
                PITCH_SIGMA_RAD, EDGE_SIGMA_PX / self._perspective.width_px(1.0, 1.0)
            )
            foot_sigma_m = slope_sigma * foot.ahead_m**2 / self._perspective.mounting_height_m
            weight = variance / (variance + foot_sigma_m**2)
            ahead_m += weight * (foot.ahead_m - ahead_m)
            variance *= 1.0 - weight
        right_m = by_width.right_m * ahead_m / by_width.ahead_m
        sigma_m = math.sqrt(variance)
        return Sighting(
            cue=Cue.VEHICLE,
            corners_px=corners,
            place=RoadPosition(ahead_m, right_m, by_width.height_m),
            ahead_sigma_m=sigma_m,
            right_sigma_m=math.hypot(0.05 * width_m, sigma_m * right_m / ahead_m),
        )
