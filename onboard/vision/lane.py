"""The host vehicle's lane: by its markings, and without these where the vehicle drives.

Its middle is at x(z) = offset + heading z + curvature z^2 / 2, to the right of the camera, z ahead:
the second-order form of a clothoid (Dickmanns and Mysliwetz 1992, "Recursive 3-D road and relative
ego-state recognition").
"""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from onboard.observations import Curvature, ImageBox
from onboard.vision.perspective import Perspective, RoadPosition

CAMERA_AHEAD_M = 2.0
"""From the point of the vehicle that moves along its axis, before the rear axle, to the camera."""

_Floats = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class LaneShape:
    """Shape of a lane relative to the camera."""

    width_m: float
    offset_m: float = 0.0
    heading_rad: float = 0.0
    curvature_1_m: float = 0.0

    def middle_m(self, ahead_m: float) -> float:
        """Position of the lane's middle at `ahead_m`, to the right of the camera."""
        return self.offset_m + ahead_m * (self.heading_rad + 0.5 * ahead_m * self.curvature_1_m)

    def moved(self, old: "LaneShape", new: "LaneShape", share: float) -> "LaneShape":
        """The shape after a part of it, `share` of the change from `old` to `new`, has moved."""
        return LaneShape(
            self.width_m + share * (new.width_m - old.width_m),
            self.offset_m + share * (new.offset_m - old.offset_m),
            self.heading_rad + share * (new.heading_rad - old.heading_rad),
            self.curvature_1_m + share * (new.curvature_1_m - old.curvature_1_m),
        )

    def towards(self, other: "LaneShape", share: float) -> "LaneShape":
        """The shape between this and `other`, by linear interpolation."""
        return self.moved(self, other, share)


def lane_of_path(width_m: float, curvature_1_m: float) -> LaneShape:
    """Return the lane of a vehicle that drives in its middle, on a circle."""
    turned_rad = CAMERA_AHEAD_M * curvature_1_m
    return LaneShape(width_m, 0.5 * CAMERA_AHEAD_M * turned_rad, turned_rad, curvature_1_m)


class HostLane:
    """The lane of the host vehicle, smoothed over frames."""

    FIT_SHARE, DECAY_SHARE = 0.3, 0.05
    """Weight of each new fit, and of the vehicle's path in a frame without one."""
    MAX_LEAP = 0.3
    """Distance in lane widths, 6 ahead, from which a fit counts only when the next one repeats
    it."""

    def __init__(self, width_m: float) -> None:
        self._unmarked = LaneShape(width_m)
        self._paint_share = 0.0
        """Share of the shape that is by markings, and not by the vehicle's path."""
        self._path_sigma_1_m = 0.0
        self._leap: LaneShape | None = None
        self.shape = self._unmarked

    @property
    def path_curvature_1_m(self) -> float:
        """Of the path that the vehicle drives, positive to the right; 0 while it is unknown."""
        return self._unmarked.curvature_1_m

    def path_sigma_m(self, ahead_m: float) -> float:
        """Sigma of the middle of the lane at `ahead_m` by that of the path's curvature."""
        return (1.0 - self._paint_share) * 0.5 * self._path_sigma_1_m * ahead_m**2

    def receive_curvature(self, curvature: Curvature | None) -> None:
        """Bend the lane with the path, as far as it is not known by markings.

        Without a curvature it is straight, and no sigma is known.
        """
        path = lane_of_path(self._unmarked.width_m, curvature.curvature_1_m if curvature else 0.0)
        self._path_sigma_1_m = curvature.sigma_1_m if curvature else 0.0
        self.shape = self.shape.moved(self._unmarked, path, 1.0 - self._paint_share)
        self._unmarked = path

    def receive_fit(self, fit: LaneShape | None) -> None:
        """Update by the fit of one frame; without a fit, the shape decays to the path."""
        if fit is None:
            self.shape = self.shape.towards(self._unmarked, self.DECAY_SHARE)
            self._paint_share *= 1.0 - self.DECAY_SHARE
        elif self._is_near(fit, self.shape) or (
            self._leap is not None and self._is_near(fit, self._leap)
        ):
            self.shape = self.shape.towards(fit, self.FIT_SHARE)
            self._paint_share += self.FIT_SHARE * (1.0 - self._paint_share)
        self._leap = fit

    def _is_near(self, one: LaneShape, other: LaneShape) -> bool:
        ahead_m = 6.0 * self._unmarked.width_m
        apart_m = abs(one.middle_m(ahead_m) - other.middle_m(ahead_m))
        return apart_m <= self.MAX_LEAP * self._unmarked.width_m


