"""Detections of vehicles, by the shipped network or by a model of the user's.

A vehicle's distance is measured twice: by its width, which differs between vehicles, and by the
point where it meets the road, which moves with the host vehicle's pitch. Both are combined,
weighted by their inverse variances.
"""

import math
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from onboard.observations import ImageBox
from onboard.vision.box_model import BoxModel
from onboard.vision.detection import Detection, DetectionKind, SearchPlan
from onboard.vision.perspective import Perspective, RoadPosition
from onboard.vision.vehicle_finder import VehicleFinder, overlap
from onboard.vision.vehicle_network import WIDTH_PX, VehicleBox, VehicleKind

WIDTH_M = 1.8
"""Width of a common car."""
WIDTH_SIGMA = 0.1
"""Relative sigma of the width of cars."""
WIDTHS_M = {
    VehicleKind.CAR: (1.8, 0.1),
    VehicleKind.VAN: (1.95, 0.1),
    VehicleKind.TRUCK: (2.4, 0.12),
    VehicleKind.BUS: (2.5, 0.1),
    VehicleKind.MOTORCYCLE: (0.8, 0.2),
}
"""Width of each kind without mirrors, and its relative sigma, with the vehicles that are taken for
that kind. 2.55 m is the largest allowed in Europe (directive 96/53/EC, annex I)."""
PITCH_SIGMA_RAD = 0.01
"""Sigma of the host vehicle's pitch while it moves, with the slope of the road."""
EDGE_SIGMA_PX = 2.0
"""Sigma of a box's sides."""
EDGE_SIGMAS = 2.0 / WIDTH_PX, 0.1
"""The same of those by the network of streets, on rendered ones: a share of the image's width, and
one of the vehicle's larger side."""
PHOTOGRAPH_EDGE_SIGMAS = 0.0013, 0.06
"""The same by the network of photographs, whose boxes have no known rear: on either half of the
labelled ones, widths from 10 px on scatter by 17 to 5 %."""
HEIGHTS_M = {
    VehicleKind.CAR: (1.5, 0.1),
    VehicleKind.VAN: (2.0, 0.15),
    VehicleKind.TRUCK: (3.2, 0.25),
    VehicleKind.BUS: (3.1, 0.1),
    VehicleKind.MOTORCYCLE: (1.5, 0.15),
}
"""Height of each kind, of a motorcycle with its rider, and its relative sigma: it tells the
distance of a vehicle that shows its side."""
SIDE_SHARE, LONG_SHAPE = 0.45, 1.6
"""Share of its box that a rear or front takes at least, and width over height that a box without a
known one has at most: others show the side."""
SIDE_SHAPE = 2.0
"""Width over height from which on a box without a known rear is of a side: those of cars, vans and
trucks are 2.5 to 3, while boxes of far rears scatter up to 1.6 and more."""
BOX_WIDTH_SIGMA = 0.15
"""Relative sigma of the width of a box without a known rear, which may show some of the side."""
CUT_WIDTH_SIGMA, NEAR_WIDTH_SIGMA = 1.0, 0.35
"""Relative sigma of the width of a vehicle that the image's border cuts at a side, and of one so
near that it stands below the image: rendered ones are found 40 % too narrow to 30 % too wide."""
NEAR_SHARE = 0.4
"""Share of the image's width from which a rear is so near: it may be a part of a larger one."""
REAR_SHAPE = 0.85
"""Height over width of the lower part of a rear, where plates are, for vehicles of any height."""
FAR_M, FAR_PX = 60.0, 40.0
"""A car so far ahead is so wide for the networks at most: a tele lens is searched at less than its
pixels. Chosen, not fitted."""
_SAME_OVERLAP = 0.4
"""Intersection over union from which boxes around two rears are of one vehicle."""
_LEAST_PX = 1.0
"""Least width and height of a box."""
_BORDER_PX = 2.0
"""A side nearer to the image's border than this may be beyond it."""


