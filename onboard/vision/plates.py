"""Detection of number plates: found, read, and located by their width."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Protocol

import cv2
import numpy as np
import numpy.typing as npt

from onboard.observations import ImageBox, PlateCandidate
from onboard.vision.blue_band import include_blue_band
from onboard.vision.detection import (
    LARGE_PX,
    Detection,
    DetectionKind,
    SearchPlan,
    TrackRegion,
)
from onboard.vision.perspective import Corners, Perspective, bounding_box
from onboard.vision.plate_detector import PlateDetection
from onboard.vision.plate_ends import refine_ends
from onboard.vision.plate_formats import PlateFormats
from onboard.vision.plate_posterior import MIN_LENGTH
from onboard.vision.plate_reader import Plates, PlateText
from onboard.vision.plate_views import PlateViews
from onboard.vision.syntax import PlateSyntax

Image = npt.NDArray[np.uint8]
"""(h, w, 3), BGR."""

WIDTH_SIGMA_PX, WIDTH_SIGMA, SMALL_PX = 0.6, 0.015, 12.0
"""Sigma of a detected plate's width: in pixels; as a share of the width; and for small plates as a
share, the cube of this width by the plate's, both in pixels. In photographs scaled down, widths
scatter by 3 to 8 % at 42 to 31 px, and by 4 to 6 % at 27 px, where 9 % are assumed."""
MIN_PX = 18.0
"""Least width of a plate; of narrower ones, the detector finds fragments."""
SURE_SCORE = 0.7
"""Score of a plate that is reported without a text: nine in ten real ones have more, patches of
road less."""
MIN_TEXT_CONFIDENCE = 0.05
"""Confidence of a text that is reported; readings of other objects have less."""
CUT_SIGMA, CUT_CONFIDENCE = 0.3, 0.5
"""Relative sigma of the width of a plate at the image's border, which may continue beyond it, and a
factor for the confidence of its text: the rest of a text is read as certainly as the whole, such as
`B2414` at 0.96."""
MIN_EUROPEAN_SHAPE = 3.3
"""Width by height from which a plate may have a blue band."""


class PlateFinder(Protocol):
    """Finds plates in an image."""

    def find(self, image: Image, region: ImageBox | None = None) -> list[PlateDetection]:
        """Plates in the image, or in a region of it, highest score first."""
        ...

    def find_again(self, image: Image, last: Corners) -> PlateDetection | None:
        """The plate that was at `last` in the frame before."""
        ...


class TextReader(Protocol):
    """Reads plates whose corners are known."""

    def read_many(self, image: Image, plates: Plates) -> list[PlateText]:
        """The reading of each plate."""
        ...


class PlateRecognizer:
    """Finds, reads and locates plates."""

    def __init__(
        self,
        finder: PlateFinder,
        reader: TextReader,
        syntax: PlateSyntax,
        perspective: Perspective,
        formats: PlateFormats,
    ) -> None:
        """Combine a finder and a reader.

        Args:
            finder: finds plates.
            reader: reads them.
            syntax: patterns of valid texts.
            perspective: of the camera.
            formats: formats of plates in this drive.
        """
        self._finder = finder
        self._reader = reader
        self._syntax = syntax
        self._perspective = perspective
        self._formats = formats

    def find(self, image: Image, plan: SearchPlan) -> list[Detection]:
        """Plates in an (h, w, 3) BGR image, in the regions of `plan`."""
        found = list(self._found(image, plan))
        readable = [(each.plate.corners_px, each.seen) for each in found if each.is_to_read]
        texts = iter(self._reader.read_many(image, readable))
        detections = [
            (each, self._detection(image, each, next(texts) if each.is_to_read else None))
            for each in found
        ]
        # A search of the whole frame finds patches of road too; a tracked plate was one before.
        return [
            detection
            for each, detection in detections
            if plan.tracked is not None
            or not each.is_to_read
            or detection.text
            or each.plate.score >= SURE_SCORE
        ]

    def _found(self, image: Image, plan: SearchPlan) -> Iterator["_Found"]:
        """Each plate once, though regions overlap."""
        searched: list[tuple[list[PlateDetection], TrackRegion | None]] = (
            [(self._search_all(image, plan), None)]
            if plan.tracked is None
            else [(self._search_region(image, each), each) for each in plan.tracked]
        )
        boxes: list[ImageBox] = []
        for plates, region in searched:
            for plate in plates:
                whole = whole_plate(image, plate, self._perspective)
                if plate.width_px >= MIN_PX and not any(_same(whole.box, box) for box in boxes):
                    boxes.append(whole.box)
                    track = region or _track_at(whole.box, plan.known)
                    yield _Found(
                        whole,
                        has_band=whole is not plate,
                        is_to_read=track is None or track.read_text,
                        seen=None if track is None else track.views,
                    )

    def _search_all(self, image: Image, plan: SearchPlan) -> list[PlateDetection]:
        """Plates in the whole image; those in a large one are then placed at its full size."""
        if image.shape[0] * image.shape[1] < LARGE_PX or not plan.finds_vehicles:
            return self._finder.find(image, plan.area)
        half = cv2.resize(image, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)
        area = plan.area and ImageBox(
            plan.area.x_px / 2, plan.area.y_px / 2, plan.area.w_px / 2, plan.area.h_px / 2
        )
        found = self._finder.find(np.asarray(half, np.uint8), area)
        again = [self._finder.find_again(image, 2 * each.corners_px) for each in found]
        return [
            PlateDetection(placed.corners_px, each.score)
            for each, placed in zip(found, again, strict=True)
            if placed is not None
        ]

    def _search_region(self, image: Image, followed: TrackRegion) -> list[PlateDetection]:
        if followed.kind is DetectionKind.PLATE and followed.was_detected:
            plate = self._finder.find_again(image, followed.corners_px)
            if plate is not None:
                return [plate]
        return self._finder.find(image, followed.region)

    def _detection(self, image: Image, found: "_Found", text: PlateText | None) -> Detection:
        plate = found.plate
        shape = max(self._perspective.shape(plate.corners_px), 1e-3)
        width_px = max(plate.width_px, 1.0)
        width_m = self._formats.likely_width_m(shape, width_px, has_band=found.has_band)
        positions = self._perspective.locate_widths(
            refine_ends(image, plate.corners_px), self._formats.widths_m
        )
        position = positions[width_m]
        share = math.hypot(WIDTH_SIGMA_PX / width_px, WIDTH_SIGMA, (SMALL_PX / width_px) ** 3)
        confidence = 1.0
        if _is_cut_off(image, plate.corners_px):
            share, positions, confidence = CUT_SIGMA, {}, CUT_CONFIDENCE
        ahead_sigma_m = position.ahead_m * share
        detection = Detection(
            kind=DetectionKind.PLATE,
            corners_px=plate.corners_px,
            position=position,
            ahead_sigma_m=ahead_sigma_m,
            right_sigma_m=math.hypot(width_m * share, share * position.right_m),
            was_read=text is not None,
            shape=shape,
            has_band=found.has_band,
            width_m=width_m,
            positions=positions,
        )
        if text is None:
            return detection
        candidates = tuple(
            PlateCandidate(each.text, confidence * each.probability)
            for each in text.candidates
            if self._syntax.fits(each.text)
        )
        detection = replace(detection, candidates=candidates, seen=found.seen, views=text.views)
        if not self._is_plausible(text):
            return detection
        return replace(
            detection,
            text=text.text,
            confidence=confidence * text.confidence,
            identity_confidence=confidence * text.identity_confidence,
        )

    def _is_plausible(self, text: PlateText) -> bool:
        """Whether a plate may have this text."""
        return (
            text.identity_confidence >= MIN_TEXT_CONFIDENCE
            and len(text.text) >= MIN_LENGTH
            and self._syntax.fits(text.text)
        )


@dataclass(frozen=True, slots=True, eq=False)
class _Found:
    """A plate with its band, whether it is to be read, and its views of earlier frames."""

    plate: PlateDetection
    has_band: bool
    is_to_read: bool
    seen: PlateViews | None


def whole_plate(image: Image, plate: PlateDetection, perspective: Perspective) -> PlateDetection:
    """Include the blue band in a plate; `plate` itself if it has none.

    Args:
        image: (h, w, 3) BGR.
        plate: as detected in it.
        perspective: of the camera.
    """
    if perspective.shape(plate.corners_px) < MIN_EUROPEAN_SHAPE:
        return plate
    corners_px = include_blue_band(image, plate.corners_px)
    return plate if corners_px is plate.corners_px else PlateDetection(corners_px, plate.score)


def _is_cut_off(image: Image, corners_px: Corners) -> bool:
    """Whether the plate reaches the image's left or right border."""
    columns_px = corners_px[:, 0]
    return bool(columns_px.min() <= 1.0 or columns_px.max() >= image.shape[1] - 1.0)


def _track_at(box: ImageBox, known: tuple[TrackRegion, ...]) -> TrackRegion | None:
    """The track whose plate was there."""
    return next((each for each in known if _same(box, bounding_box(each.corners_px))), None)


def _same(one: ImageBox, other: ImageBox) -> bool:
    """Whether the middle of one is in the other, as for plates found in overlapping regions."""
    (x, y) = one.centre_px
    return other.x_px <= x <= other.x_px + other.w_px and other.y_px <= y <= other.y_px + other.h_px
