"""Detection of ArUco tags, which the LCCA paper's model cars carry instead of plates."""

import math

import cv2
import numpy as np
import numpy.typing as npt

from onboard.observations import ImageBox, PlateCandidate
from onboard.vision.detection import LARGE_PX, Detection, DetectionKind, SearchPlan
from onboard.vision.edges import refine_sides
from onboard.vision.perspective import Corners, Perspective

MIN_SIDE_PX = 16
"""Least side of a region that is searched."""
SQUARE = (0.7, 1.4)
"""Width by height of a possible tag; leaves and railings form other quadrilaterals."""
SMALL_REGION_PX = 200
"""A region narrower than this is enlarged before the search."""
MIN_WHITE_CELLS = 5
"""White cells of a tag that is used: number 17 of `4X4_50` is one white square on black, like a
dark window with a lamp in it, and some larger dictionaries have tags with fewer."""
EDGE_REACH = 0.15
"""Distance in which a tag's edge is searched, as a share of its side: less than a cell, a sixth."""
SIDE_SIGMA_PX = 0.2
"""Sigma of a side with refined edges: 0.05 to 0.2 on rendered images with blur and noise."""


class TagDetector:
    """Detects ArUco tags of one dictionary; their text is `TAG<n>`."""

    def __init__(self, dictionary: str, side_m: float, perspective: Perspective) -> None:
        """Set up OpenCV's detector.

        Args:
            dictionary: name after OpenCV's `DICT_`.
            side_m: side of a tag's black square.
            perspective: of the camera.
        """
        parameters = cv2.aruco.DetectorParameters()
        # A tag of 10 px has cells below 2 px: more samples a cell decode it more often.
        parameters.perspectiveRemovePixelPerCell = 8
        parameters.minMarkerPerimeterRate = 0.02
        number = int(getattr(cv2.aruco, f"DICT_{dictionary}"))
        tags = cv2.aruco.getPredefinedDictionary(number)
        self._detector = cv2.aruco.ArucoDetector(tags, parameters)
        cells = tags.markerSize + 2  # with the border, all black
        self._bare = {
            tag
            for tag in range(len(tags.bytesList))
            if np.count_nonzero(cv2.aruco.generateImageMarker(tags, tag, cells)) < MIN_WHITE_CELLS
        }
        self._side_m = side_m
        self._perspective = perspective

    def find(self, image: npt.NDArray[np.uint8], plan: SearchPlan) -> list[Detection]:
        """Tags in an (h, w, 3) BGR image, in the regions of `plan`."""
        regions: list[ImageBox | None] = [plan.area]
        if plan.tracked is not None:
            regions = [each.region for each in plan.tracked if each.kind is DetectionKind.TAG]
        found: dict[int, Detection] = {}
        for region in regions:
            for number, corners_px in self._quads(image, region):
                if SQUARE[0] <= self._perspective.shape(corners_px) <= SQUARE[1]:
                    found.setdefault(number, self._detection(corners_px, number))
        return list(found.values())

    def _quads(
        self, image: npt.NDArray[np.uint8], region: ImageBox | None
    ) -> list[tuple[int, Corners]]:
        left, top, scale = 0, 0, 1.0
        part = image
        if region is not None:
            left, top = max(0, int(region.x_px)), max(0, int(region.y_px))
            right, bottom = int(region.x_px + region.w_px), int(region.y_px + region.h_px)
            part = image[top : max(top, bottom), left : max(left, right)]
            scale = 2.0 if part.shape[1] < SMALL_REGION_PX else 1.0
        if min(part.shape[:2]) < MIN_SIDE_PX:
            return []
        part = np.asarray(cv2.cvtColor(part, cv2.COLOR_BGR2GRAY), np.uint8)
        if part.size >= LARGE_PX:
            scale = 0.5
        way = cv2.INTER_AREA if scale < 1.0 else cv2.INTER_CUBIC
        view = cv2.resize(part, None, fx=scale, fy=scale, interpolation=way)
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

    def _detection(self, corners_px: Corners, number: int) -> Detection:
        # A tag is square: with this width, its height counts as much as its width.
        both_m = self._side_m * math.sqrt(self._perspective.shape(corners_px))
        position = self._perspective.locate_upright(corners_px, both_m)
        side_px = self._perspective.width_px(self._side_m, max(position.ahead_m, 1e-3))
        ahead_sigma_m = position.ahead_m * SIDE_SIGMA_PX / side_px
        right_sigma_m = math.hypot(
            self._side_m * SIDE_SIGMA_PX / side_px,
            ahead_sigma_m * position.right_m / position.ahead_m,
        )
        return Detection(
            kind=DetectionKind.TAG,
            corners_px=corners_px,
            position=position,
            ahead_sigma_m=ahead_sigma_m,
            right_sigma_m=right_sigma_m,
            text=(text := f"TAG{number}"),
            confidence=1.0,
            identity_confidence=1.0,
            candidates=(PlateCandidate(text, 1.0),),
        )


def _upright(corners_px: Corners) -> Corners:
    """The same corners with the top left one first, for a tag mounted at any turn."""
    sums = corners_px.sum(axis=1)
    return np.roll(corners_px, -int(np.argmin(sums)), axis=0)
