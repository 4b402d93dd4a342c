"""A camera films a monitor that shows the rig's road: the screen's page, photographed in a browser.

The photographs go through a model of a real camera: distortion, shaking, defocus, the monitor's
pixel grid, exposure, noise and JPEG.
"""

import asyncio
from collections.abc import Iterator
from dataclasses import dataclass
from statistics import median

import cv2
import numpy as np
import pytest
from playwright.async_api import Page, ViewportSize, async_playwright

from onboard.observations import Lead
from onboard.settings import parse_settings
from onboard.tools.calibrate.calibration import Chessboard
from onboard.vision.frames import Image
from onboard.vision.networks import load_perception
from onboard.vision.settings import CameraSettings, VisionSettings
from sim_rig.cars.camera_server import CameraServer, as_jpeg
from sim_rig.cars.camera_view import LENS
from sim_rig.scenario.car_config import car_config
from sim_rig.scenario.schema import Scenario
from tools import chromium

pytestmark = pytest.mark.browser

SCALE = 2
MONITOR: ViewportSize = {
    "width": SCALE * LENS.width_px,
    "height": SCALE * LENS.height_px,
}
DISTORTION = (-0.08, 0.02, 0.0, 0.0, 0.0)
CAMERA = LENS.model_copy(
    update={
        name: SCALE * getattr(LENS, name)
        for name in (
            "width_px", "height_px", "focal_x_px", "focal_y_px", "principal_x_px", "principal_y_px"
        )
    }
    | {"distortion": DISTORTION}
)  # fmt: skip
"""Of the camera in front of the monitor, at the distance that the page tells."""
PLATE, CAR_LENGTH_M = "RD288HX", 4.5
FRAMES = 20


@dataclass(frozen=True)
class Seen:
    """What the camera says of the lead."""

    texts: set[str | None]
    gap_m: float


def standing(gap_m: float) -> Scenario:
    return parse_settings(
        {
            "title": "A car stands behind another.",
            "seed": 1,
            "duration_s": 10.0,
            "radio": {"reach_m": 100},
            "cars": {
                "ann": {"plate": PLATE, "colour": "red", "lane": 1, "start_m": gap_m + CAR_LENGTH_M,
                        "speed_m_s": 0.0},
                "ben": {"plate": "X1", "lane": 1, "start_m": 0, "speed_m_s": 0.0},
            },
            "expect": [],
        },
        Scenario,
        "standing",
    )  # fmt: skip


async def photograph(scenario: Scenario, path: str, query: str = "") -> Image:
    """The monitor, pixel by pixel."""
    server = CameraServer(scenario, seed=1)
    port = await server.start()
    try:
        async with async_playwright() as playwright:
            browser = await playwright.chromium.launch(
                executable_path=path, args=chromium.ARGUMENTS
            )
            page = await browser.new_page(viewport=MONITOR)
            errors: list[str] = []
            page.on("pageerror", lambda error: errors.append(str(error)))
            # The images never end, so neither does the loading of the page.
            await page.goto(f"http://127.0.0.1:{port}/ben/screen{query}", wait_until="commit")
            await _shown(page)
            png = await page.screenshot()
            assert await page.inner_text("#distance") == "2.50"
            await browser.close()
            assert errors == []
    finally:
        await server.close()
    image = cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_COLOR)
    assert image is not None
    return np.asarray(image, np.uint8)


async def _shown(page: Page) -> None:
    await page.wait_for_function(
        "document.querySelector('#road')?.naturalWidth || document.querySelector('#board rect')"
    )
    await page.evaluate("document.querySelector('#how').hidden = true")
    await page.add_style_tag(content="#how { display: none }")


def filmed(monitor: Image, rng: np.random.Generator) -> Image:
    """What a real camera sees of the monitor."""
    height_px, width_px = monitor.shape[:2]
    matrix = np.array(
        [
            [CAMERA.focal_x_px, 0.0, CAMERA.principal_x_px],
            [0.0, CAMERA.focal_y_px, CAMERA.principal_y_px],
            [0.0, 0.0, 1.0],
        ]
    )
    grid = np.stack(np.meshgrid(np.arange(width_px), np.arange(height_px)), axis=-1)
    rays = cv2.undistortPoints(
        (grid.reshape(-1, 1, 2) + 0.5).astype(np.float64), matrix, np.array(DISTORTION), P=matrix
    ).reshape(height_px, width_px, 2)
    at = (rays - 0.5 + rng.normal(0.0, 0.3, 2)).astype(np.float32)
    view = cv2.remap(monitor, at[..., 0], at[..., 1], cv2.INTER_LINEAR).astype(np.float32)
    # Pixels of the monitor beat with those of the camera.
    phase = rng.uniform(0.0, 2.0 * np.pi, 2)
    beat = np.sin(at[..., 0] / 7.3 + phase[0]) + np.sin(at[..., 1] / 9.1 + phase[1])
    view = cv2.GaussianBlur(view, (0, 0), 0.9) * (1.0 + 0.03 * beat[..., None])
    bright = 255.0 * (view / 255.0).clip(0.0, 1.0) ** rng.uniform(0.8, 1.3)
    bright = bright * 0.85 + 12.0 + rng.normal(0.0, 4.0, bright.shape)
    jpeg = as_jpeg(bright.clip(0.0, 255.0).astype(np.uint8))
    image = cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_COLOR)
    assert image is not None
    return np.asarray(image, np.uint8)


def seen(scenario: Scenario, images: Iterator[Image]) -> Seen:
    vision = parse_settings(car_config(scenario, "ben", 0)["vision"], VisionSettings, "filmed")
    perception = load_perception(CameraSettings(source="rig", **CAMERA.model_dump()), vision)
    leads: list[Lead] = []
    for number, image in enumerate(images):
        perception.receive_frame(image, number / 10.0)
        while (event := perception.next_event()) is not None:
            leads += [event] if isinstance(event, Lead) else []
    gaps_m = [lead.gap_m for lead in leads if lead.gap_m is not None]
    return Seen({lead.text for lead in leads[-5:]}, median(gaps_m))


@pytest.mark.parametrize("gap_m", [8.0, 11.0, 14.0])
def test_the_lead_on_a_monitor_is_read_and_its_gap_measured(
    chromium_path: str, gap_m: float
) -> None:
    scenario, rng = standing(gap_m), np.random.default_rng(1)
    monitor = asyncio.run(photograph(scenario, chromium_path))

    found = seen(scenario, (filmed(monitor, rng) for _ in range(FRAMES)))

    assert found.texts == {PLATE}
    assert found.gap_m == pytest.approx(gap_m, rel=0.03)


def test_the_monitor_shows_a_chessboard_to_calibrate_with(chromium_path: str) -> None:
    monitor = asyncio.run(photograph(standing(8.0), chromium_path, "?board"))
    found = Chessboard(9, 6, 0.03).find(
        np.asarray(cv2.cvtColor(monitor, cv2.COLOR_BGR2GRAY), np.uint8)
    )

    assert found is not None
    _, pixels = found
    assert len(pixels) == 9 * 6
