"""The page of a run of a collision study, in a real browser."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Page

from sim_rig.studies.campaign import Workers, run_campaign
from sim_rig.studies.mvs_collisions import run_one
from sim_rig.studies.show import show_run
from tests.sim_rig.test_show import SETTINGS, WITH

pytestmark = pytest.mark.browser


@pytest.fixture(scope="module")
def page_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("study")
    run_campaign(run_one, SETTINGS, [WITH], folder / "runs", Workers())
    show_run(folder, WITH, folder / "run.html")
    return folder / "run.html"


@pytest.fixture
def page(browser: Browser, page_file: Path) -> Iterator[Page]:
    page = browser.new_page()
    wrong: list[str] = []
    page.on("pageerror", lambda error: wrong.append(str(error)))
    page.on("request", lambda request: wrong.append(request.url))
    page.goto(page_file.as_uri())
    yield page
    assert wrong == [page_file.as_uri()]
    page.close()


def test_the_page_steps_through_the_run_and_fetches_nothing(page: Page) -> None:
    page.select_option("#who", "everybody")
    first = page.inner_text("#told")
    page.click("#step")

    assert page.inner_text("#told") != first
    page.click("#back")
    assert page.inner_text("#told") == first
    page.click("#play")
    assert page.inner_text("#play") == "Pause"


def test_playing_stops_at_the_crash_and_begins_anew(page: Page) -> None:
    page.evaluate("go(film.frames.length - 2)")
    page.click("#play")
    page.wait_for_function("!playing")
    assert page.evaluate("at") == page.evaluate("film.frames.length - 1")
    page.click("#play")
    assert page.evaluate("at") < page.evaluate("film.frames.length - 1")


def test_the_moments_are_listed_and_lead_to_their_pictures(page: Page) -> None:
    said = page.locator("#moments button").all_inner_texts()
    assert "0.0 s event: car654" in said
    assert any("warned" in each for each in said)
    assert said[-1].endswith("crash")

    page.click("#moments button:last-child")
    assert page.evaluate("film.frames[at].at >= film.crash.at_s")
    assert page.locator("#moments button.past").count() == len(said)
    page.locator("#moments button", has_text="event").click()
    assert page.inner_text("#told").startswith("0.0 s after the event")


def test_a_click_on_a_car_shows_whom_it_knows_and_a_drag_moves_the_road(page: Page) -> None:
    name = page.evaluate("film.crash.names[0]")
    x, y = page.evaluate("name => place(film.frames[at].cars[name])", name)
    box = page.locator("canvas").bounding_box()
    assert box is not None
    page.mouse.click(box["x"] + x, box["y"] + y)
    assert page.input_value("#who") == name
    assert f"{name}: " in page.inner_text("#told")

    before, zoom = page.evaluate("[middle[0], zoom]")
    page.mouse.move(box["x"] + 100, box["y"] + 100)
    page.mouse.down()
    page.mouse.move(box["x"] + 150, box["y"] + 100)
    page.mouse.up()
    assert page.evaluate("middle[0]") == pytest.approx(before - 50 / zoom)


def test_of_a_car_without_a_radio_it_is_said_who_knows_it(page: Page) -> None:
    page.evaluate("go(film.frames.findIndex(frame => frame.at >= film.event_s))")
    without = page.evaluate(
        "Object.values(film.frames[at].known).flat().find(([, how]) => how === 'seen')[0]"
    )
    page.select_option("#who", without)
    assert f"{without}: " in page.inner_text("#told")
    assert "no radio, known to" in page.inner_text("#told")


def test_the_wheel_zooms_where_it_points(page: Page) -> None:
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
