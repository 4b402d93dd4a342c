"""Vehicles in an image, by two networks: one has seen photographs, the other rendered streets.

The first finds vehicles on real roads, the second tells their rears from their sides. Neither is
sure by itself where a vehicle is small or dark, and they err in different places: the probabilities
that there is none are multiplied. On the labelled frames of the clips, with rendered streets, no
rule of three thresholds that was tried found more vehicles with as few false boxes.
"""

import math
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from onboard.observations import ImageBox
from onboard.vision.nanodet import NanoDet, input_scale
from onboard.vision.vehicle_network import LEAST_SCORE, WIDTH_PX, StreetNetwork, VehicleBox

_LEAST_SINGLE = 0.15
"""Score of one network below which it says nothing."""
_SAME_OVERLAP = 0.4
"""Intersection over union from which boxes of the two networks are of one vehicle."""
_BESIDE, _ABOVE, _BELOW = 1.5, 1.5, 1.0
"""What is searched around a rear to each side, above and below, in its widths: networks need the
surroundings. With half as much, 38 of 44 leads of the labelled clip `small-leads` are found, with
this 40, as by searches of the whole picture."""
_INNER_PX = 2.0
"""What is nearer to a side of such a part, which is no side of the image, may be cut by it."""


class VehicleFinder:
    """Both networks, loaded once; not to be shared between threads."""

    def __init__(self, *, least_score: float = LEAST_SCORE) -> None:
        """Load the networks.

        Args:
            least_score: of a vehicle that is reported.
        """
        single = min(_LEAST_SINGLE, least_score)
        self._photographs = NanoDet(least_score=single)
        self._streets = StreetNetwork(least_score=single)
        self._least_score = least_score

    def find(
        self,
        image: npt.NDArray[np.uint8],
        rear: ImageBox | None = None,
        most_scale: float = math.inf,
    ) -> list[VehicleBox]:
        """Vehicles in an image, highest score first.

        Args:
            image: (h, w, 3), BGR.
            rear: a vehicle's; only what is around it is searched. `None` searches all.
            most_scale: to which the image is enlarged, or from which on it is reduced, at most.
        """
        height, width = image.shape[:2]
        scales = min(input_scale(width, height), most_scale), min(WIDTH_PX / width, most_scale)
        if rear is not None:
            return self._find_around(image, rear, scales)
        return self._found(image, scales)

    def _found(self, image: npt.NDArray[np.uint8], scales: tuple[float, float]) -> list[VehicleBox]:
        of_photographs, of_streets = scales
        found = merged(
            self._photographs.find(image, of_photographs), self._streets.find(image, of_streets)
        )
        return [vehicle for vehicle in found if vehicle.score >= self._least_score]

    def _find_around(
        self, image: npt.NDArray[np.uint8], rear: ImageBox, scales: tuple[float, float]
    ) -> list[VehicleBox]:
        height, width = image.shape[:2]
        left, top, right, bottom = part_around(rear, (width, height))
        part = image[top : max(top, bottom), left : max(left, right)]
        if part.size == 0:
            return []
        inner = (
            _INNER_PX if left > 0 else -math.inf,
            _INNER_PX if top > 0 else -math.inf,
            right - left - _INNER_PX if right < width else math.inf,
            bottom - top - _INNER_PX if bottom < height else math.inf,
        )
        return [
            _moved(vehicle, left, top)
            for vehicle in self._found(part, scales)
            if _is_inside(vehicle.box, inner)
        ]


def part_around(vehicle: ImageBox, size_px: tuple[int, int]) -> tuple[int, int, int, int]:
    """Left, top, right and bottom of what is searched around a vehicle in an image of this size."""
    width, height = size_px
    return (
        max(0, int(vehicle.x_px - _BESIDE * vehicle.w_px)),
        max(0, int(vehicle.y_px - _ABOVE * vehicle.w_px)),
        min(width, int(vehicle.x_px + (1 + _BESIDE) * vehicle.w_px) + 1),
        min(height, int(vehicle.y_px + vehicle.h_px + _BELOW * vehicle.w_px) + 1),
    )


def _is_inside(box: ImageBox, sides: tuple[float, float, float, float]) -> bool:
    """Whether it is between left, top, right and bottom."""
    left, top, right, bottom = sides
    is_across = left <= box.x_px and box.x_px + box.w_px <= right
    return is_across and top <= box.y_px and box.y_px + box.h_px <= bottom


def _moved(vehicle: VehicleBox, right_px: int, down_px: int) -> VehicleBox:
    box, ends = vehicle.box, vehicle.end_px
    return replace(
        vehicle,
        box=replace(box, x_px=box.x_px + right_px, y_px=box.y_px + down_px),
        end_px=ends and (ends[0] + right_px, ends[1] + right_px),
    )


def merged(photographs: list[VehicleBox], streets: list[VehicleBox]) -> list[VehicleBox]:
    """What either network found, with the box of the surer one, highest score first.

    Args:
        photographs: found by the network that has seen photographs, highest score first.
        streets: found by the one that has seen rendered streets.
    """
    found, alone = [], list(streets)
    for vehicle in photographs:
        same = max(alone, key=lambda other: overlap(vehicle.box, other.box), default=None)
        if same is None or overlap(vehicle.box, same.box) < _SAME_OVERLAP:
            found.append(vehicle)
            continue
        alone.remove(same)
        absences = 1 - vehicle.score, _absence(same)
        surer = vehicle if absences[0] < absences[1] else same
        found.append(replace(surer, score=1 - math.prod(absences)))
    found += [replace(vehicle, score=1 - _absence(vehicle)) for vehicle in alone]
    return sorted(found, key=lambda vehicle: -vehicle.score)


def _absence(vehicle: VehicleBox) -> float:
    """The network of rendered streets counts half: it takes more for vehicles than there are."""
    return math.sqrt(1 - vehicle.score)


def overlap(one: ImageBox, other: ImageBox) -> float:
    """Intersection over union."""
    width = min(one.x_px + one.w_px, other.x_px + other.w_px) - max(one.x_px, other.x_px)
    height = min(one.y_px + one.h_px, other.y_px + other.h_px) - max(one.y_px, other.y_px)
    if width <= 0.0 or height <= 0.0:
        return 0.0
    both = width * height
    return both / (one.w_px * one.h_px + other.w_px * other.h_px - both)
