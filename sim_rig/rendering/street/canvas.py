"""What a street is drawn on: a camera over a bent and sloping road, and the light.

Coordinates in metres: ahead along the road, right, and up from its surface, as rows of (n, 3). A
road of curvature c and vertical curvature s puts a point at

    x = right + c ahead^2 / 2,   y = up + s ahead^2 / 2,   z = ahead
    u = c_x + f d x / z,         v = c_y + f d (h - y) / z,   d = 1 + k1 (x^2 + (h - y)^2) / z^2

after which the picture is rolled about (c_x, c_y). Pitch is a shift of c_y.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import cv2
import numpy as np
import numpy.typing as npt

Image = npt.NDArray[np.uint8]
Points = npt.NDArray[np.float64]
Bgr = tuple[float, float, float]

NEAREST_M = 0.5
"""Nearer points are drawn at this distance: they are outside the picture."""
FINE = 2
"""Pixels of a drawing for each of the picture, each way: edges are smooth without other means."""
FARTHEST_PX = 16000.0
_FINEST_PX = 0.8
"""Smaller polygons are left out."""
_SUB = 4
"""Bits of a pixel's fraction in polygons."""


@dataclass(frozen=True, slots=True)
class RoadCamera:
    """A camera over the road; pixels are those of the drawing."""

    size_px: tuple[int, int]
    """Width and height."""
    focal_px: float
    centre_px: tuple[float, float]
    """Where a straight and level road vanishes."""
    height_m: float = 1.3
    roll_rad: float = 0.0
    curvature_1_m: float = 0.0
    hill_1_m: float = 0.0
    k1: float = 0.0
    """Radial distortion; negative: barrel."""

    def project(self, points_m: npt.ArrayLike) -> Points:
        """Pixels (n, 2) of points (n, 3) ahead, right, up."""
        points = np.asarray(points_m, np.float64).reshape(-1, 3)
        ahead = np.maximum(points[:, 0], NEAREST_M)
        bent = ahead / 2
        across = points[:, 1] / ahead + self.curvature_1_m * bent
        down = (self.height_m - points[:, 2]) / ahead - self.hill_1_m * bent
        if self.k1:
            scale = np.maximum(1 + self.k1 * (across * across + down * down), 0.6)
            across, down = scale * across, scale * down
        cosine, sine = math.cos(self.roll_rad), math.sin(self.roll_rad)
        pixels = np.empty((len(points), 2))
        pixels[:, 0] = self.focal_px * (cosine * across - sine * down) + self.centre_px[0]
        pixels[:, 1] = self.focal_px * (sine * across + cosine * down) + self.centre_px[1]
        np.minimum(pixels, FARTHEST_PX, out=pixels)
        return np.maximum(pixels, -FARTHEST_PX, out=pixels)

    def px_per_m(self, ahead_m: float) -> float:
        """Pixels of a metre at that distance."""
        return self.focal_px / max(ahead_m, NEAREST_M)


@dataclass(frozen=True, slots=True)
class Daylight:
    """Light on the scene; levels are factors of a colour, 1 for white paper in the sun."""

    ambient: float
    sun: float
    """Added on faces towards the sun."""
    towards_sun: tuple[float, float, float]
    """Unit vector ahead, right, up."""
    headlamps: float
    """Added by the own headlamps on faces towards the camera, at `_LIT_M` ahead."""
    haze_bgr: Bgr
    sight_m: float
    """Distance at which contrast has fallen to 1/e."""
    sky_bgr: Bgr
    """What glass reflects."""
    is_dark: bool
    """Whether lamps are on."""


_LIT_M = 12.0


