"""Vehicles found by the shipped detector: on rendered streets, and on frames of dashcam clips.

The streets are others than those of training; the clips and their labels are those of
`bench.clips`. No detector of vehicles comes with OpenCV, so that the references are the
plates that are found, by which leads are known otherwise.

`python -m bench vehicles` prints the figures, `python -m bench.vehicles` writes the table into
`docs/vision.md`.
"""

import os
import time
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from statistics import median

import cv2
import numpy as np
import numpy.typing as npt

from bench import Figure
from bench._tables import write_tables
from bench.clips import labels
from onboard.observations import ImageBox
from onboard.vision.plate_detector import PlateDetector
from onboard.vision.vehicle_finder import VehicleFinder, overlap
from sim_rig.rendering.street.street import SeenVehicle, StreetLight, random_street

PAGE = Path(__file__).parents[1] / "docs" / "vision.md"
STREETS, SIZE_PX = 40, (640, 360)
"""Streets for each light."""
LEAST_WIDTH_PX, LEAST_VISIBLE = 12.0, 0.6
"""Vehicles that count: at least so wide, and so much of them visible, in the picture."""
FOUND_IOU, FALSE_IOU = 0.4, 0.1
_SEED = 20261124
_RUNS = 9

Image = npt.NDArray[np.uint8]


@dataclass(slots=True)
class FoundVehicles:
    """Counts over some pictures."""

    pictures: int = 0
    vehicles: int = 0
    found: int = 0
    plates: int = 0
    """Vehicles on which a plate is found."""
    false: int = 0
    """Boxes on no vehicle."""

    @property
    def share(self) -> float:
        """Share of the vehicles that are found."""
        return self.found / max(1, self.vehicles)


def tally(
    pictures: Iterable[tuple[str, Image, list[tuple[str, ImageBox]], list[ImageBox]]],
) -> dict[str, FoundVehicles]:
    """Count by group.

    Args:
        pictures: group of each, image, vehicles to be found with their groups, and all vehicles.
    """
    finder, plates = VehicleFinder(), PlateDetector()
    found: defaultdict[str, FoundVehicles] = defaultdict(FoundVehicles)
    for group, image, wanted, others in pictures:
        boxes = [vehicle.box for vehicle in finder.find(image)]
        middles = [plate.box.centre_px for plate in plates.find(image)]
        found[group].pictures += 1
        found[group].false += sum(
            all(overlap(box, other) < FALSE_IOU for other in others) for box in boxes
        )
        for kind, box in wanted:
            for name in {group, kind}:
                found[name].vehicles += 1
                found[name].found += any(overlap(each, box) >= FOUND_IOU for each in boxes)
                found[name].plates += any(_contains(box, middle) for middle in middles)
    return dict(found)


def _contains(box: ImageBox, point_px: tuple[float, float]) -> bool:
    x, y = point_px
    return box.x_px <= x <= box.x_px + box.w_px and box.y_px <= y <= box.y_px + box.h_px


def streets() -> Iterator[tuple[str, Image, list[tuple[str, ImageBox]], list[ImageBox]]]:
    """Rendered pictures by light, with their vehicles by kind."""
    for number, light in enumerate(StreetLight):
        rng = np.random.default_rng([_SEED, number])
        for _ in range(STREETS):
            street = random_street(SIZE_PX, rng, light=light)
            boxes = [_clipped(vehicle) for vehicle in street.vehicles]
            wanted = [
                (str(vehicle.kind), box)
                for vehicle, box in zip(street.vehicles, boxes, strict=True)
                if box.w_px >= LEAST_WIDTH_PX and _visible_share(vehicle, box) >= LEAST_VISIBLE
            ]
            yield str(light), street.image, wanted, boxes


def _clipped(vehicle: SeenVehicle) -> ImageBox:
    left, top, right, bottom = vehicle.box_px
    left, right = (min(max(x, 0.0), SIZE_PX[0]) for x in (left, right))
    top, bottom = (min(max(y, 0.0), SIZE_PX[1]) for y in (top, bottom))
    return ImageBox(left, top, right - left, bottom - top)


def _visible_share(vehicle: SeenVehicle, box: ImageBox) -> float:
    left, top, right, bottom = vehicle.box_px
    return vehicle.visible * box.w_px * box.h_px / ((right - left) * (bottom - top))


def clips() -> Iterator[tuple[str, Image, list[tuple[str, ImageBox]], list[ImageBox]]]:
    """Labelled frames with their vehicles: ahead in the own lane within 60 m, and others."""
    folder = Path(os.environ.get("RIG_DATA", Path(__file__).parents[2] / "shared" / "data"))
    for clip, truth in labels().items():
        video = cv2.VideoCapture(str(folder / "clips" / f"{clip}.mp4"))
        for index in range(max(truth) + 1):
            _, image = video.read()
            if index in truth:
                frame, least_px = truth[index], LEAST_WIDTH_PX * image.shape[1] / SIZE_PX[0]
                wanted = [
                    ("ahead within 60 m" if box == frame.own else "farther or beside", box)
                    for box in frame.vehicles
                    if box.w_px >= least_px
                ]
                yield clip, np.asarray(image, np.uint8), wanted, list(frame.vehicles)


def milliseconds() -> tuple[float, float]:
    """Processor time of the vehicle detector and of the plate detector for one 1280x720 picture."""
    image = random_street((1280, 720), np.random.default_rng(_SEED)).image
    finds: tuple[Callable[[Image], object], ...] = VehicleFinder().find, PlateDetector().find
    times_ms: list[list[float]] = [[], []]
    for _ in range(_RUNS):
        for find, taken_ms in zip(finds, times_ms, strict=True):
            started = time.process_time()
            find(image)
            taken_ms.append(1e3 * (time.process_time() - started))
    return median(times_ms[0]), median(times_ms[1])


def measure() -> Iterator[Figure]:
    """Shares of vehicles found, false boxes, and milliseconds a picture."""
    cv2.setNumThreads(1)
    for group, found in (tally(streets()) | tally(clips())).items():
        reference = found.plates / max(1, found.vehicles)
        name = f"vehicles.{group.replace(' ', '_')}"
        plates = "share on which a plate is found"
        yield Figure(f"{name}.found", found.share, "per vehicle", found.vehicles, plates, reference)
        if found.pictures:
            false = found.false / found.pictures
            yield Figure(f"{name}.false", false, "per picture", found.pictures, "none", 1.0)
    ours_ms, plates_ms = milliseconds()
    yield Figure("vehicles.picture", ours_ms, "ms", _RUNS, "plate detector", plates_ms)


def table(groups: Mapping[str, FoundVehicles]) -> str:
    """One row a light, kind or clip, as Markdown."""
    lines = [
        "| pictures of | vehicles | found | false boxes a picture |",
        "|---|---|---|---|",
    ]
    # Pictures first, then the kinds of vehicles in them.
    for group, found in sorted(groups.items(), key=lambda each: each[1].pictures == 0):
        false = f"{found.false / found.pictures:.2f}" if found.pictures else ""
        lines.append(f"| {group} | {found.vehicles} | {found.share:.0%} | {false} |")
    return "\n".join(lines) + "\n"


def main() -> None:
    """Write the table into the page, between its marks."""
    cv2.setNumThreads(1)
    write_tables(PAGE, {"vehicles": table(tally(streets()) | tally(clips()))})


if __name__ == "__main__":
    main()
