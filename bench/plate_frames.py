"""Photographed plates over twelve frames, as a track reads them.

`python -m bench plate_frames` prints the figures; `python -m bench.plate_frames` writes the table
in `docs/plates.md`. Each photograph is scaled to a plate of some width and shown twelve times,
moved by up to 1.5 pixels, turned by some tenths of a degree and 2 % larger at the end, with noise
and JPEG. The shipped detector and reader follow it. The photographs are those of `bench.plates`.
Those with an even checksum of their name fitted the bounds of certainty (`plate_posterior`), the
others judge them.
"""

import math
import zlib
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import cv2
import numpy as np

from bench import Figure
from bench._tables import write_tables
from bench.plates import REGIONS, Photograph, photographs
from onboard.observations import ImageBox
from onboard.vision.look_alikes import folded
from onboard.vision.plate_detector import (
    LEAST_SCORE_AGAIN,
    Image,
    PlateDetection,
    PlateDetector,
)
from onboard.vision.plate_posterior import PlatePosterior
from onboard.vision.plate_reader import PlateReader
from onboard.vision.plate_views import PlateViews
from onboard.vision.plates import MIN_PX
from onboard.vision.vehicle_finder import overlap

PAGE = Path(__file__).parents[1] / "docs" / "plates.md"
FRAMES, FPS = 12, 15.0
CANDIDATES = 16
DRIFT_PX, TURN_DEG, GROWTH, NOISE = 1.5, 0.3, 0.02, 2.0
"""Largest shift of a frame, sigma of its turn, growth over all frames, and sigma of the noise in
grey levels."""
_FINE = 4
"""Pixels each way that are averaged to one, as in a sensor."""


@dataclass(frozen=True, slots=True)
class Condition:
    """How wide the plate is, and what the camera does to it."""

    width_px: int
    fault: str = ""
    gamma: float = 1.0
    blur_px: float = 0.0
    jpeg_quality: int = 90

    @property
    def name(self) -> str:
        """As in the table."""
        return f"{self.width_px} px{self.fault and ', ' + self.fault}"

    def faulty(self, image: Image, rng: np.random.Generator) -> Image:
        """The image as the camera delivers it."""
        seen = 255.0 * (image.astype(np.float32) / 255.0) ** self.gamma
        if self.blur_px:
            seen = cv2.GaussianBlur(seen, (0, 0), self.blur_px).astype(np.float32)
        seen += rng.normal(0.0, NOISE, seen.shape).astype(np.float32)
        quality = [cv2.IMWRITE_JPEG_QUALITY, self.jpeg_quality]
        data = cv2.imencode(".jpg", np.clip(seen, 0, 255).astype(np.uint8), quality)[1]
        return np.asarray(cv2.imdecode(data, cv2.IMREAD_COLOR), np.uint8)


CONDITIONS = (
    Condition(20),
    Condition(25),
    Condition(36),
    Condition(65),
    Condition(80, "JPEG 30", jpeg_quality=30),
    Condition(100),
    Condition(100, "gamma 2.5", gamma=2.5),
    Condition(100, "blurred by 1.7 px", blur_px=1.7),
)


@dataclass(frozen=True, slots=True)
class PlateAnswer:
    """What twelve frames of one photograph say."""

    photograph: Photograph
    is_candidate: bool
    """Whether the true text is among the likeliest (O and 0, I and 1 being equal)."""
    certain: str | None

    @property
    def is_certain(self) -> bool:
        """Whether the true text is certain."""
        return self.certain is not None and folded(self.certain) == folded(self.photograph.text)

    @property
    def is_wrong(self) -> bool:
        """Whether another text is."""
        return self.certain is not None and not self.is_certain

    @property
    def judges(self) -> bool:
        """Whether the photograph did not fit the bounds of certainty."""
        return judges(self.photograph)


def judges(photograph: Photograph) -> bool:
    """Whether a photograph judges what others have fitted."""
    return _seed(photograph) % 2 == 1


def _seed(photograph: Photograph) -> int:
    return zlib.crc32(photograph.file.name.encode())


class Recognition:
    """Follows the plate of one photograph after the other."""

    def __init__(self) -> None:
        self._first = PlateDetector(least_score=LEAST_SCORE_AGAIN)
        self._again = PlateDetector()
        self._reader = PlateReader()
        self.begin()

    def begin(self) -> None:
        """Forget the plate: the next frame is of another photograph."""
        self.posterior = PlatePosterior()
        self._views: PlateViews | None = None
        self._last: PlateDetection | None = None

    def receive_frame(self, image: Image, box: ImageBox, stamp_s: float) -> None:
        """Read the plate in one frame; `box` is where the photograph has it."""
        self._last = self._found(image, box)
        if self._last is not None and self._last.width_px >= MIN_PX:
            (text,) = self._reader.read_many(image, [(self._last.corners_px, self._views)])
            self.posterior.update(text.candidates, stamp_s, self._last.box.w_px)
            self._views = text.views or self._views

    def _found(self, image: Image, box: ImageBox) -> PlateDetection | None:
        """The plate where it was before, or else where the photograph has it."""
        if self._last is not None:
            found = self._again.find_again(image, self._last.corners_px)
            if found is not None:
                return found
        there = (each for each in self._first.find(image) if overlap(each.box, box) > 0.0)
        return next(there, None)