@dataclass(slots=True)
class Canvas:
    """The drawing: colours, which vehicle each pixel shows, and the glow of lamps."""

    camera: RoadCamera
    light: Daylight
    image: Image = field(init=False)
    owners: Image = field(init=False)
    """(h, w) of the picture: number of the vehicle that a pixel shows, 0 for none."""
    glow: Image = field(init=False)
    """(h, w, 3) of the picture: what is added."""
    owner: int = 0
    """Number of the vehicle that is being drawn."""
    extents: dict[int, tuple[float, float, float, float]] = field(default_factory=dict)
    """For each vehicle left, top, right and bottom of all that was drawn of it, in pixels of the
    picture, also outside of it."""

    def __post_init__(self) -> None:
        width, height = self.camera.size_px
        self.image = np.zeros((height, width, 3), np.uint8)
        self.owners = np.zeros((height // FINE, width // FINE), np.uint8)
        self.glow = np.zeros((height // FINE, width // FINE, 3), np.uint8)

    def seen(self, bgr: Bgr, level: float, ahead_m: float) -> Bgr:
        """A colour under some light, behind the haze of a distance."""
        contrast = math.exp(-max(ahead_m, 0.0) / self.light.sight_m)
        blue, green, red = (
            min(max(level * value * contrast + veil * (1 - contrast), 0.0), 255.0)
            for value, veil in zip(bgr, self.light.haze_bgr, strict=True)
        )
        return blue, green, red

    def level(self, normal: Sequence[float], ahead_m: float) -> float:
        """Light on a face with this outward unit normal (ahead, right, up)."""
        light = self.light
        ahead, right, up = normal
        towards = light.towards_sun
        sun = light.sun * max(0.0, ahead * towards[0] + right * towards[1] + up * towards[2])
        sky = light.ambient * (0.8 + 0.2 * up)
        near = _LIT_M / max(ahead_m, 4.0)
        return float(sky + sun + light.headlamps * near**1.3 * max(0.15, -ahead))

    def fill(self, points_m: npt.ArrayLike, bgr: Bgr) -> None:
        """Fill a polygon (n, 3) in space with a colour as the camera sees it."""
        self.fill_px(self.camera.project(points_m), bgr)

    def fill_px(self, pixels: Points, bgr: Bgr) -> None:
        """Fill a polygon (n, 2) in pixels of the drawing."""
        corners = self.claim(pixels)
        if corners is not None:
            cv2.fillPoly(self.image, [corners], bgr, cv2.LINE_8, _SUB)

    def claim(self, pixels: Points) -> npt.NDArray[np.int32] | None:
        """Note a polygon (n, 2) as part of the vehicle that is being drawn.

        Returns:
            Its corners in fractions of pixels; `None` if nothing of it is in the picture.
        """
        corners = np.asarray(np.rint((pixels - 0.5) * 2**_SUB), np.int32)
        left, top, wide, high = (side / 2**_SUB for side in cv2.boundingRect(corners))
        if self.owner:
            low = left / FINE, top / FINE
            box = *low, (left + wide) / FINE, (top + high) / FINE
            known = self.extents.get(self.owner, box)
            self.extents[self.owner] = (
                min(known[0], box[0]),
                min(known[1], box[1]),
                max(known[2], box[2]),
                max(known[3], box[3]),
            )
        width, height = self.camera.size_px
        is_outside = left > width or top > height or left + wide < 0 or top + high < 0
        if is_outside or max(wide, high) < _FINEST_PX:
            return None
        cv2.fillPoly(self.owners, [corners // FINE], (self.owner,), cv2.LINE_8, _SUB)
        return corners

    def line(self, points_m: npt.ArrayLike, width_m: float, bgr: Bgr) -> None:
        """Draw a line through points (n, 3) in space, as wide as it is at its middle."""
        points = np.asarray(points_m, np.float64)
        ahead_m = float(points[:, 0].mean())
        width_px = max(1, round(width_m * self.camera.px_per_m(ahead_m)))
        pixels = np.rint(self.camera.project(points)).astype(np.int32)
        cv2.polylines(self.image, [pixels], False, bgr, width_px, cv2.LINE_AA)
        if width_px > FINE:
            cv2.polylines(self.owners, [pixels // FINE], False, (self.owner,), width_px // FINE)

    def darken(self, points_m: npt.ArrayLike, factor: float, blur_px: float) -> None:
        """Lay a soft shadow on a polygon (n, 3)."""
        pixels = self.camera.project(points_m)
        width, height = self.camera.size_px
        reach = 2 * blur_px + 2
        left, top = np.clip(np.floor(pixels.min(axis=0) - reach), 0, (width, height)).astype(int)
        right, bottom = np.clip(np.ceil(pixels.max(axis=0) + reach), 0, (width, height)).astype(int)
        if right - left < 2 or bottom - top < 2:
            return
        mask = np.zeros((bottom - top, right - left), np.float32)
        corners = np.rint(pixels - (left, top)).astype(np.int32)
        cv2.fillPoly(mask, [corners], (1.0 - factor,))
        if blur_px > 0.5:
            size = 2 * int(blur_px) + 1
            cv2.blur(mask, (size, size), dst=mask)
        part = self.image[top:bottom, left:right]
        part[:] = (part * (1.0 - mask[..., None])).astype(np.uint8)

    def shine(self, point_m: npt.ArrayLike, radius_m: float, bgr: Bgr) -> None:
        """Draw a lamp that is on, with its glow."""
        point = np.asarray(point_m, np.float64).reshape(1, 3)
        at = np.rint(self.camera.project(point)[0] / FINE).astype(int)
        radius = max(1, round(radius_m * self.camera.px_per_m(float(point[0, 0])) / FINE))
        cv2.circle(self.glow, (int(at[0]), int(at[1])), radius, bgr, cv2.FILLED)