class VehicleDetector:
    """Detects vehicles in each frame that is searched for them."""

    def __init__(self, finder: VehicleFinder, perspective: Perspective) -> None:
        """Take the network and the camera's perspective."""
        self._finder = finder
        self._perspective = perspective
        self._most_scale = FAR_PX / perspective.width_px(WIDTH_M, FAR_M)

    def find(self, image: npt.NDArray[np.uint8], plan: SearchPlan) -> list[Detection]:
        """Vehicles in an (h, w, 3) BGR image."""
        size = image.shape[1], image.shape[0]
        found: list[VehicleBox] = []
        for rear in [None] if plan.vehicles else plan.rears:
            found += [
                vehicle
                for vehicle in self._finder.find(image, rear, self._most_scale)
                # A box beyond the image is cut to nothing.
                if min(vehicle.box.w_px, vehicle.box.h_px) >= _LEAST_PX
                and all(overlap(vehicle.box, other.box) < _SAME_OVERLAP for other in found)
            ]
        return [self._detection(vehicle, size) for vehicle in found]

    def _detection(self, vehicle: VehicleBox, size: tuple[int, int]) -> Detection:
        box = vehicle.box
        right, bottom = box.x_px + box.w_px, box.y_px + box.h_px
        is_cut = box.x_px < _BORDER_PX or right > size[0] - _BORDER_PX
        rear = None if is_cut else _rear(vehicle)
        ends = (box.x_px, right) if rear is None else rear
        shows_side = rear is None and not is_cut
        measured_px = box.h_px if shows_side else max(ends[1] - ends[0], box.h_px)
        of_image, of_side = PHOTOGRAPH_EDGE_SIGMAS if vehicle.end_px is None else EDGE_SIGMAS
        edge_px = math.hypot(of_image * size[0], of_side * measured_px)
        width_m, width_sigma = WIDTHS_M[vehicle.kind]
        if is_cut:
            width_sigma = CUT_WIDTH_SIGMA
        elif shows_side:
            height_m, height_sigma = HEIGHTS_M[vehicle.kind]
            # It may be all rear, or as wide as its height says: the truth is in between.
            widths = math.sqrt(height_m * box.w_px / (box.h_px * width_m))
            width_m *= widths
            width_sigma = math.hypot(height_sigma, 1.4 * edge_px / box.h_px, math.log(widths))
        elif vehicle.end_px is None:
            width_sigma = max(width_sigma, BOX_WIDTH_SIGMA)
        top = max(box.y_px, bottom - REAR_SHAPE * (ends[1] - ends[0]))
        corners = _corners(ends[0], top, ends[1], bottom)
        by_width_m = self._perspective.locate_upright(corners, width_m).ahead_m
        _, foot_px = self._perspective.project(RoadPosition(by_width_m, 0.0, 0.0))
        is_near = ends[1] - ends[0] > NEAR_SHARE * size[0]
        stands = not is_near and max(bottom, foot_px) <= size[1] - _BORDER_PX
        if not stands:
            width_sigma = max(width_sigma, NEAR_WIDTH_SIGMA)
        width = width_m, width_sigma
        found = _located(self._perspective, corners, width, edge_px, has_foot=stands)
        if is_cut:
            return found
        may_cross = rear is None and box.w_px > SIDE_SHAPE * box.h_px
        return replace(found, ahead_by_size_m=by_width_m, may_cross=may_cross)


class VehicleBoxDetector:
    """Detects vehicles in each n-th frame, by a model of the user's."""

    def __init__(self, detector: BoxModel, every_n_frames: int, perspective: Perspective) -> None:
        """Start with the next frame.

        Args:
            detector: finds the boxes.
            every_n_frames: frames for each one that the detector runs on.
            perspective: of the camera.
        """
        self._detector = detector
        self._every_n_frames = every_n_frames
        self._perspective = perspective
        self._frames = 0

    def find(
        self,
        image: npt.NDArray[np.uint8],
        plan: SearchPlan,  # noqa: ARG002 (the model always runs on the whole frame)
    ) -> list[Detection]:
        """Vehicles in an (h, w, 3) BGR image."""
        self._frames += 1
        if (self._frames - 1) % self._every_n_frames:
            return []
        return [self._detection(box) for box, _ in self._detector.find(image)]

    def _detection(self, box: ImageBox) -> Detection:
        corners = _corners(box.x_px, box.y_px, box.x_px + box.w_px, box.y_px + box.h_px)
        return _located(self._perspective, corners, (WIDTH_M, WIDTH_SIGMA), EDGE_SIGMA_PX)


def _rear(vehicle: VehicleBox) -> tuple[float, float] | None:
    """Left and right side of the rear or front; `None` if the box shows the side."""
    box = vehicle.box
    if vehicle.end_px is None:
        is_long = box.w_px > LONG_SHAPE * box.h_px
        return None if is_long else (box.x_px, box.x_px + box.w_px)
    ends = min(vehicle.end_px), max(vehicle.end_px)
    return ends if ends[1] - ends[0] >= SIDE_SHARE * box.w_px else None


def _corners(left: float, top: float, right: float, bottom: float) -> npt.NDArray[np.float32]:
    return np.array([(left, top), (right, top), (right, bottom), (left, bottom)], np.float32)


def _located(
    perspective: Perspective,
    corners: npt.NDArray[np.float32],
    width: tuple[float, float],
    edge_sigma_px: float,
    *,
    has_foot: bool = True,
) -> Detection:
    """The detection of a vehicle's rear.

    Args:
        perspective: of the camera.
        corners: (4, 2) of the rear; it stands on the lower edge.
        width: in m, and its relative sigma.
        edge_sigma_px: of its sides.
        has_foot: whether the lower edge is visible.
    """
    width_m, width_sigma = width
    (left, _), (right, bottom) = corners[0].tolist(), corners[2].tolist()
    by_width = perspective.locate_upright(corners, width_m)
    share = math.hypot(width_sigma, 1.4 * edge_sigma_px / max(right - left, 1.0))
    ahead_m, variance = by_width.ahead_m, (share * by_width.ahead_m) ** 2
    foot = perspective.locate_on_road((left + right) / 2, bottom) if has_foot else None
    if foot is not None:
        # The ray descends by height / distance: an error of that slope counts distance times, by
        # the greater distance, or a pitch that brings a far vehicle near would make it look sure.
        slope_sigma = math.hypot(PITCH_SIGMA_RAD, edge_sigma_px / perspective.width_px(1.0, 1.0))
        distance_m = max(foot.ahead_m, ahead_m)
        foot_sigma_m = slope_sigma * distance_m**2 / perspective.mounting_height_m
        weight = variance / (variance + foot_sigma_m**2)
        ahead_m += weight * (foot.ahead_m - ahead_m)
        variance *= 1.0 - weight
    right_m = by_width.right_m * ahead_m / by_width.ahead_m
    sigma_m = math.sqrt(variance)
    return Detection(
        kind=DetectionKind.VEHICLE,
        corners_px=corners,
        position=RoadPosition(ahead_m, right_m, by_width.height_m),
        ahead_sigma_m=sigma_m,
        right_sigma_m=math.hypot(0.05 * width_m, sigma_m * right_m / ahead_m),
    )
