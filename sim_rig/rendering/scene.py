"""Images of the camera behind the windscreen: a road, lanes, and the cars on it from behind.

A pinhole camera at height h over a flat road, turned right by psi and pitched down by theta, sees
a point that lies (ahead Z, lateral X to the right, height Y over the road) at

    u = c_x + f_x x' / z',   v = c_y + f_y y' / z',   r = Z cos(psi) + X sin(psi)
    x' = X cos(psi) - Z sin(psi)
    y' = (h - Y) cos(theta) - r sin(theta),   z' = (h - Y) sin(theta) + r cos(theta).

Pixels count from the outer corner of the top left one; the lens does not distort. Cars are flat
rears with one side, those with another heading plain boxes; the nearest are painted last.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from functools import lru_cache, partial
from typing import TypeVar

import cv2
import numpy as np
import numpy.typing as npt

from onboard.kinematics.arrays import Array
from onboard.vision.settings import Calibration, TagDictionary
from sim_rig.rendering.car_art import OPAQUE, PLATE_CENTRE, rear_of_car
from sim_rig.rendering.plate_art import EU, PlateFormat, draw_plate

Image = npt.NDArray[np.uint8]
_Box = tuple[float, float, float, float]
"""Left, top, right and bottom, in pixels."""
"""(h, w, 3), BGR."""
Quad = npt.NDArray[np.float32]
"""(4, 2): top left, top right, bottom right, bottom left, in pixels."""
CoordinateT = TypeVar("CoordinateT", float, Array)

_TAG_PX = 128
_TAG_CARD = 1.25
"""Side of the white card over the side of the tag's black square."""
TURNED_RAD = 0.3
"""Largest heading difference, from the camera's car, at which a rear plate is readable."""
_NEAREST_M = 1.0
"""Nearer parts are not drawn."""


class Light(StrEnum):
    """Time of day and weather."""

    DAY = "day"
    OVERCAST = "overcast"
    DUSK = "dusk"
    NIGHT = "night"
    FOG = "fog"


@dataclass(frozen=True, slots=True)
class _Look:
    """Effect of a `Light` on an image."""

    sky_bgr: tuple[int, int, int]
    road_bgr: tuple[int, int, int]
    verge_bgr: tuple[int, int, int]
    brightness: float
    """Brightness of everything that does not emit light."""
    plate_brightness: float
    """Brightness of plates, which reflect the headlights."""
    noise_sigma: float
    """Standard deviation of the sensor noise, grey levels."""
    sight_m: float
    """Distance at which contrast has fallen to 1/e."""


_LOOKS = {
    Light.DAY: _Look((225, 190, 150), (112, 110, 108), (70, 120, 90), 1.0, 1.0, 2.0, 900.0),
    Light.OVERCAST: _Look((200, 200, 200), (98, 98, 98), (72, 100, 84), 0.8, 0.8, 3.0, 400.0),
    Light.DUSK: _Look((120, 96, 100), (60, 58, 58), (36, 50, 42), 0.45, 0.7, 5.0, 400.0),
    Light.NIGHT: _Look((24, 18, 16), (34, 33, 33), (14, 20, 17), 0.2, 0.8, 7.0, 200.0),
    Light.FOG: _Look((190, 190, 190), (120, 120, 120), (110, 122, 115), 0.8, 0.8, 3.0, 60.0),
}


