"""What lies over the road or the lead, and odd vehicles: no ghost, no false text, no free lane."""

from collections.abc import Callable

import cv2
import numpy as np
import pytest

from onboard.observations import Lead, LeadIdentity
from onboard.vision.networks import load_networks
from onboard.vision.perception import Perception
from onboard.vision.settings import VisionSettings
from sim_rig.rendering.car_art import rear_of_car
from sim_rig.rendering.scene import Image, Scene, SceneCar, warp_onto
from tests.vision.drive import CAMERA, RENDERER, frames, observe

PLATE, GAP_M, SECONDS = "GN417KB", 9.0, 1.5
CAR = SceneCar(GAP_M, 0.1, plate=PLATE, colour_bgr=(40, 40, 170))
NETWORKS = load_networks(VisionSettings())
ROWS, COLUMNS = CAMERA.height_px, CAMERA.width_px
Overlay = Callable[[Image, float], None]
"""Changes the frame of a time in place."""


def leads(car: SceneCar | None, overlay: Overlay) -> list[Lead]:
    """Answers on a drive behind `car`, or on an empty road."""

    def scene(stamp_s: float) -> Scene:
        return Scene((car,) if car else (), travelled_m=15.0 * stamp_s)

    def seen() -> list[tuple[float, Image]]:
        drive = [(stamp_s, image.copy()) for stamp_s, image in frames(scene, SECONDS)]
        for stamp_s, image in drive:
            overlay(image, stamp_s)
        return drive

    return observe(Perception(CAMERA, VisionSettings(), NETWORKS), iter(seen())).leads


def wiper(image: Image, stamp_s: float) -> None:
    """A blade that crosses the picture each 0.7 s."""
    tip_px = round(COLUMNS * abs(2 * (stamp_s / 1.4 % 1) - 1))
    cv2.line(image, (COLUMNS // 2, ROWS + 200), (tip_px, 0), (18, 18, 18), 40, cv2.LINE_AA)


def glare(image: Image, _: float) -> None:
    """A low sun beside the lead, with a veil over everything."""
    light = np.zeros((ROWS, COLUMNS), np.float32)
    cv2.circle(light, (COLUMNS * 2 // 3, ROWS // 3), 60, 1.0, cv2.FILLED)
    light = cv2.GaussianBlur(light, (0, 0), 50) * 3 + 0.25
    image[:] = np.clip(image + 160 * light[..., None], 0, 255).astype(np.uint8)


def rolling_shutter(image: Image, stamp_s: float) -> None:
    """Rows shifted by up to 6 px: the camera shakes within a frame, as a phone in its holder."""
    for row in range(ROWS):
        shift = round(6 * np.sin(2 * np.pi * (11 * stamp_s + 1.5 * row / ROWS)))
        image[row] = np.roll(image[row], shift, axis=0)


def rain(image: Image, stamp_s: float) -> None:
    """Streaks in the air, and drops on the windscreen that stay."""
    falling, resting = np.random.default_rng(round(10 * stamp_s)), np.random.default_rng(7)
    for _ in range(250):
        x, y = (int(v) for v in falling.integers(0, (COLUMNS, ROWS)))
        cv2.line(image, (x, y), (x + 2, y + 18), (200, 200, 200), 1, cv2.LINE_AA)
    soft = cv2.GaussianBlur(image, (0, 0), 6)
    for _ in range(40):
        place = tuple(int(v) for v in resting.integers(0, (COLUMNS, ROWS)))
        drop = np.zeros((ROWS, COLUMNS), np.uint8)
        cv2.circle(drop, place, int(resting.integers(4, 14)), 255, cv2.FILLED)
        cv2.copyTo(soft, drop, image)


def bicycle_rack(image: Image, _: float) -> None:
    """Two wheels and bars before the plate."""
    left, top = RENDERER.project(GAP_M, CAR.lateral_m - 0.8, 1.0)
    right, bottom = RENDERER.project(GAP_M, CAR.lateral_m + 0.8, 0.4)
    side_px, middle_px = right - left, (top + bottom) / 2
    for share in (0.25, 0.75):
        hub = round(left + share * side_px), round(middle_px)
        cv2.circle(image, hub, round(0.2 * side_px), (20, 20, 20), 3, cv2.LINE_AA)
    for share in (0.3, 0.5, 0.7):
        ends = (round(left), round(bottom)), (round(left + share * side_px), round(top))
        cv2.line(image, *ends, (30, 30, 30), 4, cv2.LINE_AA)


def open_boot(image: Image, _: float) -> None:
    """A dark hold where window and plate were; the lid stands above the roof."""
    for low_m, high_m, shade in ((0.5, 1.3, (25, 25, 28)), (1.5, 2.1, (36, 36, 150))):
        left, top = RENDERER.project(GAP_M, CAR.lateral_m - 0.7, high_m)
        right, bottom = RENDERER.project(GAP_M, CAR.lateral_m + 0.7, low_m)
        ends = (round(left), round(top)), (round(right), round(bottom))
        cv2.rectangle(image, *ends, shade, cv2.FILLED)


def load_of_cars(image: Image, _: float) -> None:
    """Two rears above each other on the carrier ahead."""
    for low_m, colour in ((1.1, (170, 60, 30)), (2.7, (60, 190, 190))):
        rear = rear_of_car(1.8, 1.4, colour, braking=False)
        corners = [
            RENDERER.project(GAP_M, 0.1 + side_m, height_m)
            for side_m, height_m in ((-0.9, low_m + 1.4), (0.9, low_m + 1.4), (0.9, low_m))
        ]
        corners.append(RENDERER.project(GAP_M, -0.8, low_m))
        warp_onto(image, rear, np.asarray(corners, np.float32))


def nothing(_image: Image, _stamp_s: float) -> None:
    """A plain view."""


VEHICLES = {
    "car": CAR,
    "carrier": SceneCar(GAP_M, 0.1, width_m=2.5, height_m=4.0, plate=PLATE),
    "motorcycle": SceneCar(GAP_M, 0.1, width_m=0.7, height_m=1.6, length_m=2.2, plate=PLATE),
}


@pytest.mark.long
@pytest.mark.parametrize(
    ("overlay", "vehicle"),
    [
        (wiper, "car"),
        (glare, "car"),
        (rolling_shutter, "car"),
        (rain, "car"),
        (bicycle_rack, "car"),
        (open_boot, "car"),
        (load_of_cars, "carrier"),
        (nothing, "motorcycle"),
    ],
)
def test_a_vehicle_behind_it_is_the_lead_or_unknown(overlay: Overlay, vehicle: str) -> None:
    answers = leads(VEHICLES[vehicle], overlay)

    assert {lead.text for lead in answers} <= {None, PLATE}
    later = [lead for lead in answers if lead.stamp_s >= 0.5]
    assert LeadIdentity.NO_LEAD not in {lead.identity for lead in later}
    for lead in later:
        if lead.gap_m is not None and lead.gap_sigma_m is not None:
            assert abs(lead.gap_m - GAP_M) < max(3 * lead.gap_sigma_m, 0.1 * GAP_M), lead


@pytest.mark.long
@pytest.mark.parametrize("overlay", [wiper, glare, rolling_shutter, rain])
def test_over_an_empty_road_it_is_no_lead(overlay: Overlay) -> None:
    assert {lead.gap_m for lead in leads(None, overlay)} == {None}
