"""Takes the screenshots in docs/pictures from the running demonstration.

    .venv/bin/python -m tools.page_pictures

Needs an idle machine, since the browser shares the processor with four daemons.
"""

import asyncio
import math
import sys
import tempfile
from pathlib import Path
from typing import Literal

import cv2
import numpy as np
from PIL import Image
from playwright.async_api import Browser, Page, ViewportSize, async_playwright, expect

from sim_rig.runs.live import LiveTestbench
from sim_rig.scenario.schema import load_scenario
from tools import chromium

PICTURES = Path(__file__).parents[1] / "docs" / "pictures"
PHONE: ViewportSize = {"width": 390, "height": 800}
LAPTOP: ViewportSize = {"width": 1440, "height": 900}
MARGIN_PX = 28
GREY = (150, 150, 150)


async def main() -> None:
    """Run the demonstration until its second braking."""
    path = chromium.find()
    if path is None:
        sys.exit(chromium.HOW)
    scenario = load_scenario("fig4")
    with tempfile.TemporaryDirectory() as name:
        async with (
            LiveTestbench(scenario, scenario.seed, Path(name)) as testbench,
            async_playwright() as play,
        ):
            browser = await play.chromium.launch(executable_path=path, args=chromium.ARGUMENTS)
            running = asyncio.create_task(testbench.run())
            while math.isinf(testbench.start_s):
                await asyncio.sleep(0.1)
            await drivers(browser, testbench.pages["blue"])
            await engineers(browser, testbench.pages["engineer"])
            running.cancel()
            await browser.close()


async def drivers(browser: Browser, address: str) -> None:
    """Take the driver's page by day, by night, and by night with an alarm, side by side."""
    day, night = [
        await open_page(browser, address, PHONE, "light", 2),
        await open_page(browser, address, PHONE, "dark", 2),
    ]
    for page in (day, night):
        await page.click("#sound")
    await expect(night.locator("#state")).to_have_text("Member 3", timeout=30_000)
    shots = [await day.screenshot(), await night.screenshot()]
    await expect(night.locator("body")).to_have_attribute("data-alarm", "warning", timeout=30_000)
    shots.append(await night.screenshot())
    edge = cv2.BORDER_CONSTANT
    framed = [
        cv2.copyMakeBorder(
            decode(shot), MARGIN_PX, MARGIN_PX, MARGIN_PX, MARGIN_PX, edge, value=GREY
        )
        for shot in shots
    ]
    small = cv2.resize(np.hstack(framed), None, fx=0.6, fy=0.6, interpolation=cv2.INTER_AREA)
    write(small, "driver.png")
    for page in (day, night):
        await page.context.close()


async def engineers(browser: Browser, address: str) -> None:
    """Take the engineer's page at the time of the last warning."""
    page = await open_page(browser, address, LAPTOP, "dark", 1)
    await page.wait_for_timeout(7_000)
    await page.click("#earlier-warning")
    await page.click("#windows button:nth-child(1)")
    await page.wait_for_timeout(1_500)
    write(decode(await page.screenshot()), "engineer.png")


def decode(shot: bytes) -> np.ndarray:
    """Decode a screenshot to BGR."""
    image = cv2.imdecode(np.frombuffer(shot, np.uint8), cv2.IMREAD_COLOR)
    if image is None:
        raise ValueError("the browser's screenshot is no picture")
    return image


def write(image: np.ndarray, name: str) -> None:
    """Write an image with 256 colours, which takes a third of the bytes."""
    palette = Image.fromarray(cv2.cvtColor(image, cv2.COLOR_BGR2RGB))
    palette.quantize(256, dither=Image.Dither.NONE).save(PICTURES / name, optimize=True)


async def open_page(
    browser: Browser,
    address: str,
    size: ViewportSize,
    colours: Literal["light", "dark"],
    scale: int,
) -> Page:
    """Open a page in its own browser context.

    Args:
        browser: running browser.
        address: of the page.
        size: viewport, with width and height.
        colours: `light` or `dark`.
        scale: device pixels of a CSS pixel.
    """
    context = await browser.new_context(
        viewport=size, color_scheme=colours, device_scale_factor=scale
    )
    page = await context.new_page()
    await page.goto(address)
    return page


asyncio.run(main())