@dataclass(frozen=True, slots=True)
class SceneCar:
    """One vehicle ahead, seen from behind unless it is turned."""

    ahead_m: float
    """Camera to its rear, along the lane; cars at or behind the camera are not drawn."""
    lateral_m: float = 0.0
    """The middle of its rear from the camera, positive to the right."""
    heading_rad: float = 0.0
    """Heading relative to the camera's car, clockwise."""
    width_m: float = 1.8
    height_m: float = 1.5
    length_m: float = 4.4
    plate: str | None = None
    """Text without separators."""
    plate_format: PlateFormat = EU
    tag_id: int | None = None
    """Number of an ArUco tag instead of the plate."""
    tag_side_m: float = 0.2
    """Side of the tag's black square."""
    colour_bgr: tuple[int, int, int] = (120, 90, 60)
    braking: bool = False

    @property
    def is_turned(self) -> bool:
        """Whether its rear is not visible."""
        return abs(self.heading_rad) > TURNED_RAD

    def corners(self) -> tuple[tuple[float, float], ...]:
        """Ahead and to the right: rear left, rear right, front right, front left."""
        sine, cosine = math.sin(self.heading_rad), math.cos(self.heading_rad)
        half_m = self.width_m / 2
        return tuple(
            (
                self.ahead_m + along_m * cosine - across_m * sine,
                self.lateral_m + along_m * sine + across_m * cosine,
            )
            for along_m, across_m in (
                (0.0, -half_m),
                (0.0, half_m),
                (self.length_m, half_m),
                (self.length_m, -half_m),
            )
        )


@dataclass(frozen=True, slots=True)
class Scene:
    """The road ahead at one time."""

    cars: tuple[SceneCar, ...] = ()
    lane_width_m: float = 3.5
    lanes_left: int = 1
    """Number of lanes left of the host's."""
    lanes_right: int = 1
    travelled_m: float = 0.0
    """Distance travelled by the host, which moves the lane markings."""
    light: Light = Light.DAY
    middle_m: tuple[tuple[float, float], ...] = ()
    """The middle of the host's lane, ahead and to the right of the camera; straight if empty."""


