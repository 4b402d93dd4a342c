"""The pages of a live demonstration: real daemons with cameras, buses and radios."""

import asyncio
import math
from pathlib import Path

import pytest
from playwright.async_api import Browser, Page, async_playwright, expect

from sim_rig.runs.live import LiveTestbench
from sim_rig.scenario.schema import load_scenario
from tools import chromium

pytestmark = [pytest.mark.browser, pytest.mark.live]

SLOW_MS = 20_000
"""Real daemons beside browsers on a busy computer need this long."""
TRIES = 5


def test_a_group_forms_an_alarm_is_shown_and_a_restarted_vehicle_rejoins(
    chromium_path: str, tmp_path: Path
) -> None:
    asyncio.run(asyncio.wait_for(look_at_demo(chromium_path, tmp_path), 150.0))


async def look_at_demo(path: str, folder: Path) -> None:
    whole = load_scenario("ar-tags")
    pair = {name: whole.cars[name] for name in ("green", "red")}
    scenario = whole.model_copy(update={"cars": pair, "duration_s": 300.0, "expect": ()})
    async with LiveTestbench(scenario, 1, folder) as testbench, async_playwright() as playwright:
        browser = await playwright.chromium.launch(executable_path=path, args=chromium.ARGUMENTS)
        running = asyncio.create_task(testbench.run())
        while math.isinf(testbench.start_s):
            await asyncio.sleep(0.1)
        green = await open_page(browser, testbench.pages["green"])
        red = await open_page(browser, testbench.pages["red"])
        engineer = await open_page(browser, testbench.pages["engineer"])

        await expect(red.locator("#state")).to_have_text("Member 2")
        await expect(green.locator("#state")).to_have_text("Leader")
        await expect(red.locator("#road .plate-text")).to_have_text("TAG1")

        await brake_until_alarmed(green, red)
        await expect(engineer.locator("#timeline .alarm").first).to_be_visible()
        await engineer.click("#earlier-warning")
        await expect(engineer.locator('[data-car="red"].card .notes')).to_contain_text("lcca")

        running.cancel()
        await testbench.processes.stop("red")
        await expect(red.locator("#stale-headline")).to_have_text("No data")
        await testbench.processes.start("red", "-m", "onboard", "run", str(folder / "red.yaml"))
        await expect(red.locator("#stale")).to_be_hidden()
        await expect(red.locator("#state")).to_have_text("Member 2")
        await browser.close()


async def open_page(browser: Browser, address: str) -> Page:
    page = await (await browser.new_context()).new_page()
    page.on("pageerror", lambda error: pytest.fail(f"an error in the page: {error}"))
    await page.goto(address)
    return page


async def brake_until_alarmed(green: Page, red: Page) -> None:
    """Press the button, again if a busy computer has dropped the vehicle from the group."""
    for _ in range(TRIES):
        await expect(red.locator("#state")).to_have_text("Member 2")
        await green.click("#brake")
        try:
            await expect(red.locator("#alarm")).to_be_visible(timeout=2000)
        except AssertionError:
            continue
        return
    raise AssertionError("no alarm after several brakings")


expect.set_options(timeout=SLOW_MS)
