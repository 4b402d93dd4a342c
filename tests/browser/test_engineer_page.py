"""The engineer's page in a real browser, over a run in virtual time."""

import asyncio
import re
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from playwright.sync_api import Browser, Page, Route, ViewportSize, expect

from sim_rig.engineer import server
from sim_rig.engineer.run_view import RunView
from sim_rig.engineer.server import EngineerServer
from sim_rig.run_log.run_log import Record
from sim_rig.runs.virtual import run_virtual
from sim_rig.scenario.schema import Scenario, load_scenario
from tests.browser.accessibility import violations

pytestmark = pytest.mark.browser

LAPTOP: ViewportSize = {"width": 1440, "height": 900}
TABLET = {"width": 820, "height": 1180}
PLATE = "<b>GN</b>"


class Shown:
    """The page of a run in virtual time that has just ended, served in a thread of its own."""

    def __init__(self, scenario: Scenario, folder: Path) -> None:
        log = run_virtual(scenario)
        self.offset_s = time.monotonic() - scenario.duration_s - 1.0
        self.server = EngineerServer(scenario, folder, camera_port=1)
        self.server.run_view = RunView(log.names)
        self.server.run_view.receive_rig({"kind": "start", "stamp_s": self.offset_s})
        for car, trace in log.traces.items():
            for record in trace:
                self.add(car, record)
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever)

    def add(self, car: str, record: Record) -> None:
        shifted = {"stamp_s": record["stamp_s"] + self.offset_s}
        self.server.run_view.receive_record(car, dict(record) | shifted)

    def __enter__(self) -> str:
        self._thread.start()
        start = asyncio.run_coroutine_threadsafe(self.server.start(), self._loop)
        return f"http://127.0.0.1:{start.result(20.0)}/"

    def __exit__(self, *_: object) -> None:
        asyncio.run_coroutine_threadsafe(self.server.close(), self._loop).result(20.0)
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join()
        self._loop.close()