@dataclass(frozen=True, slots=True)
class CameraRenderer:
    """Renders scenes for one camera calibration."""

    camera: Calibration
    tag_dictionary: TagDictionary = "4X4_50"
    blur_sigma_px: float = 0.6
    _noise: Image = field(init=False, repr=False)

    def __post_init__(self) -> None:
        rows, columns = self.camera.height_px + 64, self.camera.width_px + 64
        # One fixed noise field: each image takes a section of it, chosen by its own rng.
        grain = np.random.default_rng(0).normal(128, 32, (rows, columns, 3))
        object.__setattr__(self, "_noise", np.clip(grain, 0, 255).astype(np.uint8))

    def draw(self, scene: Scene, rng: np.random.Generator) -> Image:
        """Return the image, (h, w, 3) uint8 BGR; `rng` is the source of the sensor noise."""
        look = _LOOKS[scene.light]
        image = self._road(scene, look)
        cars = sorted(scene.cars, key=lambda car: -car.ahead_m)
        covers = [self._cover(car) for car in cars]
        for number, car in enumerate(cars):
            if self._is_hidden(car, covers[number + 1 :]):
                continue  # painting it would be for nothing, and most of the work in a row of cars
            if car.is_turned:
                self._paint_turned(image, car, look)
            elif car.ahead_m > _NEAREST_M:
                self._paint_car(image, car, look)
        if self.blur_sigma_px:
            cv2.GaussianBlur(image, (0, 0), self.blur_sigma_px, dst=image)
        return self._with_noise(image, look.noise_sigma / 32, rng)

    def project(
        self, ahead_m: CoordinateT, lateral_m: CoordinateT, height_m: float
    ) -> tuple[CoordinateT, CoordinateT]:
        """Return the pixel (u, v) of a point, by the equation at the head of this file.

        Args:
            ahead_m: distance ahead of the camera's car; of many points, an array.
            lateral_m: distance to its right.
            height_m: height over the road.
        """
        camera = self.camera
        drop = camera.mounting_height_m - height_m
        across = lateral_m * math.cos(camera.yaw_rad) - ahead_m * math.sin(camera.yaw_rad)
        away = ahead_m * math.cos(camera.yaw_rad) + lateral_m * math.sin(camera.yaw_rad)
        depth = drop * math.sin(camera.pitch_rad) + away * math.cos(camera.pitch_rad)
        down = drop * math.cos(camera.pitch_rad) - away * math.sin(camera.pitch_rad)
        return (
            camera.principal_x_px + camera.focal_x_px * across / depth,
            camera.principal_y_px + camera.focal_y_px * down / depth,
        )

    def plate_quad(self, car: SceneCar) -> Quad:
        """Corners of the car's plate (or of its tag) in the picture."""
        half_width_m, half_height_m = car.plate_format.width_m / 2, car.plate_format.height_m / 2
        if car.tag_id is not None:
            half_width_m = half_height_m = car.tag_side_m / 2
        middle_m = (1 - PLATE_CENTRE[1]) * car.height_m
        return self._upright_quad(
            car, middle_m - half_height_m, middle_m + half_height_m, half_width_m
        )

    def _upright_quad(
        self, car: SceneCar, bottom_m: float, top_m: float, half_width_m: float
    ) -> Quad:
        across_m = half_width_m * math.cos(car.heading_rad)
        along_m = half_width_m * math.sin(car.heading_rad)
        left, right = (
            (car.ahead_m - way * along_m, car.lateral_m + way * across_m) for way in (-1.0, 1.0)
        )
        corners = ((left, top_m), (right, top_m), (right, bottom_m), (left, bottom_m))
        return np.asarray([self.project(*point, y) for point, y in corners], np.float32)

    def _paint_car(self, image: Image, car: SceneCar, look: _Look) -> None:
        contrast = math.exp(-car.ahead_m / look.sight_m)
        veil = np.asarray(look.sky_bgr, np.float32) * np.float32(1 - contrast)

        def lit(texture: Image, brightness: float) -> Image:
            """Dimmed, and behind haze according to the distance."""
            mix = np.diag([brightness * contrast] * 3 + [1.0])
            mix[:3, 3] = veil / 255
            return np.asarray(cv2.transform(texture, mix), np.uint8)

        self._paint_side(image, car, look.brightness * contrast, veil)
        rear = _car_levels(car.width_m, car.height_m, car.colour_bgr, car.braking)
        quad = self._upright_quad(car, 0.0, car.height_m, car.width_m / 2)
        brightness = max(look.brightness, 0.6) if car.braking else look.brightness
        warp_onto(image, lit(_near_size(rear, quad), brightness), quad)
        quad = self.plate_quad(car)
        if car.tag_id is not None:
            quad = _grown(quad, _TAG_CARD)
            levels = _tag_levels(self.tag_dictionary, car.tag_id)
        elif car.plate is not None:
            levels = _plate_levels(car.plate, car.plate_format)
        else:
            return
        warp_onto(image, lit(_near_size(levels, quad), look.plate_brightness), quad)

    def _paint_side(
        self, image: Image, car: SceneCar, brightness: float, veil: npt.NDArray[np.float32]
    ) -> None:
        """The side towards the camera, from rear to front."""
        if abs(car.lateral_m) <= car.width_m / 2:
            return
        edge_m = car.lateral_m - math.copysign(car.width_m / 2, car.lateral_m)
        front_m = car.ahead_m + car.length_m
        waist_m = 0.6 * car.height_m
        front_edge_m = edge_m + car.length_m * math.sin(car.heading_rad)
        points = [
            self.project(car.ahead_m, edge_m, 0.15),
            self.project(front_m, front_edge_m, 0.15),
            self.project(front_m, front_edge_m, waist_m),
            self.project(car.ahead_m, edge_m, waist_m),
        ]
        shade = [float(0.6 * brightness * c + v) for c, v in zip(car.colour_bgr, veil, strict=True)]
        cv2.fillConvexPoly(image, np.asarray(points, np.int32), shade, cv2.LINE_AA)

    def _is_hidden(self, car: SceneCar, covers: Sequence[_Box | None]) -> bool:
        """Whether one of the opaque boxes before it covers all of it."""
        if not any(covers):
            return False
        ahead_m, lateral_m = np.asarray(car.corners()).T
        if ahead_m.min() <= _NEAREST_M:
            return False
        left, top, right, bottom = _box_of(
            *(self.project(ahead_m, lateral_m, height_m) for height_m in (0.0, car.height_m))
        )
        return any(
            each[0] < left and each[1] < top and right < each[2] and bottom < each[3]
            for each in covers
            if each is not None
        )

    def _cover(self, car: SceneCar) -> _Box | None:
        """Left, top, right and bottom of an opaque box in its rear; `None` if too small."""
        if car.is_turned or car.ahead_m <= _NEAREST_M:
            return None
        left, top, right, bottom = OPAQUE
        half_width_m = min(0.5 - left, right - 0.5) * car.width_m
        quad = self._upright_quad(
            car, (1.0 - bottom) * car.height_m, (1.0 - top) * car.height_m, half_width_m
        )
        (left_u, left_v), (right_u, right_v), (low_right_u, low_right_v), (low_u, low_v) = quad
        box = (
            float(max(left_u, low_u)) + _EDGE_PX,
            float(max(left_v, right_v)) + _EDGE_PX,
            float(min(right_u, low_right_u)) - _EDGE_PX,
            float(min(low_v, low_right_v)) - _EDGE_PX,
        )
        return box if box[2] - box[0] > _LEAST_COVER_PX else None

    def _paint_turned(self, image: Image, car: SceneCar, look: _Look) -> None:
        """The visible faces of a box, each in its own shade."""
        corners = car.corners()
        if min(ahead for ahead, _ in corners) <= _NEAREST_M:
            return
        contrast = math.exp(-min(ahead for ahead, _ in corners) / look.sight_m)
        veil = [(1 - contrast) * channel for channel in look.sky_bgr]
        faces = list(zip(corners, corners[1:] + corners[:1], strict=True))
        for (one, other), light in zip(faces, (0.75, 0.6, 0.75, 0.6), strict=True):
            # Seen from outside, a face's corners go from the left to the right.
            if one[0] * other[1] - one[1] * other[0] <= 0.0:
                continue
            quad = [
                self.project(*end, height_m)
                for end, height_m in (
                    (one, 0.15),
                    (other, 0.15),
                    (other, car.height_m),
                    (one, car.height_m),
                )
            ]
            shade = [
                light * look.brightness * contrast * c + v
                for c, v in zip(car.colour_bgr, veil, strict=True)
            ]
            cv2.fillConvexPoly(image, np.asarray(quad, np.int32), shade, cv2.LINE_AA)

    def _road(self, scene: Scene, look: _Look) -> Image:
        camera = self.camera
        image = np.empty((camera.height_px, camera.width_px, 3), np.uint8)
        horizon_v = camera.principal_y_px - camera.focal_y_px * math.tan(camera.pitch_rad)
        horizon = int(np.clip(round(horizon_v), 0, camera.height_px))
        below = (camera.width_px, camera.height_px)
        cv2.rectangle(image, (0, 0), (camera.width_px, horizon), look.sky_bgr, cv2.FILLED)
        cv2.rectangle(image, (0, horizon), below, look.verge_bgr, cv2.FILLED)
        left_m = -(scene.lanes_left + 0.5) * scene.lane_width_m
        right_m = (scene.lanes_right + 0.5) * scene.lane_width_m
        near_m, far_m = 2.0, 400.0
        fill = partial(self._fill_strips, image, _bent_lane(scene))
        whole_m = np.asarray([(near_m, far_m)])
        fill(whole_m, (left_m - 0.6, right_m + 0.6), look.road_bgr)
        paint = tuple(min(255, round(2.1 * channel)) for channel in look.road_bgr)
        for edge_m in (left_m, right_m):
            fill(whole_m, (edge_m - 0.08, edge_m + 0.08), paint)
        # 3 m of line, 9 m of gap, as is common on motorways.
        starts_m = np.arange(-(scene.travelled_m % 12.0), 150.0, 12.0)
        dashes_m = np.stack([np.maximum(near_m, starts_m), starts_m + 3.0], axis=1)
        dashes_m = dashes_m[dashes_m[:, 0] < dashes_m[:, 1]]
        for number in range(1, scene.lanes_left + scene.lanes_right + 1):
            line_m = left_m + number * scene.lane_width_m
            fill(dashes_m, (line_m - 0.07, line_m + 0.07), paint)
        return image

    def _fill_strips(
        self,
        image: Image,
        lane: "_BentLane | None",
        ahead_m: Array,
        lateral_m: tuple[float, float],
        bgr: tuple[int, ...],
    ) -> None:
        """Strips along the road, each from and until `ahead_m`; without a bend, rectangles."""
        if lane is None:
            outlines = np.stack(
                [ahead_m[:, [0, 1, 1, 0]], np.tile(np.repeat(lateral_m, 2), (len(ahead_m), 1))],
                axis=2,
            )
        else:
            outlines = lane.outlines(ahead_m, lateral_m)
        corners = np.stack(self.project(outlines[..., 0], outlines[..., 1], 0.0), axis=2)
        for pixels in np.rint(corners * 16).astype(np.int32):
            if lane is None:
                cv2.fillConvexPoly(image, pixels, bgr, cv2.LINE_AA, 4)
            else:
                cv2.fillPoly(image, [pixels], bgr, cv2.LINE_AA, 4)

    def _with_noise(self, image: Image, share: float, rng: np.random.Generator) -> Image:
        row, column = (int(start) for start in rng.integers(0, 64, 2))
        grain = self._noise[row : row + image.shape[0], column : column + image.shape[1]]
        noisy = cv2.addWeighted(image, 1.0, grain, share, -128.0 * share)
        return np.asarray(noisy, np.uint8)


