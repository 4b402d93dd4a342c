"""Vehicles found in labelled photographs of roads, by the shipped detector or by a model of yours.

`python -m bench vehicle_photographs` prints the figures of the shipped detector, `python -m
bench.vehicle_photographs VISION.yaml` a table for the `vehicle_model` of that file as well. The
photographs are not part of the repository (`RIG_DATA` names their folder), and were used for
nothing but this measurement.
"""

import csv
import os
import sys
import time
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt

from bench import Figure
from bench.vehicles import FALSE_IOU, FOUND_IOU, LEAST_WIDTH_PX
from onboard.errors import UserError
from onboard.observations import ImageBox
from onboard.settings import load_settings
from onboard.vision.box_model import BoxModel
from onboard.vision.settings import BoxModelSettings, VisionSettings
from onboard.vision.vehicle_finder import VehicleFinder, overlap
from onboard.vision.vehicle_network import LEAST_SCORE

SIZES_PX = {"12 to 20 px": 20.0, "20 to 32 px": 32.0, "32 to 64 px": 64.0, "64 px and more": np.inf}
LOWEST_SCORE = 0.05
"""Score from which boxes count for the average precision."""

Image = npt.NDArray[np.uint8]
Scored = list[tuple[ImageBox, float]]
Truth = list[tuple[str, ImageBox]]


@dataclass(slots=True)
class Photographs:
    """Counts over all photographs, of vehicles of `LEAST_WIDTH_PX` and more."""

    pictures: int = 0
    vehicles: dict[str, int] = field(default_factory=lambda: dict.fromkeys(SIZES_PX, 0))
    found: dict[str, int] = field(default_factory=lambda: dict.fromkeys(SIZES_PX, 0))
    false: int = 0
    """Boxes on nothing that is labelled."""
    scored: list[tuple[float, bool]] = field(default_factory=list)
    """Score of each box, and whether it is a vehicle's."""
    seconds: float = 0.0

    @property
    def share(self) -> float:
        """Share of the vehicles that are found."""
        return sum(self.found.values()) / sum(self.vehicles.values())

    @property
    def average_precision(self) -> float:
        """Area below precision over recall, the precision made monotonic."""
        hits = np.array([hit for _, hit in sorted(self.scored, reverse=True)])
        found = np.cumsum(hits)
        precision = np.maximum.accumulate((found / np.arange(1, len(hits) + 1))[::-1])[::-1]
        return float(precision[hits].sum() / sum(self.vehicles.values()))


def pictures() -> Iterator[tuple[Image, Truth]]:
    """Photographs with their boxes by kind."""
    root = Path(os.environ.get("RIG_DATA", Path(__file__).parents[2] / "shared" / "data"))
    boxes: defaultdict[str, Truth] = defaultdict(list)
    with (root / "vehicles" / "boxes.csv").open(newline="", encoding="utf-8") as table:
        for row in csv.DictReader(table):
            sides = (float(row[name]) for name in ("x_px", "y_px", "w_px", "h_px"))
            boxes[row["file"]].append((row["kind"], ImageBox(*sides)))
    for name, truth in boxes.items():
        yield np.asarray(cv2.imread(str(root / "vehicles" / name)), np.uint8), truth


def measured(find: Callable[[Image], Scored], least_score: float) -> Photographs:
    """Run a detector, whose boxes count as found from `least_score` on."""
    tally = Photographs()
    for image, truth in pictures():
        started = time.process_time()
        boxes = sorted(find(image), key=lambda each: -each[1])
        tally.seconds += time.process_time() - started
        tally.pictures += 1
        _count(tally, boxes, truth, least_score)
    return tally


def _count(tally: Photographs, boxes: Scored, truth: Truth, least_score: float) -> None:
    wanted = [box for kind, box in truth if kind == "vehicle" and box.w_px >= LEAST_WIDTH_PX]
    sure = [box for box, score in boxes if score >= least_score]
    tally.false += sum(all(overlap(box, one) < FALSE_IOU for _, one in truth) for box in sure)
    for box in wanted:
        size = next(name for name, below_px in SIZES_PX.items() if box.w_px < below_px)
        tally.vehicles[size] += 1
        tally.found[size] += any(overlap(each, box) >= FOUND_IOU for each in sure)
    free = list(wanted)
    for box, score in boxes:
        best = max(free, key=lambda one: overlap(box, one), default=None)
        if best is not None and overlap(box, best) >= FOUND_IOU:
            free.remove(best)
            tally.scored.append((score, True))
        elif all(overlap(box, one) < FALSE_IOU for _, one in truth if one not in wanted):
            tally.scored.append((score, False))


def shipped() -> Photographs:
    """Results of the shipped detector."""
    finder = VehicleFinder(least_score=LOWEST_SCORE)
    return measured(lambda image: [(v.box, v.score) for v in finder.find(image)], LEAST_SCORE)


def of_the_user(settings: BoxModelSettings) -> Photographs:
    """Results of a model of the user's."""
    lowest = settings.model_copy(update={"least_score": LOWEST_SCORE})
    return measured(BoxModel(lowest, "vision.vehicle_model").find, settings.least_score)


def measure() -> Iterator[Figure]:
    """Shares found by size, false boxes a picture, and the average precision."""
    cv2.setNumThreads(1)
    ours = shipped()
    aims = "the aim"
    vehicles = sum(ours.vehicles.values())
    name = "vehicle_photographs"
    yield Figure(f"{name}.found", ours.share, "per vehicle", vehicles, aims, 0.75)
    yield Figure(f"{name}.false", ours.false / ours.pictures, "a picture", ours.pictures, aims, 0.5)
    yield Figure(f"{name}.average_precision", ours.average_precision, "", vehicles, aims, 0.7)


def table(rows: Mapping[str, Photographs]) -> str:
    """One row a detector, as Markdown."""
    heads = "detector", "found", *SIZES_PX, "false a picture", "AP", "ms a picture"
    lines = [f"| {' | '.join(heads)} |", "|---" * len(heads) + "|"]
    for name, each in rows.items():
        sizes = (f"{each.found[size]}/{each.vehicles[size]}" for size in SIZES_PX)
        false, ms = each.false / each.pictures, 1e3 * each.seconds / each.pictures
        cells = f"{each.share:.0%}", *sizes, f"{false:.2f}", f"{each.average_precision:.2f}"
        lines.append(f"| {' | '.join((name, *cells, f'{ms:.0f}'))} |")
    return "\n".join(lines)


def main() -> None:
    """Print the table."""
    cv2.setNumThreads(1)
    rows = {"shipped": shipped()}
    for path in map(Path, sys.argv[1:]):
        model = load_settings(path, VisionSettings).vehicle_model
        if model is None:
            raise UserError(f"{path}: vehicle_model: missing")
        rows[path.stem] = of_the_user(model)
    print(table(rows))


if __name__ == "__main__":
    main()
