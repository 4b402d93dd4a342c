"""Solids of flat faces, and what is painted on a face."""

import math
from dataclasses import dataclass, field

import cv2
import numpy as np
import numpy.typing as npt

from sim_rig.rendering.street.canvas import FARTHEST_PX, Bgr, Canvas, Points

_UNIT = np.asarray([(0, 0), (1, 0), (1, 1), (0, 1)], np.float32)
FACES = ("rear", "front", "left", "right", "top")


@dataclass(frozen=True, slots=True)
class CrossSection:
    """A level cut through a solid: a rectangle."""

    rear_m: float
    front_m: float
    half_width_m: float
    up_m: float


@dataclass(frozen=True, slots=True)
class Pose:
    """Where a solid stands: its origin on the road, and its heading (clockwise; 0: ahead)."""

    ahead_m: float
    right_m: float
    heading_rad: float = 0.0
    up_m: float = 0.0

    def place(self, points_m: npt.ArrayLike) -> Points:
        """Points (n, 3) of the solid (along, across, up) on the road (ahead, right, up)."""
        points = np.asarray(points_m, np.float64).reshape(-1, 3)
        cosine, sine = np.cos(self.heading_rad), np.sin(self.heading_rad)
        along, across = points[:, 0], points[:, 1]
        return np.column_stack(
            [
                self.ahead_m + cosine * along - sine * across,
                self.right_m + sine * along + cosine * across,
                self.up_m + points[:, 2],
            ]
        )


@dataclass(slots=True, eq=False)
class Face:
    """A flat face with four corners (4, 3): upper left, upper right, lower right, lower left."""

    corners_m: Points
    normal: tuple[float, float, float]
    level: float
    ahead_m: float
    _to_px: Points | None = field(default=None, init=False, repr=False)
    """Homography from the face to pixels, once it was needed."""

    def points(self, shape: npt.ArrayLike) -> Points:
        """Points in space of a shape (n, 2) on the face: (0, 0) upper left, (1, 1) lower right."""
        u, v = np.asarray(shape, np.float64).reshape(-1, 2).T[..., None]
        top_left, top_right, bottom_right, bottom_left = self.corners_m
        upper = top_left + u * (top_right - top_left)
        return np.asarray(upper + v * (bottom_left + u * (bottom_right - bottom_left) - upper))

    def paint(
        self, canvas: Canvas, shape: npt.ArrayLike, bgr: Bgr, *, emission: float = 0.0
    ) -> None:
        """Fill a shape on the face.

        Args:
            canvas: drawn onto.
            shape: (n, 2) on the face.
            bgr: colour.
            emission: light that it emits, as a factor of its colour.
        """
        colour = canvas.seen(bgr, max(self.level, emission), self.ahead_m)
        canvas.fill_px(self.pixels(canvas, shape), colour)

    def pixels(self, canvas: Canvas, shape: npt.ArrayLike) -> Points:
        """Pixels (n, 2) of the drawing of a shape (n, 2) on the face."""
        if self._to_px is None:
            corners = canvas.camera.project(self.corners_m).astype(np.float32)
            self._to_px = np.asarray(cv2.getPerspectiveTransform(_UNIT, corners), np.float64)
        flat = np.asarray(shape, np.float64).reshape(-1, 2)
        raised = flat @ self._to_px[:, :2].T + self._to_px[:, 2]
        return np.asarray(np.clip(raised[:, :2] / raised[:, 2:], -FARTHEST_PX, FARTHEST_PX))


def rectangle(left: float, top: float, right: float, bottom: float) -> Points:
    """A shape (4, 2) on a face."""
    return np.asarray([(left, top), (right, top), (right, bottom), (left, bottom)])


def visible_faces(
    canvas: Canvas, pose: Pose, low: CrossSection, high: CrossSection
) -> dict[str, Face]:
    """Faces towards the camera of the solid between two levels, by their names in `FACES`."""
    corners = np.asarray(
        [
            (along_m, side * level.half_width_m, level.up_m)
            for level in (high, low)
            for along_m, side in (
                (level.rear_m, -1),
                (level.rear_m, 1),
                (level.front_m, 1),
                (level.front_m, -1),
            )
        ]
    )
    world = pose.place(corners)
    middle = world.mean(axis=0)
    indices = ((0, 1, 5, 4), (2, 3, 7, 6), (3, 0, 4, 7), (1, 2, 6, 5), (3, 2, 1, 0))
    found = {}
    for name, index in zip(FACES, indices, strict=True):
        quad = world[list(index)]
        # Of its diagonals, which also a face narrowing to a line has.
        (a, b, c), (d, e, f) = (quad[2] - quad[0]).tolist(), (quad[3] - quad[1]).tolist()
        across = b * f - c * e, c * d - a * f, a * e - b * d
        length = math.hypot(*across)
        if length < 1e-9:
            continue
        centre = (quad[0] + quad[1] + quad[2] + quad[3]) / 4
        x, y, z = centre.tolist()
        outward = centre - middle
        sign = math.copysign(1 / length, float(outward @ np.asarray(across)))
        normal = sign * across[0], sign * across[1], sign * across[2]
        height_m = canvas.camera.height_m
        if (
            -normal[0] * x - normal[1] * y + normal[2] * (height_m - z) <= 0
            or quad[:, 0].max() < 0.6
        ):
            continue
        found[name] = Face(quad, normal, canvas.level(normal, x), x)
    return found