class _BentLane:
    """Places on the road by the distance along the lane and to the right of its middle."""

    STEP_M = 2.0

    def __init__(self, middle_m: tuple[tuple[float, float], ...]) -> None:
        self._middle = np.asarray(middle_m)
        steps = np.diff(self._middle, axis=0)
        lengths = np.hypot(*steps.T)
        self._along = np.concatenate([[0.0], np.cumsum(lengths)])
        across = np.stack([-steps[:, 1], steps[:, 0]], axis=1) / lengths[:, None]
        self._across = np.concatenate([across, across[-1:]])

    def outlines(self, along_m: Array, right_m: tuple[float, float]) -> Array:
        """Outlines of strips, each up on its left side, and back on the right one.

        Args:
            along_m: from and until where along the lane, (n, 2).
            right_m: how far right of its middle both sides are.

        Returns:
            Points ahead and right of the camera, (n, points, 2).
        """
        begin_m, end_m = along_m[:, 0], np.minimum(along_m[:, 1], self._along[-1])
        steps = math.ceil(float((end_m - begin_m).max()) / self.STEP_M)
        at = np.linspace(begin_m, end_m, max(2, steps), axis=1)
        middle, across = (
            np.stack([np.interp(at, self._along, column) for column in table.T], axis=2)
            for table in (self._middle, self._across)
        )
        left, right = (middle + each * across for each in right_m)
        points = np.concatenate([left, right[:, ::-1]], axis=1)
        points[..., 0] = np.maximum(points[..., 0], _NEAREST_M)
        return points