class LaneMarkingDetector:
    """Finds the two lines of the host vehicle's lane in a view from above.

    A grid on the road, in units of the lane's width, is sampled from the image. Points brighter
    than those 0.3 m to their left and right vote for lines; the pair of lines a lane apart with
    votes of most rows is the lane.
    """

    ROWS, COLUMNS = 40, 113
    NEAR, FAR, SIDE = 1.5, 10.0, 1.6
    """Extent of the grid, in lane widths."""
    HEADINGS = np.linspace(-0.05, 0.05, 11)
    BENDS = np.linspace(-0.015, 0.015, 9)
    """Curvature times the lane's width: 0.015 is a radius of 230 m."""
    WIDTHS = (0.8, 1.2)
    MIN_CONTRAST = 10.0
    """Contrast of paint to the road, in grey levels."""
    MIN_ROWS, MIN_BOTH = 3.0, 12.0
    """Rows that must vote for each line, and for both. A dashed line fills a quarter to a half of
    40."""

    def __init__(self, perspective: Perspective, lane_width_m: float) -> None:
        """Project the grid of a lane `lane_width_m` wide into the image."""
        self._lane_width_m = lane_width_m
        self._ahead = np.linspace(self.NEAR, self.FAR, self.ROWS)
        self._right = np.linspace(-self.SIDE, self.SIDE, self.COLUMNS)
        self._cell = float(self._right[1] - self._right[0])
        positions = [
            RoadPosition(ahead * lane_width_m, right * lane_width_m, 0.0)
            for ahead in self._ahead
            for right in self._right
        ]
        pixels = perspective.project_all(positions) - 0.5
        self._map = pixels.reshape(self.ROWS, self.COLUMNS, 2).astype(np.float32)
        bends, headings = np.meshgrid(self.BENDS, self.HEADINGS)
        self._bends, self._headings = bends.ravel(), headings.ravel()
        # Prior: roads are mostly straight, so bends need votes of more rows.
        self._penalty = 4.0 * (np.abs(self._bends) / 0.015 + np.abs(self._headings) / 0.05)

    def find(
        self,
        image: npt.NDArray[np.uint8],
        cars: Sequence[ImageBox] = (),
        path_curvature_1_m: float = 0.0,
    ) -> LaneShape | None:
        """Shape of the lane; `None` where its markings are not found.

        Args:
            image: (h, w, 3), BGR.
            cars: parts of the image in which vehicles hide the road.
            path_curvature_1_m: of the vehicle's path; lanes of about this curvature are looked for.
        """
        ahead, right, weight = self._paint(image, cars)
        if weight.sum() < self.MIN_BOTH:
            return None
        path = lane_of_path(self._lane_width_m, path_curvature_1_m)
        bent = right - np.asarray([path.middle_m(each) for each in ahead * self._lane_width_m]) / (
            self._lane_width_m
        )
        fit = self._best_pair(self._votes(ahead, bent, weight))
        return None if fit is None else fit.moved(LaneShape(self._lane_width_m), path, 1.0)

    def _paint(
        self, image: npt.NDArray[np.uint8], cars: Sequence[ImageBox]
    ) -> tuple[_Floats, _Floats, _Floats]:
        """Points of paint, in lane widths, and their weights."""
        above = cv2.remap(
            image,
            self._map[..., 0],
            self._map[..., 1],
            cv2.INTER_LINEAR,
            borderMode=cv2.BORDER_REPLICATE,
        )
        # Yellow paint is as bright as white in red and green.
        levels = np.asarray(above, np.float32)[..., 1:].mean(axis=2)
        reach = max(2, round(0.09 / self._cell))
        beside = np.maximum(levels[:, : -2 * reach], levels[:, 2 * reach :])
        contrast = levels[:, reach:-reach] - beside
        u_px, v_px = self._map[:, reach:-reach, 0], self._map[:, reach:-reach, 1]
        inside = (u_px > 0) & (u_px < image.shape[1]) & (v_px < image.shape[0])
        contrast[~inside] = 0.0
        for car in cars:
            across = (u_px >= car.x_px) & (u_px <= car.x_px + car.w_px)
            contrast[across & (v_px >= car.y_px) & (v_px <= car.y_px + car.h_px)] = 0.0
        rows, columns = np.nonzero(contrast > self.MIN_CONTRAST)
        weight = np.minimum(contrast[rows, columns] / (3 * self.MIN_CONTRAST), 1.0)
        return self._ahead[rows], self._right[columns + reach], weight.astype(np.float64)

    def _votes(self, ahead: _Floats, right: _Floats, weight: _Floats) -> _Floats:
        """(headings and bends, columns): votes of rows with paint along each line."""
        bent = (
            right[None]
            - self._headings[:, None] * ahead[None]
            - 0.5 * self._bends[:, None] * ahead[None] ** 2
        )
        column = np.rint((bent + self.SIDE) / self._cell).astype(np.int64)
        inside = (column >= 0) & (column < self.COLUMNS)
        line = np.arange(len(self._bends))[:, None] * self.COLUMNS + column
        counts = np.bincount(
            line[inside],
            weights=np.broadcast_to(weight, line.shape)[inside],
            minlength=len(self._bends) * self.COLUMNS,
        ).reshape(-1, self.COLUMNS)
        # Near paint is about three cells wide.
        padded = np.pad(counts, ((0, 0), (1, 1)))
        return np.asarray((padded[:, :-2] + padded[:, 1:-1] + padded[:, 2:]) / 2, np.float64)

    def _best_pair(self, votes: _Floats) -> LaneShape | None:
        middle = self.COLUMNS // 2
        best: tuple[float, int, int, int] | None = None
        unit = 1.0 / self._cell
        for apart in range(round(self.WIDTHS[0] * unit), round(self.WIDTHS[1] * unit) + 1):
            lefts = np.arange(middle - round(0.85 * unit), middle - round(0.15 * unit))
            rights = lefts + apart
            lefts, rights = lefts[rights < self.COLUMNS], rights[rights < self.COLUMNS]
            left, right = votes[:, lefts], votes[:, rights]
            scores = np.minimum(left, self.ROWS) + np.minimum(right, self.ROWS)
            scores = scores - self._penalty[:, None] - 3.0 * abs(apart * self._cell - 1.0)
            scores[(left < self.MIN_ROWS) | (right < self.MIN_ROWS)] = 0.0
            curve, at = divmod(int(scores.argmax()), scores.shape[1])
            if best is None or scores[curve, at] > best[0]:
                best = (float(scores[curve, at]), curve, int(lefts[at]), apart)
        if best is None or best[0] < self.MIN_BOTH:
            return None
        _, curve, left_column, apart = best
        offset = self._right[left_column] + 0.5 * apart * self._cell
        return LaneShape(
            width_m=apart * self._cell * self._lane_width_m,
            offset_m=float(offset) * self._lane_width_m,
            heading_rad=float(self._headings[curve]),
            curvature_1_m=float(self._bends[curve]) / self._lane_width_m,
        )
