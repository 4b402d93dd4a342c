"""Shares of real plates that are found and read, beside OpenCV's cascades with Tesseract.

`python -m bench plates` prints the figures; `python -m bench.plates` writes the tables in
`docs/plates.md`, the second of them over the same photographs scaled down. The photographs are not
part of the repository (`RIG_DATA` names their folder), and no network was trained on them.
"""

import csv
import importlib
import math
import os
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from bench import Figure
from bench._tables import write_tables
from onboard.observations import ImageBox
from onboard.tools.see.score import edit_distance
from onboard.vision.look_alikes import folded
from onboard.vision.plate_detector import LEAST_SCORE_AGAIN, Image, PlateDetector
from onboard.vision.plate_reader import CERTAIN, PlateReader
from onboard.vision.vehicle_finder import overlap

FOLDER = Path(__file__).parents[2] / "shared" / "data"
PAGE = Path(__file__).parents[1] / "docs" / "plates.md"
REGIONS = ("us", "eu", "br")
NARROW_PX, RANKS = (None, 45, 36, 30, 25), (1, 8, 16, 30)
"""Widths, and numbers of texts among which the true one is looked for; `None`: as photographed."""
_TESSDATA = Path("/usr/share/tesseract-ocr/5/tessdata")


@dataclass(frozen=True, slots=True)
class Reading:
    """One plate as found and read."""

    box: ImageBox
    text: str
    confidence: float


Way = Callable[[Image], list[Reading]]


@dataclass(frozen=True, slots=True)
class Photograph:
    """One photograph and the plate in it."""

    file: Path
    region: str
    box: ImageBox
    text: str


@dataclass(slots=True)
class Tally:
    """Results of one method on one region's photographs."""

    photographs: int = 0
    found: int = 0
    """Boxes that overlap the true one by at least half (intersection over union)."""
    exact: int = 0
    """The whole text right, end to end."""
    exact_and_certain: int = 0
    characters: int = 0
    characters_right: int = 0
    false_texts: int = 0
    """Texts of any confidence that are on no true plate."""
    certain_texts: int = 0
    """Certain texts of the true plate."""
    certain_and_wrong: int = 0
    certain_elsewhere: int = 0
    """Certain texts of other plates, for which there is no truth."""
    seconds: list[float] = field(default_factory=list)

    def add(self, photograph: Photograph, readings: list[Reading]) -> None:
        """Count one photograph's readings."""
        truth = photograph.text
        self.photographs += 1
        self.found += any(overlap(reading.box, photograph.box) >= 0.5 for reading in readings)
        self.exact += any(reading.text == truth for reading in readings)
        sure = [reading for reading in readings if reading.confidence >= CERTAIN]
        certain = [reading for reading in sure if overlap(reading.box, photograph.box) > 0]
        self.certain_elsewhere += len(sure) - len(certain)
        self.exact_and_certain += any(reading.text == truth for reading in certain)
        self.characters += len(truth)
        wrong = [edit_distance(reading.text, truth) for reading in readings]
        self.characters_right += len(truth) - min([*wrong, len(truth)])
        self.false_texts += sum(bool(r.text) and r.text != truth for r in readings)
        self.certain_texts += len(certain)
        self.certain_and_wrong += sum(reading.text != truth for reading in certain)


def measure() -> Iterator[Figure]:
    """Shares by region, each beside the baseline's (NaN without Tesseract); time a photograph."""
    way = cascade_and_tesseract_method()
    ours = score(dict.fromkeys(REGIONS, network_method()))
    baseline = score(dict.fromkeys(REGIONS, way)) if way is not None else None
    for region in REGIONS:
        mine, theirs = ours[region], baseline[region] if baseline is not None else None
        for name in ("found", "exact", "characters_right", "false_texts", "seconds"):
            yield Figure(
                f"plates.{region}.{name}",
                _share(mine, name),
                "s" if name == "seconds" else f"per {_OF.get(name, 'photograph')}",
                mine.characters if name in _OF else mine.photographs,
                "OpenCV cascades and Tesseract",
                _share(theirs, name) if theirs is not None else math.nan,
            )