def _bent_lane(scene: Scene) -> _BentLane | None:
    return _BentLane(scene.middle_m) if scene.middle_m else None


_EDGE_PX = 3.0
"""Around what is painted and what covers it: a texel of a warped texture is a pixel at most, and
its edges are smooth."""
_LEAST_COVER_PX = 24.0
"""Width of an opaque box whose texels are no larger than that."""

_KEPT_BY_ALPHA = 1 - np.arange(256, dtype=np.float32) / np.float32(255.0)
"""Share of what is behind a texture, by the texture's alpha."""


def warp_onto(image: Image, texture: Image, quad: Quad) -> None:
    """Blend a BGRA `texture` onto `image` so that its corners are those of `quad`.

    Colours are premultiplied: where alpha is 0 they must be 0.

    Args:
        image: drawn onto.
        texture: (h, w, 4), BGRA.
        quad: corners in the image.
    """
    left, top = np.maximum(np.floor(quad.min(axis=0)).astype(int) - 1, 0)
    right, bottom = np.minimum(
        np.ceil(quad.max(axis=0)).astype(int) + 2, (image.shape[1], image.shape[0])
    )
    if left >= right or top >= bottom:
        return
    height, width = texture.shape[:2]
    # Pixel centres: a texture's edge lies half a pixel outside the centre of its outermost pixel.
    source = np.asarray(
        [(0, 0), (width, 0), (width, height), (0, height)], np.float32
    ) - np.float32(0.5)
    target = quad - np.asarray([left, top], np.float32) - np.float32(0.5)
    matrix = cv2.getPerspectiveTransform(source, target)
    warped = cv2.warpPerspective(texture, matrix, (int(right - left), int(bottom - top)))
    region = image[top:bottom, left:right]
    # OpenCV's arithmetic in place of numpy's, which takes four times as long for three channels.
    kept = cv2.LUT(cv2.cvtColor(warped[..., 3], cv2.COLOR_GRAY2BGR), _KEPT_BY_ALPHA)
    blended = cv2.multiply(region, kept, dtype=cv2.CV_32F)
    cv2.accumulate(cv2.cvtColor(warped, cv2.COLOR_BGRA2BGR), blended)
    region[:] = np.minimum(blended + np.float32(0.5), np.float32(255.0))


