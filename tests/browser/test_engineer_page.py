"""The engineer's page in a real browser, over a run in virtual time."""

import asyncio
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
import pytest
from playwright.sync_api import Browser, Page, expect

from sim_rig.engineer.server import EngineerServer
from sim_rig.scenario import load_scenario
from sim_rig.virtual import run_virtual

pytestmark = pytest.mark.browser

LAPTOP = {"width": 1440, "height": 900}
TABLET = {"width": 820, "height": 1180}
PLATE = "<b>GN</b>"


@pytest.fixture(scope="module")
def address(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """A run of twelve seconds that has just ended."""
    scenario = load_scenario("fig4").model_copy(update={"duration_s": 12.0})
    log = run_virtual(scenario)
    offset_s = time.monotonic() - 13.0
    folder: Path = tmp_path_factory.mktemp("run")
    loop = asyncio.new_event_loop()
    thread = threading.Thread(target=loop.run_forever)
    thread.start()

    async def start() -> tuple[EngineerServer, int]:
        server = EngineerServer(scenario, folder, camera_port=1)
        server.story = type(server.story)(log.names)
        server.story.receive_rig({"kind": "start", "stamp_s": offset_s})
        records = [
            (car, dict(record) | {"stamp_s": record["stamp_s"] + offset_s})
            for car, trace in log.traces.items()
            for record in trace
        ]
        for car, record in records:
            server.story.receive(car, record)
        lost = {"kind": "sensor_lost", "stamp_s": offset_s + 11.0, "sensor": "camera"}
        server.story.receive("yellow", lost | {"silent_s": 0.8, "reason": PLATE})
        for kind, stamp_s in (("sensor_lost", 10.9), ("sensor_back", 10.2)):
            record = {"kind": kind, "stamp_s": offset_s + stamp_s, "sensor": "camera"}
            server.story.receive("green", record | {"reason": "silent"})
        for second in range(13):
            grey = np.full((360, 640, 3), 10 * second, np.uint8)
            _, jpeg = cv2.imencode(".jpg", grey)
            server.album.add("red", offset_s + second, jpeg.tobytes())
        return server, await server.start()

    server, port = asyncio.run_coroutine_threadsafe(start(), loop).result(20.0)
    yield f"http://127.0.0.1:{port}/"
    asyncio.run_coroutine_threadsafe(server.close(), loop).result(20.0)
    loop.call_soon_threadsafe(loop.stop)
    thread.join()
    loop.close()


@pytest.fixture
def page(browser: Browser, address: str) -> Iterator[Page]:
    context = browser.new_context(viewport=LAPTOP)
    context.set_default_timeout(10_000)
    page = context.new_page()
    page.on("pageerror", lambda error: pytest.fail(f"an error in the page: {error}"))
    page.goto(address)
    expect(page.locator("#clock")).not_to_have_text("getting ready")
    yield page
    context.close()


def card(page: Page, car: str, part: str) -> str:
    return page.locator(f'[data-car="{car}"].card {part}').inner_text()


def test_a_jump_to_a_warning_shows_all_cars_at_that_moment(page: Page) -> None:
    page.click("#earlier-warning")

    expect(page.locator("#pause")).to_have_text("Go on")
    expect(page.locator('[data-car="blue"].card .notes')).to_have_text("group")
    assert 10.0 < float(page.locator("#clock").inner_text().removesuffix(" s")) < 11.0
    assert card(page, "green", ".state") == "LEADER"
    assert card(page, "red", ".state") == "MEMBER 2 behind green"
    assert card(page, "blue", ".state") == "MEMBER 3 behind green"
    assert card(page, "yellow", ".state") == "REGULAR"
    expect(page.locator("#said li.warning").first).to_contain_text("origin_id green")
    expect(page.locator("#said li.discarded").first).to_contain_text("warn from green")
    expect(page.locator("#sequence g.warn").first).to_be_visible()
    expect(page.locator("#sequence")).to_contain_text("warned: green")


def test_steps_go_from_event_to_event_and_back(page: Page) -> None:
    page.click("#earlier-warning")
    there = page.locator("#clock").inner_text()

    page.keyboard.press("ArrowRight")
    later = page.locator("#clock").inner_text()
    page.keyboard.press("ArrowLeft")
    page.keyboard.press("ArrowLeft")
    earlier = page.locator("#clock").inner_text()

    assert float(earlier[:-2]) < float(there[:-2]) <= float(later[:-2])


def test_the_picture_is_that_of_the_moment(page: Page) -> None:
    box = page.locator("#timeline").bounding_box()
    assert box is not None

    for second in (4, 9):
        page.mouse.click(box["x"] + 76 + (second + 0.5) / 12 * (box["width"] - 88), box["y"] + 9)
        for _ in range(100):
            grey = page.evaluate(
                """() => document.querySelector('[data-car="red"] canvas').getContext("2d")
                    .getImageData(320, 180, 1, 1).data[0]"""
            )
            if abs(grey - 10 * second) <= 2:
                break
            page.wait_for_timeout(20)
        assert grey == pytest.approx(10 * second, abs=2)


def test_discards_are_counted_by_reason_and_car(page: Page) -> None:
    expect(page.locator("#discarded")).to_contain_text("lcca: not_in_group")
    heads = page.locator("#discarded th").all_inner_texts()

    (row,) = [
        row
        for row in page.locator("#discarded tbody tr").all()
        if "not_in_group" in row.inner_text()
    ]
    counts = dict(zip(heads, row.locator("td").all_inner_texts(), strict=True))
    assert int(counts["yellow"]) > 0


def test_what_cars_say_is_words_and_nothing_else(page: Page) -> None:
    page.click("#pause")
    expect(page.locator('[data-car="yellow"].card .lost')).to_have_text(f"camera lost: {PLATE}")

    assert page.locator(".card b").count() == 0


def test_a_sensor_that_is_back_with_an_older_sample_is_back(page: Page) -> None:
    page.click("#pause")
    expect(page.locator('[data-car="yellow"].card .lost')).to_have_count(1)

    expect(page.locator('[data-car="green"].card .lost')).to_have_count(0)


@pytest.mark.parametrize("size", [LAPTOP, TABLET])
def test_nothing_hangs_over_the_edge(page: Page, size: dict[str, int]) -> None:
    page.set_viewport_size(size)  # type: ignore[arg-type]

    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
