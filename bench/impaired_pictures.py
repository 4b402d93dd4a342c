"""Ranges in photographs that are disturbed by known amounts, beside the sigma that covers it.

`python -m bench.impaired_pictures` prints, for each disturbance, how many of the vehicles that are
found in the undisturbed photographs are found, and the rms of the logarithm of their range by that
in the undisturbed one. The photographs are not part of the repository (`RIG_DATA` names their
folder).
"""

import math
import os
from collections.abc import Callable, Iterator
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt

from onboard.observations import Impairment
from onboard.vision.detection import Detection, SearchPlan
from onboard.vision.perspective import Perspective
from onboard.vision.picture_watch import DARK_SIGMA, RANGE_SIGMA
from onboard.vision.settings import Calibration
from onboard.vision.vehicle_detector import VehicleDetector
from onboard.vision.vehicle_finder import VehicleFinder, overlap

Image = npt.NDArray[np.uint8]
KITTI = {
    "focal_x_px": 721.5,
    "focal_y_px": 721.5,
    "principal_x_px": 609.6,
    "principal_y_px": 172.9,
    "mounting_height_m": 1.65,
    "pitch_rad": 0.0,
}
"""Camera of the photographs (Geiger et al. 2012, "Are we ready for autonomous driving?")."""
TURNED_RAD = math.radians(4.0)
SAME_OVERLAP = 0.3


def gamma(image: Image) -> Image:
    """Darkened by a gamma of 2.5."""
    return np.asarray(cv2.LUT(image, (255 * (np.arange(256) / 255) ** 2.5).astype(np.uint8)))


def light(image: Image) -> Image:
    """With three times the light."""
    return np.asarray(np.clip(3.0 * image.astype(np.float32) + 20.0, 0, 255), np.uint8)


def moved(length_px: int) -> Callable[[Image], Image]:
    """Blurred by a motion sideways."""
    return lambda image: np.asarray(cv2.blur(image, (length_px, 1)), np.uint8)


def unfocused(image: Image) -> Image:
    """Blurred by a Gaussian of 3 px."""
    return np.asarray(cv2.GaussianBlur(image, (0, 0), 3.0), np.uint8)


DISTURBANCES: dict[str, tuple[Impairment | None, Callable[[Image], Image]]] = {
    "motion of 7 px": (Impairment.BLURRED, moved(7)),
    "motion of 9 px": (Impairment.BLURRED, moved(9)),
    "out of focus, 3 px": (Impairment.BLURRED, unfocused),
    "three times the light": (Impairment.OVER_EXPOSED, light),
    "gamma 2.5": (None, gamma),
    "turned down by 4 degrees": (Impairment.TURNED, lambda image: image),
}


def main() -> None:
    """Print a row a disturbance."""
    cv2.setNumThreads(1)
    root = Path(os.environ.get("RIG_DATA", Path(__file__).parents[2] / "shared" / "data"))
    files = sorted((root / "vehicles").glob("*.jpg"))
    images = [np.asarray(cv2.imread(str(file)), np.uint8) for file in files]
    finder = VehicleFinder()
    clear = [_found(finder, image, 0.0) for image in images]
    vehicles = sum(map(len, clear))
    for name, (impairment, disturb) in DISTURBANCES.items():
        pitch_rad = TURNED_RAD if impairment is Impairment.TURNED else 0.0
        ratios = [
            ratio
            for image, before in zip(images, clear, strict=True)
            for ratio in _log_ratios(before, _found(finder, disturb(image), pitch_rad))
        ]
        rms, middle = math.sqrt(np.square(ratios).mean()), math.exp(np.median(ratios))
        sigma = RANGE_SIGMA[impairment] if impairment else DARK_SIGMA
        print(
            f"{name}: {len(ratios)} of {vehicles}, range {middle - 1:+.1%}, rms {rms:.2f}, "
            f"sigma {sigma:.2f}",
            flush=True,
        )


def _found(finder: VehicleFinder, image: Image, pitch_rad: float) -> list[Detection]:
    height_px, width_px = image.shape[:2]
    values = KITTI | {"pitch_rad": pitch_rad, "principal_y_px": height_px * 172.9 / 375}
    perspective = Perspective(Calibration(width_px=width_px, height_px=height_px, **values))
    return VehicleDetector(finder, perspective).find(image, SearchPlan(vehicles=True))


def _log_ratios(before: list[Detection], now: list[Detection]) -> Iterator[float]:
    for vehicle in before:
        same = max(now, key=lambda other: overlap(vehicle.box, other.box), default=None)
        if same is not None and overlap(vehicle.box, same.box) >= SAME_OVERLAP:
            yield math.log(same.position.ahead_m / vehicle.position.ahead_m)


if __name__ == "__main__":
    main()
