"""Delay from an alarm to its display, and the load of browsers on the event loop.

An alarm is displayed when the browser has drawn the frame with it. The aim and reference is 100 ms,
within which people perceive an effect as immediate. The reference of the loop's delay is the same
loop without browsers. Browsers and loop share the processor cores here, but not in a car; so the
same is measured with readers that receive every view and draw nothing.
"""

import asyncio
import sys
import time
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager, suppress
from dataclasses import replace
from statistics import quantiles

import numpy as np
from playwright.async_api import Browser, Page, async_playwright

from bench import Figure
from onboard.observations import Lead, LeadIdentity, PlateCandidate, Sensor, Speed
from onboard.risk.alarm import Alarm, Level
from onboard.risk.eebl import EEBL
from onboard.runtime.driver_page import DriverPage
from onboard.settings import parse_settings
from onboard.step import Input
from onboard.trace.trace_line import Event
from onboard.vehicle.config import CarConfig
from onboard.vehicle.stack import Stack
from tools import chromium

PORT = 8461
AHEAD = Lead(
    0.0,
    LeadIdentity.KNOWN,
    "AHEAD1",
    15.0,
    0.3,
    0.2,
    0.3,
    track_id=1,
    candidates=(PlateCandidate("AHEAD1", 0.98),),
)
AIM_S = 0.1
ALARMS = 40
BROWSERS = 20
PROBE_S = 0.01
PROBE_FOR_S = 6.0
READERS = """
import asyncio, sys, aiohttp
async def read(session, address):
    async with session.ws_connect(address) as views:
        async for view in views:
            await views.send_str("shown " + view.data.partition(" ")[0])
async def main(address, count):
    async with aiohttp.ClientSession() as session:
        await asyncio.gather(*(read(session, address) for _ in range(count)))
asyncio.run(main(sys.argv[1], int(sys.argv[2])))
"""
WATCH = """
() => {
  window.shownAt = [];
  new MutationObserver(() => {
    const level = document.body.dataset.alarm;
    requestAnimationFrame(() => setTimeout(() => shownAt.push([level, Date.now() / 1000])));
  }).observe(document.body, { attributeFilter: ["data-alarm"] });
}
"""
"""Records the alarm level after the frame in which it is drawn."""


def measure() -> Iterator[Figure]:
    """Yield the delays of alarms, and those of the loop."""
    path = chromium.find()
    if path is None:
        print(chromium.HOW, file=sys.stderr)
        return
    shown_s, delays_s = asyncio.run(_measure(path))
    for name, value_s in _percentiles(shown_s).items():
        yield Figure(f"pages.alarm_shown.{name}", value_s, "s", len(shown_s), "the aim", AIM_S)
    alone = _percentiles(delays_s.pop("alone"))
    for load, found_s in delays_s.items():
        for name, value_s in _percentiles(found_s).items():
            what = f"pages.loop_delay_{BROWSERS}_{load}.{name}"
            yield Figure(what, value_s, "s", len(found_s), "no browser", alone[name])


async def _measure(path: str) -> tuple[list[float], dict[str, list[float]]]:
    delays_s = {}
    async with _car() as car, async_playwright() as playwright:
        delays_s["alone"] = await _loop_delays_s()
        views = f"http://127.0.0.1:{PORT}/views"
        readers = await asyncio.create_subprocess_exec(
            sys.executable, "-c", READERS, views, str(BROWSERS)
        )
        await asyncio.sleep(2.0)
        delays_s["readers"] = await _loop_delays_s()
        readers.terminate()
        await readers.wait()
        browser = await playwright.chromium.launch(executable_path=path, args=chromium.ARGUMENTS)
        page = await _open(browser)
        await page.evaluate(WATCH)
        shown_s = [delay_s async for delay_s in _alarm_delays_s(car, page)]
        for _ in range(BROWSERS - 1):
            other = await page.context.new_page()
            await other.goto(f"http://127.0.0.1:{PORT}/")
        delays_s["browsers"] = await _loop_delays_s()
        await browser.close()
    return shown_s, delays_s


@asynccontextmanager
async def _car() -> AsyncIterator["_Car"]:
    car = _Car()
    await car.page.start()
    driving = asyncio.create_task(car.drive())
    yield car
    driving.cancel()
    with suppress(asyncio.CancelledError):
        await driving
    await car.page.close()


class _Car:
    """A stack with a driver page and simulated sensors."""

    def __init__(self) -> None:
        tree = {"car": {"plate": "BENCH"}, "hmi": {"port": PORT}}
        config = parse_settings(tree, CarConfig, "bench")
        assert config.hmi is not None  # noqa: S101 (just given)
        rng = np.random.default_rng(1)
        sensors = (Sensor.SPEED, Sensor.CAMERA)
        self._stack = Stack(config, sensors, rng, now=time.monotonic(), utc_s=time.time())
        self.page = DriverPage(config.hmi, config, self._stack, lambda _: None)

    async def drive(self) -> None:
        """Feed the stack with speed at 20 Hz and a lead at 10 Hz."""
        for step in range(10**9):
            now = time.monotonic()
            inputs: list[Input] = [Speed(now, 15.0, 0.28, "obd:7E8")]
            if step % 2:
                gap_m = 14.0 + (step % 16) / 10
                inputs.append(replace(AHEAD, stamp_s=now, gap_m=gap_m))
            for event in self._stack.step(inputs, now).events:
                self.page.receive_event(event)
            self.page.show(now)
            await asyncio.sleep(0.05)

    def raise_alarm(self, level: Level) -> None:
        """Raise an alarm as the daemon does: event and view in the same step."""
        now = time.monotonic()
        event: Event = Alarm(now, EEBL, level, 6.0, ())
        self.page.receive_event(event)
        self.page.show(now)


async def _open(browser: Browser) -> Page:
    context = await browser.new_context(viewport={"width": 390, "height": 844})
    page = await context.new_page()
    await page.goto(f"http://127.0.0.1:{PORT}/")
    await page.locator("#stale").wait_for(state="hidden")
    return page


async def _alarm_delays_s(car: _Car, page: Page) -> AsyncIterator[float]:
    for number in range(ALARMS):
        await asyncio.sleep(0.23 + number % 7 / 50)
        raised_at = time.time()
        car.raise_alarm(Level.WARNING)
        yield await _shown_at(page, "warning") - raised_at
        car.raise_alarm(Level.NONE)
        await _shown_at(page, "none")


async def _shown_at(page: Page, level: str) -> float:
    while True:
        for displayed, at_s in await page.evaluate("shownAt"):
            if displayed == level:
                await page.evaluate("shownAt.length = 0")
                return float(at_s)
        await asyncio.sleep(0.02)


async def _loop_delays_s() -> list[float]:
    """Delays of this loop's timers."""
    loop = asyncio.get_running_loop()
    delays_s = []
    until = loop.time() + PROBE_FOR_S
    while loop.time() < until:
        due_at = loop.time() + PROBE_S
        await asyncio.sleep(PROBE_S)
        delays_s.append(max(loop.time() - due_at, 0.0))
    return delays_s


def _percentiles(values_s: list[float]) -> dict[str, float]:
    cuts = quantiles(values_s, n=100, method="inclusive")
    return {"p50": cuts[49], "p99": cuts[98]}