def answers(condition: Condition) -> Iterator[PlateAnswer]:
    """What is read of each photograph with a plate that is at least as wide."""
    for photograph, number, posterior in followed(condition):
        if number == FRAMES:
            texts = [folded(each.text) for each in posterior.candidates(CANDIDATES)]
            is_candidate = folded(photograph.text) in texts
            yield PlateAnswer(photograph, is_candidate, posterior.certain_text)


def followed(
    condition: Condition, last: int = FRAMES
) -> Iterator[tuple[Photograph, int, PlatePosterior]]:
    """What has been read of each such photograph after 1, 2, ... `last` frames."""
    cv2.setNumThreads(1)
    recognition = Recognition()
    for photograph in photographs():
        if photograph.box.w_px < condition.width_px:
            continue
        recognition.begin()
        pictures = islice(frames(photograph, condition), last)
        for number, (image, box) in enumerate(pictures, start=1):
            recognition.receive_frame(image, box, (number - 1) / FPS)
            yield photograph, number, recognition.posterior


def frames(photograph: Photograph, condition: Condition) -> Iterator[tuple[Image, ImageBox]]:
    """Each frame, around the plate, and the plate's box in it."""
    rng = np.random.default_rng(_seed(photograph))
    image = np.asarray(cv2.imread(str(photograph.file)), np.uint8)
    scale = condition.width_px / photograph.box.w_px
    coarse = min(1.0, _FINE * scale)
    if coarse < 1.0:
        image = np.asarray(
            cv2.resize(image, None, fx=coarse, fy=coarse, interpolation=cv2.INTER_AREA), np.uint8
        )
    middle = coarse * np.asarray(photograph.box.centre_px)
    size = np.asarray([_whole(5.12 * condition.width_px), _whole(3.2 * condition.width_px)])
    height_px = condition.width_px * photograph.box.h_px / photograph.box.w_px
    for index in range(FRAMES):
        shift = rng.uniform(-DRIFT_PX, DRIFT_PX, 2)
        enlarge = _FINE * scale / coarse * (1.0 + GROWTH * index / FRAMES)
        turn = math.radians(rng.normal(0.0, TURN_DEG))
        across, along = enlarge * math.cos(turn), enlarge * math.sin(turn)
        matrix = np.array([[across, -along], [along, across]])
        offset = (size / 2 + shift) * _FINE - matrix @ middle
        fine = cv2.warpAffine(
            image,
            np.column_stack([matrix, offset]),
            (int(size[0]) * _FINE, int(size[1]) * _FINE),
            borderMode=cv2.BORDER_REFLECT,
        )
        seen = cv2.resize(fine, (int(size[0]), int(size[1])), interpolation=cv2.INTER_AREA)
        left_px, top_px = size / 2 + shift - (condition.width_px / 2, height_px / 2)
        box = ImageBox(float(left_px), float(top_px), condition.width_px, height_px)
        yield condition.faulty(np.asarray(seen, np.uint8), rng), box


def _whole(side_px: float) -> int:
    """A multiple of 32 pixels."""
    return 32 * math.ceil(side_px / 32)


def measure() -> Iterator[Figure]:
    """Shares of plates that are candidates, and that are certain, by condition."""
    for condition in CONDITIONS:
        found = list(answers(condition))
        for name, count in (
            ("candidates", sum(each.is_candidate for each in found)),
            ("certain", sum(each.is_certain for each in found)),
            ("wrong", sum(each.is_wrong for each in found)),
        ):
            label = f"plate_frames.{condition.name}.{name}"
            yield Figure(label, count / len(found), "per plate", len(found), "all plates", 1.0)


def table(results: Iterable[tuple[Condition, Sequence[PlateAnswer]]]) -> str:
    """One row a condition, as Markdown."""
    heads = "plate", *(f"{each}, in {CANDIDATES}" for each in REGIONS), "certain", "wrong"
    lines = [f"| {' | '.join(heads)} |", "|---" * len(heads) + "|"]
    for condition, found in results:
        regions = (
            _share([each.is_candidate for each in found if each.photograph.region == region])
            for region in REGIONS
        )
        judging = [each for each in found if each.judges]
        certain = _share([each.is_certain for each in judging])
        wrong = f"{sum(each.is_wrong for each in judging)} of {len(judging)}"
        lines.append(f"| {' | '.join((condition.name, *regions, certain, wrong))} |")
    return "\n".join(lines) + "\n"


def _share(are: Sequence[bool]) -> str:
    return f"{sum(are) / len(are):.0%}" if are else "-"


def main() -> None:
    """Write the table into the page, between its marks."""
    results = ((condition, list(answers(condition))) for condition in CONDITIONS)
    write_tables(PAGE, {"frames": table(results)})


if __name__ == "__main__":
    main()
