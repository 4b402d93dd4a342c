"""The page of a run of a collision study, in a real browser."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Browser, Page

from sim_rig.reporting.scenario_from_above import show_scenario
from sim_rig.runs.virtual import run_virtual
from sim_rig.scenario.schema import load_scenario
from sim_rig.studies.campaigns.campaign import Workers
from sim_rig.studies.mvs.mvs_figure9_study import STUDY
from sim_rig.studies.mvs.show import show_run
from tests.browser.accessibility import violations
from tests.sim_rig.studies.mvs.test_show import SETTINGS, WITH

pytestmark = pytest.mark.browser


@pytest.fixture(scope="module")
def page_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("study")
    STUDY.rows(SETTINGS, folder, Workers(), [WITH])
    show_run(folder, WITH, folder / "run.html")
    return folder / "run.html"


@pytest.fixture
def page(browser: Browser, page_file: Path) -> Iterator[Page]:
    page = browser.new_page(reduced_motion="reduce")
    unexpected: list[str] = []
    page.on("pageerror", lambda error: unexpected.append(str(error)))
    page.on("request", lambda request: unexpected.append(request.url))
    page.goto(page_file.as_uri())
    yield page
    assert unexpected == [page_file.as_uri()]
    page.close()


def test_the_page_steps_through_the_run_without_network_access(page: Page) -> None:
    page.select_option("#selected", "all")
    first = page.inner_text("#status")
    page.click("#step")

    assert page.inner_text("#status") != first
    page.click("#back")
    assert page.inner_text("#status") == first
    page.click("#play")
    assert page.inner_text("#play") == "Pause"


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_the_page_breaks_no_rule_of_accessibility(page: Page, scheme: Any) -> None:
    page.emulate_media(color_scheme=scheme)
    page.evaluate("go(animation.frames.length - 1)")

    assert violations(page) == []


def test_playing_stops_at_the_crash_and_restarts(page: Page) -> None:
    page.evaluate("go(animation.frames.length - 2)")
    page.click("#play")
    page.wait_for_function("!playing")
    assert page.evaluate("at") == page.evaluate("animation.frames.length - 1")
    page.click("#play")
    assert page.evaluate("at") < page.evaluate("animation.frames.length - 1")


def test_events_are_listed_and_lead_to_their_frames(page: Page) -> None:
    events = page.locator("#events button").all_inner_texts()
    # The vehicle that runs the red light is one of the two that crash.
    names = page.evaluate("animation.crash.names")
    assert sum(f"0.0 s event: {name}" in events for name in names) == 1
    assert any("warned" in each for each in events)
    assert [each.split(maxsplit=2)[2] for each in events[-2:]] == ["crash without radios", "crash"]

    page.click("#events button:last-child")
    assert page.evaluate("animation.frames[at].at >= animation.crash.at_s")
    assert page.locator("#events button.past").count() == len(events)
    page.locator("#events button", has_text="event").click()
    assert page.inner_text("#status").startswith("0.0 s after the event")


def test_a_click_on_a_car_shows_its_perceived_objects_and_a_drag_moves_the_map(page: Page) -> None:
    name = page.evaluate("animation.crash.names[0]")
    x, y = page.evaluate("name => place(animation.frames[at].cars[name])", name)
    box = page.locator("canvas").bounding_box()
    assert box is not None
    page.mouse.click(box["x"] + x, box["y"] + y)
    assert page.input_value("#selected") == name
    assert f"{name}: " in page.inner_text("#status")

    before, zoom = page.evaluate("[middle[0], zoom]")
    page.mouse.move(box["x"] + 100, box["y"] + 100)
    page.mouse.down()
    page.mouse.move(box["x"] + 150, box["y"] + 100)
    page.mouse.up()
    assert page.evaluate("middle[0]") == pytest.approx(before - 50 / zoom)


def test_the_status_of_a_car_without_a_radio_counts_the_cars_that_perceive_it(page: Page) -> None:
    page.evaluate("go(animation.frames.findIndex(frame => frame.at >= animation.event_s))")
    without = page.evaluate(
        "Object.values(animation.frames[at].perceived).flat()"
        ".find(([, source]) => source === 'sensor')[0]"
    )
    page.select_option("#selected", without)
    assert f"{without}: " in page.inner_text("#status")
    assert "no radio, perceived by" in page.inner_text("#status")


def test_the_wheel_zooms_at_the_pointer(page: Page) -> None:
    box = page.locator("canvas").bounding_box()
    assert box is not None
    where = (
        "([x, y]) => [middle[0] + (x - view.clientWidth / 2) / zoom,"
        " middle[1] - (y - view.clientHeight / 2) / zoom]"
    )
    before = page.evaluate(where, [200, 100])
    zoom = page.evaluate("zoom")
    page.mouse.move(box["x"] + 200, box["y"] + 100)
    page.mouse.wheel(0, -100)
    page.wait_for_function("before => zoom > before", arg=zoom)
    assert page.evaluate(where, [200, 100]) == pytest.approx(before)


def test_a_scenarios_page_follows_its_cars_until_the_map_is_moved(
    browser: Browser, tmp_path: Path
) -> None:
    log = run_virtual(load_scenario("shared-detection"))
    warned_s = next(each["stamp_s"] for each in log.traces["v1"] if each["kind"] == "alarm")
    log.write(tmp_path / "run")
    show_scenario(tmp_path / "run", tmp_path / "run.html")
    page = browser.new_page(reduced_motion="reduce")
    errors: list[str] = []
    page.on("pageerror", lambda error: errors.append(str(error)))
    page.goto((tmp_path / "run.html").as_uri())
    began = page.evaluate("middle")
    page.evaluate("go(50)")
    moved = page.evaluate("middle")
    assert moved != began
    assert page.locator("#events button").all_inner_texts() == [f"{warned_s:.1f} s v1 warned"]
    page.mouse.move(500, 400)
    page.mouse.down()
    page.mouse.move(520, 400)
    page.mouse.up()
    held = page.evaluate("middle")
    page.evaluate("go(80)")
    assert page.evaluate("middle") == held
    assert page.inner_text("#status").startswith("8.0 s; ")
    assert errors == []
    page.close()


def test_a_run_plays_by_itself_unless_the_reader_wants_less_motion(
    browser: Browser, page: Page, page_file: Path
) -> None:
    assert page.inner_text("#play") == "Play"
    lively = browser.new_page()
    lively.goto(page_file.as_uri())
    assert lively.inner_text("#play") == "Pause"
    lively.wait_for_function("at > 0")
    lively.close()


def test_on_a_telephone_the_cars_have_most_of_the_screen(browser: Browser, page_file: Path) -> None:
    page = browser.new_page(viewport={"width": 360, "height": 640}, reduced_motion="reduce")
    page.goto(page_file.as_uri())
    box = page.locator("canvas").bounding_box()
    assert box is not None
    assert box["height"] >= 0.5 * 640
    assert box["y"] + 0.5 * box["height"] <= 640
    page.close()
