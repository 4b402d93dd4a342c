"""AR tags: what the paper's model cars carry in the place of plates."""

import math

import cv2
import numpy as np
import numpy.typing as npt

from onboard.observations import ImageBox
from onboard.vision.edges import refine_sides
from onboard.vision.perspective import Corners, Perspective
from onboard.vision.plate_observation import Cue, Search, Sighting

LEAST_SIDE_PX = 16
"""Of a region in which a tag may be."""
SQUARE = (0.7, 1.4)
"""Width by height of what may be a tag: leaves and railings make other quads."""
SMALL_REGION_PX = 200
"""A region narrower than this is looked at enlarged."""
LEAST_WHITE_CELLS = 5
"""Of a tag that is believed: number 17 of `4X4_50` is one white square on black, as a dark window
with a lamp in it is, and some larger dictionaries have barer ones."""
EDGE_REACH = 0.15
"""Share of a tag's side in which its edge is looked for: less than a cell, a sixth."""
SIDE_SIGMA_PX = 0.2
"""Of a side with refined edges: 0.05 to 0.2 on rendered pictures with blur and noise."""


class TagFinder:
    """Finds ArUco tags of one dictionary; their text is `TAG<n>`."""

    def __init__(self, dictionary: str, side_m: float, perspective: Perspective) -> None:
        parameters = cv2.aruco.DetectorParameters()
        # A tag of 10 px has cells of under 2 px: more samples a cell decode it more often.
        parameters.perspectiveRemovePixelPerCell = 8
        parameters.minMarkerPerimeterRate = 0.02
        number = int(getattr(cv2.aruco, f"DICT_{dictionary}"))
        tags = cv2.aruco.getPredefinedDictionary(number)
        self._detector = cv2.aruco.ArucoDetector(tags, parameters)
        cells = tags.markerSize + 2  # with the border, all black
        self._bare = {
            tag
            for tag in range(len(tags.bytesList))
            if np.count_nonzero(cv2.aruco.generateImageMarker(tags, tag, cells)) < LEAST_WHITE_CELLS
        }
        self._side_m = side_m
        self._perspective = perspective

    def find(self, image: npt.NDArray[np.uint8], search: Search) -> list[Sighting]:
        """Tags in the picture, or where tags were."""
        regions: list[ImageBox | None] = [search.area]
        if search.followed is not None:
            regions = [each.region for each in search.followed if each.cue is Cue.TAG]
        found: dict[int, Sighting] = {}
        for region in regions:
            for number, corners_px in self._quads(image, region):
                if SQUARE[0] <= self._perspective.shape(corners_px) <= SQUARE[1]:
                    found.setdefault(number, self._sighting(corners_px, number))
        return list(found.values())

    def _quads(
        self, image: npt.NDArray[np.uint8], region: ImageBox | None
    ) -> list[tuple[int, Corners]]:
        left, top, scale = 0, 0, 1
        part = image
        if region is not None:
            left, top = max(0, int(region.x_px)), max(0, int(region.y_px))
            right, bottom = int(region.x_px + region.w_px), int(region.y_px + region.h_px)
            part = image[top : max(top, bottom), left : max(left, right)]
            scale = 2 if part.shape[1] < SMALL_REGION_PX else 1
        if min(part.shape[:2]) < LEAST_SIDE_PX:
            return []
        part = np.asarray(cv2.cvtColor(part, cv2.COLOR_BGR2GRAY), np.uint8)
        view = cv2.resize(part, None, fx=scale, fy=scale, interpolation=cv2.INTER_CUBIC)
        quads, numbers, _ = self._detector.detectMarkers(view)
        if numbers is None:
            return []
        corner = np.array([left, top], np.float32)
        found = []
        for quad, number in zip(quads, numbers.ravel(), strict=True):
            if int(number) in self._bare:
                continue
            # OpenCV counts from the middle of the first pixel, the calibration from its corner.
            corners_px = _upright(np.asarray((quad[0] + 0.5) / scale - 0.5, np.float32))
            side_px = float(np.hypot(*(corners_px[1] - corners_px[0])))
            corners_px = refine_sides(part, corners_px, min(4.0, max(1.0, EDGE_REACH * side_px)))
            found.append((int(number), np.asarray(corners_px + corner + 0.5, np.float32)))
        return found

    def _sighting(self, corners_px: Corners, number: int) -> Sighting:
        # A tag is square: with this width, its height counts as much as its width.
        both_m = self._side_m * math.sqrt(self._perspective.shape(corners_px))
        place = self._perspective.locate_upright(corners_px, both_m)
        side_px = self._perspective.width_px(self._side_m, max(place.ahead_m, 1e-3))
        ahead_sigma_m = place.ahead_m * SIDE_SIGMA_PX / side_px
        right_sigma_m = math.hypot(
            self._side_m * SIDE_SIGMA_PX / side_px, ahead_sigma_m * place.right_m / place.ahead_m
        )
        return Sighting(
            cue=Cue.TAG,
            corners_px=corners_px,
            place=place,
            ahead_sigma_m=ahead_sigma_m,
            right_sigma_m=right_sigma_m,
            text=f"TAG{number}",
            confidence=1.0,
            identity_confidence=1.0,
        )


def _upright(corners_px: Corners) -> Corners:
    """The same corners, the top left one first, however the tag was turned when it was fixed."""
    sums = corners_px.sum(axis=1)
    return np.roll(corners_px, -int(np.argmin(sums)), axis=0)