def _box_of(*points: tuple[Array, Array]) -> _Box:
    """Left, top, right and bottom of pixels, each a row of u and one of v."""
    across, down = np.hstack(points)
    return float(across.min()), float(down.min()), float(across.max()), float(down.max())


def opaque(texture: Image) -> Image:
    """A BGR texture as `warp_onto` takes it, (h, w, 4)."""
    return np.dstack([texture, np.full(texture.shape[:2], 255, np.uint8)])


def _near_size(levels: tuple[Image, ...], quad: Quad) -> Image:
    """The level less than twice as wide as `quad`: warping from a larger one would alias."""
    width_px = float(quad[:, 0].max() - quad[:, 0].min())
    return next((level for level in levels if level.shape[1] < 2 * width_px), levels[-1])


def _halvings(texture: Image) -> tuple[Image, ...]:
    """`texture` and its halvings down to a few pixels."""
    levels = [texture]
    while min(levels[-1].shape[:2]) > 4:
        height, width = levels[-1].shape[:2]
        # Not pyrDown: it moves the picture by half a pixel.
        half = cv2.resize(levels[-1], (width // 2, height // 2), interpolation=cv2.INTER_AREA)
        levels.append(np.asarray(half, np.uint8))
    return tuple(levels)


@lru_cache(maxsize=64)
def _car_levels(
    width_m: float, height_m: float, bgr: tuple[int, int, int], braking: bool
) -> tuple[Image, ...]:
    return _halvings(rear_of_car(width_m, height_m, bgr, braking))


@lru_cache(maxsize=64)
def _plate_levels(text: str, plate_format: PlateFormat) -> tuple[Image, ...]:
    plate = draw_plate(text, plate_format, px_per_mm=1.0)
    return _halvings(opaque(plate))


@lru_cache(maxsize=64)
def _tag_levels(dictionary: TagDictionary, tag_id: int) -> tuple[Image, ...]:
    """The tag on a white card a quarter wider than itself."""
    tags = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, f"DICT_{dictionary}"))
    tag = tags.generateImageMarker(tag_id, _TAG_PX)
    card = np.pad(tag, round(_TAG_PX * (_TAG_CARD - 1) / 2), constant_values=255)
    return _halvings(np.dstack([card, card, card, np.full_like(card, 255)]))


def _grown(quad: Quad, factor: float) -> Quad:
    middle = quad.mean(axis=0)
    return np.asarray(middle + (quad - middle) * factor, np.float32)
