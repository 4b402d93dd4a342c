"""Number plates as sightings: found, read, and put into metres by their width."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
import numpy.typing as npt

from onboard.observations import ImageBox
from onboard.vision.blue_band import with_band
from onboard.vision.identity import LEAST_LENGTH
from onboard.vision.perspective import Corners, Perspective
from onboard.vision.plate_detector import FoundPlate
from onboard.vision.plate_ends import refine_ends
from onboard.vision.plate_formats import PlateKinds
from onboard.vision.plate_observation import Cue, Followed, Search, Sighting
from onboard.vision.plate_reader import PlateText
from onboard.vision.syntax import PlateSyntax

Image = npt.NDArray[np.uint8]
"""(h, w, 3), BGR."""

WIDTH_SIGMA_PX, WIDTH_SIGMA, BLUR_PX = 0.6, 0.015, 12.0
"""Of a found plate's width: in pixels; as a share of it; and, cubed by that share, what comes to
that of small plates. In photographs made smaller the widths scatter by 3 to 8 % at 42 to 31 px, and
by 4 to 6 % at 27 px, where 9 % are said."""
LEAST_PX = 24.0
"""Of narrower plates the detector finds pieces."""
SURE_SCORE = 0.7
"""Of a plate that cannot be read: nine in ten real ones have more, patches of road less."""
LEAST_TEXT_CONFIDENCE = 0.05
"""Of a text that is told at all; what the reader makes of things that are no plates has less."""
CUT_SIGMA, CUT_BELIEVED = 0.3, 0.5
"""Of a plate at the picture's rim, which may go on beyond it: of its width, and by how much its
text is believed. The rest of a number is read as surely as the whole: `B2414` at 0.96."""
LEAST_EUROPEAN_SHAPE = 3.3
"""Width by height from which a plate may have a blue band."""


class PlateFinder(Protocol):
    """Finds plates in a picture."""

    def find(self, image: Image, region: ImageBox | None = None) -> list[FoundPlate]:
        """Plates in the picture, or in a region of it, the surest first."""
        ...

    def find_again(self, image: Image, last: Corners) -> FoundPlate | None:
        """The plate that was at `last` in the frame before."""
        ...


class TextReader(Protocol):
    """Reads plates whose corners are known."""

    def read_many(self, image: Image, plates: list[Corners]) -> list[PlateText]:
        """The characters of each plate."""
        ...


class Plates:
    """Looks for plates."""

    def __init__(
        self,
        finder: PlateFinder,
        reader: TextReader,
        syntax: PlateSyntax,
        perspective: Perspective,
        kinds: PlateKinds,
    ) -> None:
        self._finder = finder
        self._reader = reader
        self._syntax = syntax
        self._perspective = perspective
        self._kinds = kinds

    def find(self, image: Image, search: Search) -> list[Sighting]:
        """Plates in the picture, or where they are followed."""
        found = list(self._found(image, search))
        readable = [each.plate.corners_px for each in found if each.is_to_read]
        texts = iter(self._reader.read_many(image, readable))
        sightings = [
            (each, self._sighting(image, each, next(texts) if each.is_to_read else None))
            for each in found
        ]
        # A search comes upon patches of road as well; what is followed was a plate before.
        return [
            sighting
            for each, sighting in sightings
            if search.followed is not None
            or not each.is_to_read
            or sighting.text
            or each.plate.score >= SURE_SCORE
        ]

    def _found(self, image: Image, search: Search) -> Iterator["_Found"]:
        """Each plate once."""
        looks = (
            [(self._finder.find(image, search.area), True)]
            if search.followed is None
            else [(self._follow(image, each), each.read_again) for each in search.followed]
        )
        boxes: list[ImageBox] = []
        for plates, to_read in looks:
            for plate in plates:
                whole = whole_plate(image, plate, self._perspective)
                if plate.width_px >= LEAST_PX and not any(_same(whole.box, box) for box in boxes):
                    boxes.append(whole.box)
                    known = any(_same(whole.box, box) for box in search.read_already)
                    yield _Found(whole, whole is not plate, to_read and not known)

    def _follow(self, image: Image, followed: Followed) -> list[FoundPlate]:
        if followed.cue is Cue.PLATE and followed.was_seen:
            plate = self._finder.find_again(image, followed.corners_px)
            return [] if plate is None else [plate]
        return self._finder.find(image, followed.region)

    def _sighting(self, image: Image, found: "_Found", text: PlateText | None) -> Sighting:
        plate = found.plate
        shape = max(self._perspective.shape(plate.corners_px), 1e-3)
        width_px = max(plate.width_px, 1.0)
        width_m = self._kinds.likely_width_m(shape, width_px, has_band=found.has_band)
        places = self._perspective.locate_kinds(
            refine_ends(image, plate.corners_px), self._kinds.widths_m
        )
        place = places[width_m]
        share = math.hypot(WIDTH_SIGMA_PX / width_px, WIDTH_SIGMA, (BLUR_PX / width_px) ** 3)
        believed = 1.0
        if _may_go_on(image, plate.corners_px):
            share, places, believed = CUT_SIGMA, {}, CUT_BELIEVED
        ahead_sigma_m = place.ahead_m * share
        sighting = Sighting(
            cue=Cue.PLATE,
            corners_px=plate.corners_px,
            place=place,
            ahead_sigma_m=ahead_sigma_m,
            right_sigma_m=math.hypot(width_m * share, share * place.right_m),
            was_read=text is not None,
            shape=shape,
            has_band=found.has_band,
            width_m=width_m,
            places=places,
        )
        if text is None or not self._may_be(text):
            return sighting
        return replace(
            sighting,
            text=text.text,
            confidence=believed * text.confidence,
            character_confidences=text.character_confidences,
            identity_confidence=believed * text.identity_confidence,
        )

    def _may_be(self, text: PlateText) -> bool:
        """Whether this may stand on a plate, as far as is known."""
        return (
            text.identity_confidence >= LEAST_TEXT_CONFIDENCE
            and len(text.text) >= LEAST_LENGTH
            and self._syntax.fits(text.text)
        )


@dataclass(frozen=True, slots=True, eq=False)
class _Found:
    """A whole plate, and what is known and wanted of it."""

    plate: FoundPlate
    has_band: bool
    is_to_read: bool


def whole_plate(image: Image, plate: FoundPlate, perspective: Perspective) -> FoundPlate:
    """The plate with its blue band; `plate` itself where it has none."""
    if perspective.shape(plate.corners_px) < LEAST_EUROPEAN_SHAPE:
        return plate
    corners_px = with_band(image, plate.corners_px)
    return plate if corners_px is plate.corners_px else FoundPlate(corners_px, plate.score)


def _may_go_on(image: Image, corners_px: Corners) -> bool:
    """Whether the plate reaches the picture's left or right rim; `corners_px` as far as is seen."""
    columns_px = corners_px[:, 0]
    return bool(columns_px.min() <= 1.0 or columns_px.max() >= image.shape[1] - 1.0)


def _same(one: ImageBox, other: ImageBox) -> bool:
    """Whether the middle of one lies in the other: regions overlap."""
    (x, y) = one.centre_px
    return other.x_px <= x <= other.x_px + other.w_px and other.y_px <= y <= other.y_px + other.h_px