_OF = {"characters_right": "character"}


def _share(tally: Tally, name: str) -> float:
    if name == "seconds":
        return float(np.median(tally.seconds))
    of = tally.characters if name in _OF else tally.photographs
    return float(getattr(tally, name) / of)


def network_method() -> Way:
    """The method of the car: the shipped detector and reader, one thread."""
    cv2.setNumThreads(1)
    detector, reader = PlateDetector(), PlateReader()

    def read(image: Image) -> list[Reading]:
        plates = detector.find(image)
        texts = reader.read_many(image, [(plate.corners_px, None) for plate in plates])
        return [
            Reading(plate.box, text.text, text.confidence)
            for plate, text in zip(plates, texts, strict=True)
        ]

    return read


def cascade_and_tesseract_method() -> Way | None:
    """The baseline: both of OpenCV's plate cascades, each find read by Tesseract as one line.

    `None` where Tesseract is not installed, which only this needs: `apt-get install tesseract-ocr`
    and `pip install tesserocr`.
    """
    try:
        tesserocr: Any = importlib.import_module("tesserocr")
        tesseract: Any = tesserocr.PyTessBaseAPI(path=str(_TESSDATA), psm=tesserocr.PSM.SINGLE_LINE)
    except (ImportError, RuntimeError):  # tesserocr raises the latter where there are no data
        return None
    tesseract.SetVariable("tessedit_char_whitelist", "ABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789")
    # The folder that the package itself names.
    models = Path(cv2.__file__).parent / "data"
    cascades = [
        cv2.CascadeClassifier(str(models / f"haarcascade_{name}.xml"))
        for name in ("russian_plate_number", "license_plate_rus_16stages")
    ]

    def read(image: Image) -> list[Reading]:
        grey = np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), np.uint8)
        readings = []
        for cascade in cascades:
            for x, y, w, h in cascade.detectMultiScale(grey, 1.1, 4):
                crop = grey[y : y + h, x : x + w]
                large = np.asarray(cv2.resize(crop, None, fx=96 / h, fy=96 / h), np.uint8)
                tesseract.SetImageBytes(
                    large.tobytes(), large.shape[1], large.shape[0], 1, large.shape[1]
                )
                text = tesseract.GetUTF8Text().strip().replace(" ", "")
                confidence = tesseract.MeanTextConf() / 100
                readings.append(Reading(ImageBox(x, y, w, h), text, confidence))
        return readings

    return read


def photographs() -> list[Photograph]:
    """The ground truth of each file.

    Raises:
        SystemExit: there are no recordings.
    """
    folder = Path(os.environ.get("RIG_DATA", FOLDER)) / "plates"
    if not folder.is_dir():
        raise SystemExit(f"no photographs at {folder} (RIG_DATA names the folder above it)")
    with (folder / "truth.csv").open(encoding="utf-8") as rows:
        return [
            Photograph(
                folder / row["file"],
                row["file"].split("/", 1)[0],
                ImageBox(*(float(row[name]) for name in ("x_px", "y_px", "w_px", "h_px"))),
                row["text"],
            )
            for row in csv.DictReader(rows)
        ]


