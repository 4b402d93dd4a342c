"""The range at which a plate can be read, and a vehicle found, by angle of view.

`python -m bench plate_range` prints the least width of a plate in the image; `python -m
bench.plate_range` writes distances into `docs/plates.md`, and beside it an image of the smallest
plates read rightly and the most confident errors. Measured on rendered plates, with every image
fault of `sim_rig.rendering.lens`, and corners as exact as the detector's.
"""

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt

from bench import Figure
from bench._tables import write_tables
from onboard.observations import ImageBox
from onboard.vision.plate_detector import PlateDetector
from onboard.vision.plate_reader import CERTAIN, PlateReader, PlateText
from onboard.vision.vehicle_detector import WIDTH_M
from onboard.vision.vehicle_network import WIDTH_PX
from sim_rig.rendering.lens import photograph
from sim_rig.rendering.plate_art import FORMATS, PlateFormat, draw_plate
from sim_rig.rendering.plate_texts import text_of
from sim_rig.rendering.scene import opaque, warp_onto

PAGE = Path(__file__).parents[1] / "docs" / "plates.md"
IMAGE = PAGE.parent / "pictures" / "plates-read.png"
WIDTHS_PX = (25, 32, 40, 50, 65, 85, 110)
FOCAL_LENGTHS_PX = (600, 800, 1100, 1500, 2200, 3300)
IMAGE_WIDTH_PX, IMAGE_HEIGHT_PX = 1280, 720
IMAGE_WIDTHS_PX = (IMAGE_WIDTH_PX, 1920, 3840)
"""Of the table; focal lengths are of the first."""
VEHICLE_PX = 29.0
"""Width of a rear from which it is found (`python -m tools.camera_tables`), in the image that is
searched for vehicles."""
_PLATES = 100
_SHOWN, _COLUMNS = 10, 5
_ENOUGH = 0.8
"""Share of single images that must be read rightly; the vote over frames does the rest."""


@dataclass(frozen=True, slots=True, eq=False)
class Read:
    """One plate and its reading."""

    image: npt.NDArray[np.uint8]
    """The plate and its margin."""
    width_px: float
    truth: str
    text: PlateText

    @property
    def is_right(self) -> bool:
        """Whether the whole text is right."""
        return self.text.text == self.truth


def measure() -> Iterator[Figure]:
    """Least width for reading, beside that for finding, of each format."""
    cv2.setNumThreads(1)
    for name, plate_format in FORMATS.items():
        read, found = least_widths(plate_format, [])
        count = _PLATES * len(WIDTHS_PX)
        yield Figure(f"plate_range.{name}.read", read, "px", count, "least width found", found)


def least_widths(plate_format: PlateFormat, reads: list[Read]) -> tuple[float, float]:
    """Least widths in px from which on `_ENOUGH` of plates are read, and found; infinite if never.

    `reads` takes all that were read.
    """
    detector, reader, rng = PlateDetector(), PlateReader(), np.random.default_rng(7)
    read = found = math.inf
    for width_px in WIDTHS_PX:
        right = found_count = 0
        for _ in range(_PLATES):
            text = text_of("LLL####", rng, rare=0.0)
            image = _picture(text, plate_format, width_px, rng)
            plates = detector.find(image)
            found_count += bool(plates)
            texts = reader.read_many(image, [(plate.corners_px, None) for plate in plates[:1]])
            right += any(t.text == text and t.confidence >= CERTAIN / 2 for t in texts)
            reads += [
                Read(_cut(image, plate.box), width_px, text, got)
                for plate, got in zip(plates, texts, strict=False)
            ]
        read = min(read, width_px) if right >= _ENOUGH * _PLATES else math.inf
        found = min(found, width_px) if found_count >= _ENOUGH * _PLATES else math.inf
    return read, found