@pytest.fixture(scope="module")
def address(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """The first 12 s of `fig4`, in many parts, with one image each second and lost sensors."""
    scenario = load_scenario("fig4").model_copy(update={"duration_s": 12.0})
    run = Shown(scenario, tmp_path_factory.mktemp("run"))
    lost = {"kind": "sensor_lost", "sensor": "camera"}
    run.add("yellow", lost | {"stamp_s": 11.0, "reason": PLATE})
    run.add("green", lost | {"stamp_s": 10.9, "reason": "silent"})
    run.add("green", {"kind": "sensor_recovered", "sensor": "camera", "stamp_s": 10.2})
    for second in range(13):
        grey = np.full((360, 640, 3), 10 * second, np.uint8)
        _, jpeg = cv2.imencode(".jpg", grey)
        run.server.images.add("red", run.offset_s + second, jpeg.tobytes())
    with run as address, pytest.MonkeyPatch.context() as patch:
        patch.setattr(server, "MAX_ENTRIES", 500)
        yield address


@pytest.fixture
def page(browser: Browser, address: str) -> Iterator[Page]:
    context = browser.new_context(viewport=LAPTOP)
    context.set_default_timeout(10_000)
    page = context.new_page()
    page.on("pageerror", lambda error: pytest.fail(f"error in the page: {error}"))
    page.goto(address)
    expect(page.locator("#clock")).to_contain_text(" s")
    yield page
    context.close()


def card(page: Page, car: str, part: str) -> str:
    return page.locator(f'[data-car="{car}"].card {part}').inner_text()


def select(page: Page, part: float) -> None:
    """Select a time on the timeline, as a part of the run's duration."""
    timeline = page.locator("#timeline")
    width_px = timeline.evaluate("(element) => element.clientWidth")
    timeline.click(position={"x": 76 + part * (width_px - 88), "y": 9})


def test_a_jump_to_a_warning_shows_all_cars_at_that_time(page: Page) -> None:
    page.click("#earlier-warning")  # of the vehicle ahead, by red's camera
    page.click("#earlier-warning")  # of the group

    expect(page.locator("#pause")).to_have_text("Resume")
    expect(page.locator('[data-car="blue"].card .notes')).to_have_text("lcca")
    assert 10.0 < float(page.locator("#clock").inner_text().removesuffix(" s")) < 11.0
    assert card(page, "green", ".state") == "LEADER"
    assert card(page, "red", ".state") == "MEMBER 2 behind green"
    assert card(page, "blue", ".state") == "MEMBER 3 behind green"
    assert card(page, "yellow", ".state") == "REGULAR"
    assert re.search(r"asked: \d+ texts?, answered by RD288HX", card(page, "blue", ".numbers"))
    expect(page.locator("#events li.warning").first).to_contain_text("origin_id green")
    expect(page.locator("#events li.discarded").first).to_contain_text("warn from green")
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


def test_the_image_is_that_of_the_shown_time(page: Page) -> None:
    for second in (4, 9):
        select(page, (second + 0.5) / 12)
        grey = -1
        for _ in range(500):
            grey = page.evaluate(
                """() => document.querySelector('[data-car="red"] canvas').getContext("2d")
                    .getImageData(320, 180, 1, 1).data[0]"""
            )
            if abs(grey - 10 * second) <= 2:
                break
            page.wait_for_timeout(20)
        assert grey == pytest.approx(10 * second, abs=2)


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_the_page_breaks_no_rule_of_accessibility(page: Page, scheme: Any) -> None:
    page.emulate_media(color_scheme=scheme)
    page.click("#earlier-warning")
    expect(page.locator("#discarded")).to_contain_text("lcca: not_in_group")

    assert violations(page) == []


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


@pytest.mark.parametrize("way", ["button", "key"])
def test_no_time_is_selected_before_the_run_is_known(
    browser: Browser, address: str, way: str
) -> None:
    page, held = browser.new_page(), list[Route]()
    page.route("**/entries?*", lambda route: held.append(route))  # noqa: PLW0108 (is marked)
    page.goto(address)
    expect(page.locator(".card")).to_have_count(4)

    if way == "button":
        box = page.locator("#pause").bounding_box()
        assert box is not None
        page.mouse.click(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    else:
        page.keyboard.press(" ")
    for route in held:
        route.continue_()

    expect(page.locator("#clock")).to_contain_text(" s")
    expect(page.locator("#pause")).to_have_text("Pause")
    page.close()


def test_text_of_traces_is_not_parsed_as_html(page: Page) -> None:
    page.click("#pause")
    expect(page.locator('[data-car="yellow"].card .lost')).to_have_text(f"camera lost: {PLATE}")

    assert page.locator(".card b").count() == 0


def test_a_sensor_that_recovers_with_an_older_sample_is_recovered(page: Page) -> None:
    page.click("#pause")
    expect(page.locator('[data-car="yellow"].card .lost')).to_have_count(1)

    expect(page.locator('[data-car="green"].card .lost')).to_have_count(0)


@pytest.mark.parametrize("size", [LAPTOP, TABLET])
def test_the_page_fits_the_width(page: Page, size: dict[str, int]) -> None:
    page.set_viewport_size(size)  # type: ignore[arg-type]

    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")


def test_a_laptop_shows_everything_without_scrolling(page: Page) -> None:
    assert page.evaluate("document.documentElement.scrollHeight <= innerHeight")


def test_four_cars_are_side_by_side(page: Page) -> None:
    expect(page.locator(".card")).to_have_count(4)
    tops = {box["y"] for each in page.locator(".card").all() if (box := each.bounding_box())}

    assert len(tops) == 1


def test_a_fused_state_is_shown_with_each_measurement_once(
    browser: Browser, tmp_path: Path
) -> None:
    """A car without radio, detected by one car and shared with another."""
    with Shown(load_scenario("shared-detection"), tmp_path) as address:
        page = browser.new_page(viewport={"width": 1440, "height": 900})
        page.goto(address)
        select(page, 0.7)

        shared = page.locator("#fused tbody tr", has_text="shared").first
        expect(shared).to_be_visible()
        measured = shared.locator("td").last.inner_text()
        page.close()

    by_observer = [each.split(": ") for each in measured.split("; ")]
    assert all(len(observer) == 8 for observer, _ in by_observer)
    for _, stamps in by_observer:
        assert len(stamps.split()) == len(set(stamps.split()))