def shrunk(photograph: Photograph, image: Image, width_px: float) -> tuple[Photograph, Image]:
    """The photograph scaled to a plate `width_px` wide.

    Args:
        photograph: with the box of its plate.
        image: (h, w, 3) BGR.
        width_px: of the plate in the result.
    """
    scale, box = width_px / photograph.box.w_px, photograph.box
    small = cv2.resize(image, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    sides = (scale * side for side in (box.x_px, box.y_px, box.w_px, box.h_px))
    return replace(photograph, box=ImageBox(*sides)), np.asarray(small, np.uint8)


def scaled_photographs(width_px: float | None = None) -> Iterator[tuple[Photograph, Image]]:
    """All photographs; with `width_px`, those with a wider plate, scaled to that width."""
    for photograph in photographs():
        if width_px is not None and photograph.box.w_px < width_px:
            continue
        image = np.asarray(cv2.imread(str(photograph.file)), np.uint8)
        yield (photograph, image) if width_px is None else shrunk(photograph, image, width_px)


def score(ways: Mapping[str, Way], width_px: float | None = None) -> dict[str, Tally]:
    """Results of every region's photographs, read by the method named for it."""
    tallies = {region: Tally() for region in REGIONS}
    for photograph, image in scaled_photographs(width_px):
        started = time.perf_counter()
        readings = ways[photograph.region](image)
        tallies[photograph.region].seconds.append(time.perf_counter() - started)
        tallies[photograph.region].add(photograph, readings)
    return tallies


def table_of_candidates() -> str:
    """How often the true text is among the likeliest of a single picture, as Markdown."""
    lines = [f"| width | {' | '.join(REGIONS)} |", "|---" * (len(REGIONS) + 1) + "|"]
    for width_px in NARROW_PX:
        found = candidate_counts(width_px)
        shares = (
            f"{'/'.join(f'{100 * count / photographs:.0f}' for count in counts)} of {photographs}"
            for photographs, counts in found.values()
        )
        name = "as photographed" if width_px is None else f"{width_px} px"
        lines.append(f"| {name} | {' | '.join(shares)} |")
    return "\n".join(lines) + "\n"


def candidate_counts(width_px: float | None) -> dict[str, tuple[int, list[int]]]:
    """Of each region, the photographs, and those with the truth among the texts of each rank."""
    cv2.setNumThreads(1)
    detector, reader = PlateDetector(least_score=LEAST_SCORE_AGAIN), PlateReader()
    found = {region: (0, [0] * len(RANKS)) for region in REGIONS}
    for photograph, image in scaled_photographs(width_px):
        plates = [
            plate for plate in detector.find(image) if overlap(plate.box, photograph.box) > 0.0
        ]
        texts = [
            [folded(candidate.text) for candidate in text.candidates]
            for text in reader.read_many(image, [(plate.corners_px, None) for plate in plates])
        ]
        photographs, counts = found[photograph.region]
        truth = folded(photograph.text)
        now = [any(truth in each[:rank] for each in texts) for rank in RANKS]
        counts = [count + is_there for count, is_there in zip(counts, now, strict=True)]
        found[photograph.region] = (photographs + 1, counts)
    return found


def table() -> str:
    """Results of both methods, by region, as Markdown."""
    heads = (
        *("region", "way", "found (IoU 0.5)", "exact", "exact and certain", "characters right"),
        *("false texts a photograph", "wrong among certain", "certain elsewhere"),
    )
    ways = {"ours": network_method(), "baseline": cascade_and_tesseract_method()}
    lines = [f"| {' | '.join(heads)} |", "|---" * len(heads) + "|"]
    for name, way in ways.items():
        if way is None:
            blanks = " not measured |" * (len(heads) - 2)
            lines.append(f"| all | {name} |{blanks}")
            continue
        for region, tally in score(dict.fromkeys(REGIONS, way)).items():
            lines.append(
                f"| {region} ({tally.photographs}) | {name} "
                f"| {tally.found / tally.photographs:.1%} | {tally.exact / tally.photographs:.1%} "
                f"| {tally.exact_and_certain / tally.photographs:.1%} "
                f"| {tally.characters_right / tally.characters:.1%} "
                f"| {tally.false_texts / tally.photographs:.2f} "
                f"| {tally.certain_and_wrong} of {tally.certain_texts} "
                f"| {tally.certain_elsewhere} |"
            )
    return "\n".join(lines) + "\n"


def main() -> None:
    """Write the tables into the page, between their marks."""
    write_tables(PAGE, {"scores": table(), "candidates": table_of_candidates()})


if __name__ == "__main__":
    main()
