"""A whole street: road, roadside, vehicles of five kinds, light, windscreen and camera."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from functools import partial

import cv2
import numpy as np
import numpy.typing as npt

from onboard.vision.vehicle_network import VehicleKind
from sim_rig.rendering.street.canvas import FINE, Bgr, Canvas, Daylight, Image, RoadCamera
from sim_rig.rendering.street.cars import draw_car, draw_flat_rear, random_car, random_van
from sim_rig.rendering.street.dashcam import through_dashcam
from sim_rig.rendering.street.ground import RoadLayout, draw_ground, random_layout
from sim_rig.rendering.street.large_vehicles import draw_bus, draw_truck
from sim_rig.rendering.street.roadside import THINGS
from sim_rig.rendering.street.solids import Pose
from sim_rig.rendering.street.textures import roughen, tile
from sim_rig.rendering.street.two_wheelers import draw_motorcycle
from sim_rig.rendering.street.windscreen import look_through


class StreetLight(StrEnum):
    """Time of day and weather."""

    SUN = "sun"
    OVERCAST = "overcast"
    FOG = "fog"
    DUSK = "dusk"
    NIGHT = "night"


@dataclass(frozen=True, slots=True)
class SeenVehicle:
    """A vehicle in a picture; pixels are those of the picture."""

    kind: VehicleKind
    box_px: tuple[float, float, float, float]
    """Left, top, right, bottom, with what others hide; may lie partly outside."""
    end_px: tuple[float, float] | None
    """Left and right side of its rear or front; `None` if it is seen from the side."""
    ahead_m: float
    """Distance to the nearest part."""
    visible: float
    """Share of it that nothing hides, within the picture."""


@dataclass(frozen=True, slots=True)
class Street:
    """A picture with its vehicles."""

    image: Image
    """(h, w, 3) BGR."""
    vehicles: tuple[SeenVehicle, ...]
    light: StreetLight


@dataclass(frozen=True, slots=True)
class _Vehicle:
    kind: VehicleKind
    size_m: tuple[float, float, float]
    """Length, width, height."""
    draw: Callable[[Canvas, Pose, np.random.Generator], None]


_LIGHTS = tuple(StreetLight)
_KINDS = tuple(VehicleKind)
_LEAST_VISIBLE = 0.02
_WIDTHS_PX, _SMALL_WIDTHS_PX = (7.0, 240.0), (8.0, 50.0)
_FLAT = 0.06
"""Share of the cars that are drawn as `sim_rig.rendering.scene` does."""


def random_street(
    size_px: tuple[int, int],
    rng: np.random.Generator,
    *,
    light: StreetLight | None = None,
    kinds: tuple[VehicleKind, ...] | None = None,
) -> Street:
    """Draw a street at random.

    Args:
        size_px: width and height of the picture.
        rng: source of all random numbers.
        light: time of day; `None` draws one.
        kinds: of the vehicles; empty: none at all; `None` draws each.
    """
    if light is None:
        light = _LIGHTS[int(rng.choice(5, p=[0.36, 0.27, 0.06, 0.13, 0.18]))]
    canvas = Canvas(_random_camera(size_px, rng), _daylight(light, rng))
    layout = random_layout(rng)
    draw_ground(canvas, layout, rng)
    traffic = _traffic(canvas.camera, layout, kinds, rng)
    shares = np.cumsum([share for _, share in THINGS])
    things: list[tuple[float, Callable[[], None]]] = []
    for _ in range(int(rng.integers(2, 24))):
        thing, _ = THINGS[int(np.searchsorted(shares / shares[-1], rng.random()))]
        ahead_m = float(np.exp(rng.uniform(np.log(5), np.log(200))))
        things.append((ahead_m, partial(thing, canvas, ahead_m, layout, rng)))
    drawn: dict[int, int] = {}
    for number, (vehicle, pose) in enumerate(traffic, 1):
        draw = partial(_draw_vehicle, canvas, number, (vehicle, pose), drawn, rng)
        things.append((pose.ahead_m, draw))
    for _, draw_thing in sorted(things, key=lambda thing: -thing[0]):
        draw_thing()
    image = cv2.resize(canvas.image, size_px, interpolation=cv2.INTER_AREA)
    picture = np.asarray(image, np.uint8)
    if rng.random() < 0.2 and light is not StreetLight.FOG:
        _wet(picture, canvas, rng)
    picture = _with_glow(picture, canvas, rng)
    if rng.random() < 0.3:
        roughen(picture, np.clip(tile(picture.shape[:2], 0.12, rng), 0.5, 1.5))
    brightness = min(1.0, canvas.light.ambient + canvas.light.sun)
    bottom = float(rng.uniform(0.55, 0.98)) if rng.random() < 0.5 else 1.0
    bottom = max(bottom, canvas.camera.centre_px[1] / canvas.camera.size_px[1] + 0.12)
    hidden = look_through(picture, brightness, bottom, rng)
    canvas.owners[hidden] = 0
    picture = through_dashcam(picture, rng)
    seen = tuple(
        found
        for number, (vehicle, pose) in enumerate(traffic, 1)
        if (found := _seen(canvas, number, vehicle, pose, drawn)) is not None
    )
    return Street(picture, seen, light)


def _random_camera(size_px: tuple[int, int], rng: np.random.Generator) -> RoadCamera:
    width, height = size_px[0] * FINE, size_px[1] * FINE
    # A picture is the whole of a wide lens's, or a part of a longer one's.
    focal_px = width * float(np.exp(rng.uniform(np.log(0.42), np.log(3.2))))
    is_bent = rng.random() < 0.5
    return RoadCamera(
        size_px=(width, height),
        focal_px=focal_px,
        centre_px=(width * float(rng.uniform(0.1, 0.9)), height * float(rng.uniform(0.12, 0.72))),
        height_m=float(rng.uniform(1.05, 1.7) if rng.random() < 0.85 else rng.uniform(1.7, 2.8)),
        roll_rad=float(rng.normal(0, 0.02)),
        curvature_1_m=float(rng.normal(0, 0.003)) if is_bent else 0.0,
        hill_1_m=float(rng.normal(0, 0.0004)) if rng.random() < 0.5 else 0.0,
        k1=float(rng.uniform(-0.12, 0.02)) if focal_px < width else 0.0,
    )


def _daylight(light: StreetLight, rng: np.random.Generator) -> Daylight:
    def level(low: float, high: float) -> float:
        return float(rng.uniform(low, high))

    def grey(low: float, high: float, blue: float = 0.0) -> Bgr:
        value, tint = rng.uniform(low, high), rng.normal(0, 6)
        return (
            float(np.clip(value + blue + tint, 0, 255)),
            float(np.clip(value, 0, 255)),
            float(np.clip(value - 0.6 * blue - tint, 0, 255)),
        )

    azimuth, height = level(0, 2 * np.pi), level(0.15, 1.3) if light is StreetLight.SUN else 0.2
    sun = (
        math.cos(height) * math.cos(azimuth),
        math.cos(height) * math.sin(azimuth),
        math.sin(height),
    )
    match light:
        case StreetLight.SUN:
            sky, haze = grey(130, 225, level(0, 60)), grey(170, 250, level(0, 30))
            lit, sight_m = (level(0.35, 0.65), level(0.3, 0.7), sun, 0.0), level(150, 3000)
            is_dark = False
        case StreetLight.OVERCAST:
            sky, haze = grey(140, 255), grey(150, 255)
            lit, sight_m = (level(0.5, 0.95), 0.0, sun, 0.0), level(150, 2000)
            is_dark = False
        case StreetLight.FOG:
            sky = haze = grey(120, 230)
            lit, sight_m = (level(0.5, 0.9), 0.0, sun, 0.0), level(25, 90)
            is_dark = bool(rng.random() < 0.6)
        case StreetLight.DUSK:
            sky, haze = grey(50, 170, level(-20, 50)), grey(60, 190, level(-30, 30))
            lit, sight_m = (level(0.15, 0.4), level(0, 0.2), sun, level(0, 0.15)), level(150, 1500)
            is_dark = bool(rng.random() < 0.7)
        case _:  # night
            sky = haze = grey(2, 40, level(-10, 12))
            lit, sight_m = (level(0.02, 0.16), 0.0, sun, level(0.15, 0.7)), level(200, 2000)
            is_dark = True
    return Daylight(*lit, haze, sight_m, sky, is_dark=is_dark)


def _random_vehicle(kind: VehicleKind, rng: np.random.Generator) -> _Vehicle:
    if kind is VehicleKind.CAR and rng.random() < _FLAT:
        return _Vehicle(kind, (0.2, 1.8, 1.5), draw_flat_rear)
    if kind in (VehicleKind.CAR, VehicleKind.VAN):
        shape = random_car(rng) if kind is VehicleKind.CAR else random_van(rng)
        size_m = shape.length_m, shape.width_m, shape.height_m
        return _Vehicle(kind, size_m, lambda canvas, pose, r: draw_car(canvas, pose, shape, r))
    ranges = {
        VehicleKind.TRUCK: ((5.5, 14.0), (2.1, 2.6), (2.6, 4.2)),
        VehicleKind.BUS: ((7.0, 13.0), (2.3, 2.56), (2.8, 4.0)),
        VehicleKind.MOTORCYCLE: ((1.9, 2.3), (0.65, 0.95), (1.5, 1.85)),
    }[kind]
    length, width, height = (float(rng.uniform(*bounds)) for bounds in ranges)
    size = length, width, height
    draw = {
        VehicleKind.TRUCK: draw_truck,
        VehicleKind.BUS: draw_bus,
        VehicleKind.MOTORCYCLE: draw_motorcycle,
    }[kind]
    return _Vehicle(kind, size, lambda canvas, pose, r: draw(canvas, pose, size, r))


def _traffic(
    camera: RoadCamera,
    layout: RoadLayout,
    kinds: tuple[VehicleKind, ...] | None,
    rng: np.random.Generator,
) -> list[tuple[_Vehicle, Pose]]:
    """Vehicles in the lanes, at the roadside and across, none in another."""
    if kinds == ():
        return []
    lanes = [(layout.middle_of(n), 0.0) for n in range(-layout.lanes_left, layout.lanes_right + 1)]
    lanes += [(layout.oncoming_middle(n), np.pi) for n in range(layout.lanes_oncoming)]
    lanes.append(
        (layout.right_m + max(1.1, layout.shoulder_m - 1.0), float(rng.choice([0, np.pi])))
    )
    found: list[tuple[_Vehicle, Pose]] = []
    for _ in range(
        int(rng.choice([0, 1, 2, 3, 5, 8, 11], p=[0.1, 0.1, 0.15, 0.2, 0.2, 0.15, 0.1]))
    ):
        if kinds is None:
            kind = _KINDS[int(rng.choice(5, p=[0.62, 0.11, 0.14, 0.06, 0.07]))]
        else:
            kind = kinds[int(rng.integers(len(kinds)))]
        vehicle = _random_vehicle(kind, rng)
        lane_m, heading = lanes[int(rng.integers(len(lanes)))]
        if rng.random() < 0.25:
            lane_m, heading = layout.middle_of(0), 0.0
        heading += float(rng.normal(0, 0.03))
        if rng.random() < 0.1:  # turning or crossing
            heading += float(rng.uniform(-np.pi, np.pi))
        widths_px = _WIDTHS_PX if rng.random() < 0.5 else _SMALL_WIDTHS_PX
        width_px = float(np.exp(rng.uniform(*np.log(widths_px))))
        near_m = max(2.0, camera.focal_px / FINE * vehicle.size_m[1] / width_px)
        reach = abs(np.cos(heading)) * vehicle.size_m[0] + abs(np.sin(heading)) * vehicle.size_m[1]
        pose = Pose(near_m + reach / 2, lane_m + float(rng.normal(0, 0.3)), heading)
        if all(_apart(vehicle, pose, *other) for other in found):
            found.append((vehicle, pose))
    return found


def _apart(one: _Vehicle, at: Pose, other: _Vehicle, there: Pose) -> bool:
    def reach(vehicle: _Vehicle, pose: Pose) -> npt.NDArray[np.float64]:
        cosine, sine = abs(np.cos(pose.heading_rad)), abs(np.sin(pose.heading_rad))
        length, width, _ = vehicle.size_m
        return np.asarray([cosine * length + sine * width, sine * length + cosine * width]) / 2

    away = np.abs([at.ahead_m - there.ahead_m, at.right_m - there.right_m])
    return bool((away > reach(one, at) + reach(other, there) + (0.8, 0.2)).any())


def _draw_vehicle(
    canvas: Canvas,
    number: int,
    placed: tuple[_Vehicle, Pose],
    drawn: dict[int, int],
    rng: np.random.Generator,
) -> None:
    """Draw its shadow, then itself; note how many pixels it covers."""
    vehicle, pose = placed
    length, width, height = vehicle.size_m
    light = canvas.light
    if vehicle.kind is not VehicleKind.MOTORCYCLE or rng.random() < 0.5:
        corners = [(-0.52, -0.55), (-0.52, 0.55), (0.52, 0.55), (0.52, -0.55)]
        foot = pose.place([(x * length, y * width, 0.0) for x, y in corners])
        blur_px = 0.12 * canvas.camera.px_per_m(max(pose.ahead_m - length / 2, 2.0))
        canvas.darken(foot, float(rng.uniform(0.15, 0.6)), min(blur_px, 12.0))
        if light.sun > 0.1 and light.towards_sun[2] > 0.1:
            cast = height / light.towards_sun[2]
            moved = foot - np.asarray([light.towards_sun[0], light.towards_sun[1], 0]) * cast * 0.8
            hull = cv2.convexHull(np.vstack([foot, moved])[:, :2].astype(np.float32))[:, 0]
            ground = np.column_stack([hull, np.zeros(len(hull))])
            canvas.darken(ground, float(rng.uniform(0.35, 0.7)), 1.5)
    canvas.owner = number
    vehicle.draw(canvas, pose, rng)
    canvas.owner = 0
    covered = canvas.owners == number
    drawn[number] = int(covered.sum())
    if drawn[number] > 300 and rng.random() < 0.6:  # what body and panes mirror
        box = cv2.boundingRect(covered.astype(np.uint8))
        left, top, wide, high = (FINE * int(side) for side in box)
        part = canvas.image[top : top + high, left : left + wide]
        mask = covered[box[1] : box[1] + box[3], box[0] : box[0] + box[2]].astype(np.float32)
        factors = tile((box[3], box[2]), float(rng.uniform(0.03, 0.22)), rng)
        factors = 1 + (np.clip(factors, 0.4, 1.8) - 1) * mask
        roughen(part, np.asarray(cv2.resize(factors, part.shape[1::-1]), np.float32))


def _wet(picture: Image, canvas: Canvas, rng: np.random.Generator) -> None:
    """The road mirrors what is above it."""
    horizon = round(canvas.camera.centre_px[1] / FINE)
    depth = min(horizon, picture.shape[0] - horizon) - 1
    if depth < 8:
        return
    mirrored = picture[horizon - depth : horizon][::-1]
    soft = cv2.blur(mirrored, (3, int(rng.integers(5, 31))))
    share = float(rng.uniform(0.1, 0.45))
    lower = picture[horizon : horizon + depth]
    is_road = (canvas.owners[horizon : horizon + depth] == 0)[..., None]
    mixed = (1 - share) * lower + share * np.asarray(soft, np.float32)
    lower[:] = np.where(is_road, mixed, lower).astype(np.uint8)


def _with_glow(picture: Image, canvas: Canvas, rng: np.random.Generator) -> Image:
    if not canvas.glow.any():
        return picture
    near = cv2.GaussianBlur(canvas.glow, (0, 0), float(rng.uniform(0.8, 2.5)))
    wide = cv2.GaussianBlur(canvas.glow, (0, 0), float(rng.uniform(5, 12)))
    strength = float(rng.uniform(0.8, 2.0))
    dark = 1.0 if canvas.light.is_dark else 0.3
    total = cv2.addWeighted(near, strength * max(0.5, dark), wide, 1.5 * strength * dark, 0.0)
    return np.asarray(cv2.add(picture, total), np.uint8)


def _seen(
    canvas: Canvas, number: int, vehicle: _Vehicle, pose: Pose, drawn: dict[int, int]
) -> SeenVehicle | None:
    """What of a vehicle is in the picture; `None`: hardly anything."""
    if not drawn.get(number):
        return None
    visible = int((canvas.owners == number).sum()) / drawn[number]
    if visible < _LEAST_VISIBLE:
        return None
    left, top, right, bottom = canvas.extents[number]
    length, width, _ = vehicle.size_m
    cosine, sine = np.cos(pose.heading_rad), np.sin(pose.heading_rad)
    end_px = None
    if abs(sine) < np.sin(0.6):
        near = -length / 2 if cosine > 0 else length / 2
        ends = pose.place([(near, side * width / 2, 0.5) for side in (-1, 1)])
        if ends[:, 0].min() > 1.0:
            columns = canvas.camera.project(ends)[:, 0] / FINE
            end_px = float(columns.min()), float(columns.max())
    reach = abs(cosine) * length + abs(sine) * width
    return SeenVehicle(
        vehicle.kind, (left, top, right, bottom), end_px, pose.ahead_m - reach / 2, visible
    )