def _picture(
    text: str, plate_format: PlateFormat, width_px: float, rng: np.random.Generator
) -> npt.NDArray[np.uint8]:
    """Render a plate of that width on plain bodywork, in an image of a camera's size.

    A smaller image would be searched at a finer scale than a camera's.
    """
    height_px = width_px * plate_format.height_mm / plate_format.width_mm
    image = np.full((200, 320, 3), int(rng.integers(30, 200)), np.uint8)
    x, y = rng.uniform(60, 260 - width_px), rng.uniform(40, 160 - height_px)
    quad = np.asarray(
        [(x, y), (x + width_px, y), (x + width_px, y + height_px), (x, y + height_px)], np.float32
    )
    art = draw_plate(text, plate_format, 1.3 * width_px / plate_format.width_mm)
    warp_onto(image, opaque(art), quad)
    photo = photograph(image, rng, fine_px=width_px / 45)
    rows, columns = photo.shape[:2]
    above, beside = (IMAGE_HEIGHT_PX - rows) // 2, (IMAGE_WIDTH_PX - columns) // 2
    whole = cv2.copyMakeBorder(photo, above, above, beside, beside, cv2.BORDER_REPLICATE)
    return np.asarray(whole, np.uint8)


def _cut(image: npt.NDArray[np.uint8], box: ImageBox) -> npt.NDArray[np.uint8]:
    """The plate in a tile of 160 x 60 pixels."""
    x, y = box.centre_px
    half = (0.62 * box.w_px, 0.62 * box.w_px * 60 / 160)
    left, top = max(0, int(x - half[0])), max(0, int(y - half[1]))
    part = image[top : int(y + half[1]) + 1, left : int(x + half[0]) + 1]
    return np.asarray(cv2.resize(part, (160, 60), interpolation=cv2.INTER_NEAREST), np.uint8)


def sheet(reads: list[Read]) -> npt.NDArray[np.uint8]:
    """Draw two rows of the smallest plates read rightly, and two of the most confident errors."""
    hits = sorted((r for r in reads if r.is_right), key=lambda r: r.width_px)[:_SHOWN]
    misses = sorted((r for r in reads if not r.is_right), key=lambda r: -r.text.confidence)[:_SHOWN]
    tiles = []
    for shown in [*hits, *misses]:
        tile = np.full((100, 168, 3), 255, np.uint8)
        tile[2:62, 4:164] = shown.image
        reading = f"{shown.text.text or '-'} {shown.text.confidence:.2f}"
        truth = f"{shown.truth}, {shown.width_px:.0f} px"
        colour = (20, 130, 20) if shown.is_right else (30, 30, 200)
        for line, (words, ink) in enumerate(((truth, (0, 0, 0)), (reading, colour))):
            at = (4, 77 + 16 * line)
            cv2.putText(tile, words, at, cv2.FONT_HERSHEY_SIMPLEX, 0.42, ink, 1, cv2.LINE_AA)
        tiles.append(tile)
    tiles += [np.full((100, 168, 3), 255, np.uint8)] * (-len(tiles) % _COLUMNS)
    rows = [np.hstack(tiles[i : i + _COLUMNS]) for i in range(0, len(tiles), _COLUMNS)]
    return np.asarray(np.vstack(rows), np.uint8)


def table(reads: list[Read]) -> str:
    """Distances in m up to which vehicles and plates count, by angle of view and image width."""
    widths = {name: least_widths(shape, reads)[0] for name, shape in FORMATS.items()}
    heads = [f"{name} plate ({widths[name]:.0f} px), m" for name in FORMATS]
    lines = [
        f"| angle of view | focal length, px | vehicle, m | {' | '.join(heads)} |",
        "|---" * (3 + len(heads)) + "|",
    ]
    for focal_px in FOCAL_LENGTHS_PX:
        angle = 2 * math.degrees(math.atan(IMAGE_WIDTHS_PX[0] / 2 / focal_px))
        searched_px = focal_px * WIDTH_PX / IMAGE_WIDTHS_PX[0]
        scales = [width_px / IMAGE_WIDTHS_PX[0] for width_px in IMAGE_WIDTHS_PX]
        plates = [
            _slashed(focal_px * scale * shape.width_m / widths[name] for scale in scales)
            for name, shape in FORMATS.items()
        ]
        focals = _slashed(focal_px * scale for scale in scales)
        vehicle_m = searched_px * WIDTH_M / VEHICLE_PX
        lines.append(f"| {angle:.0f}° | {focals} | {vehicle_m:.0f} | {' | '.join(plates)} |")
    return "\n".join(lines) + "\n"


def _slashed(values: Iterable[float]) -> str:
    return "/".join(f"{value:.0f}" for value in values)


def main() -> None:
    """Write the table into the page, between its marks, and the sheet beside it."""
    reads: list[Read] = []
    rows = table(reads)
    cv2.imwrite(str(IMAGE), sheet(reads))
    write_tables(PAGE, {"range": rows})


if __name__ == "__main__":
    main()
