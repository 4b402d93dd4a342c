"""The page of a run: whole in one file, and it plays in a browser."""

import json
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Page, sync_playwright

from onboard.errors import UserError
from sim_rig.campaign import Workers, run_campaign
from sim_rig.studies.mvs_collisions import CollisionSettings, run_one
from sim_rig.studies.mvs_encounter import EncounterSettings, Method
from sim_rig.studies.mvs_scenes import Scene
from sim_rig.studies.show import show_run

SETTINGS = CollisionSettings(
    runs=1,
    shares=(0.3,),
    methods=(Method.OWN,),
    compared_at=None,
    encounter=EncounterSettings(
        scene=Scene.OWN_CROSSING, warm_s=0.5, watched_s=1.0, after_s=4.0, near_m=40.0
    ),
)


@pytest.fixture(scope="module")
def page_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("study")
    (row,) = run_campaign(run_one, SETTINGS, [1], folder / "runs", Workers())
    told = show_run(folder, 1, folder / "run.html")
    assert ("crash at" in told) == row["crash"]
    return folder / "run.html"


@pytest.fixture
def page(page_file: Path) -> Iterator[Page]:
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path="/usr/bin/chromium", args=["--no-sandbox", "--disable-gpu"]
        )
        page = browser.new_page()
        wrong: list[str] = []
        page.on("pageerror", lambda error: wrong.append(str(error)))
        page.on("request", lambda request: wrong.append(request.url))
        page.goto(page_file.as_uri())
        yield page
        assert wrong == [page_file.as_uri()]
        browser.close()


def test_the_page_steps_through_the_run_and_fetches_nothing(page: Page) -> None:
    page.select_option("#who", "everybody")
    first = page.inner_text("#told")
    page.click("#step")

    assert page.inner_text("#told") != first
    page.click("#back")
    assert page.inner_text("#told") == first
    page.click("#play")
    assert page.inner_text("#play") == "Pause"


def test_a_click_on_a_car_shows_whom_it_knows_and_a_drag_moves_the_road(page: Page) -> None:
    name, (x, y) = page.evaluate(
        "() => { const n = names.find(n => place(n, film.frames[at]));"
        " middle = film.frames[at].cars[n].slice(0, 2); draw();"
        " return [n, place(n, film.frames[at])]; }"
    )
    box = page.locator("#view").bounding_box()
    assert box is not None
    page.mouse.click(box["x"] + x, box["y"] + y)
    assert page.input_value("#who") == name

    before = page.evaluate("middle[0]")
    page.mouse.move(box["x"] + 100, box["y"] + 100)
    page.mouse.down()
    page.mouse.move(box["x"] + 150, box["y"] + 100)
    page.mouse.up()
    assert page.evaluate("middle[0]") == pytest.approx(before - 50 / 5)


def test_the_page_holds_what_was_known_and_sent(page_file: Path) -> None:
    text = page_file.read_text("utf-8")
    film = json.loads(text.split("const film = ")[1].split(";\n")[0])

    radios = [frame for frame in film["frames"] if "known" in frame]
    assert len(radios) == 15
    assert all(len(frame["sent"]) <= len(frame["radio"]) for frame in radios)
    known = [(name, *pair) for name, cars in radios[-1]["known"].items() for pair in cars]
    assert {"seen", "radio"} == {how for _, _, how in known}
    with_radio = set(radios[-1]["radio"])
    assert all(other in with_radio for _, other, how in known if how == "radio")
    assert film["event_car"] in film["frames"][0]["cars"]


def test_a_folder_without_a_study_is_the_users_mistake(tmp_path: Path) -> None:
    with pytest.raises(UserError, match=r"campaign\.yaml: cannot be read"):
        show_run(tmp_path, 1, tmp_path / "run.html")


@pytest.mark.parametrize(
    ("claim", "said"),
    [
        ("", "what is no campaign"),
        ("[1]", "what is no campaign"),
        ("a: [", "not YAML"),
        ("run: sim_rig.studies.radio.run_one", "runs of sim_rig.studies.radio.run_one cannot"),
        ("run: sim_rig.studies.mvs_collisions.run_one", "should be an object"),
    ],
)
def test_what_is_no_campaign_to_show_is_told(tmp_path: Path, claim: str, said: str) -> None:
    (tmp_path / "runs").mkdir()
    (tmp_path / "runs" / "campaign.yaml").write_text(claim)
    with pytest.raises(UserError, match=said):
        show_run(tmp_path, 1, tmp_path / "run.html")


def test_a_run_that_was_not_done_is_told(page_file: Path) -> None:
    with pytest.raises(UserError, match="no run 7 was done: it holds 1, the last is 1"):
        show_run(page_file.parent, 7, page_file.with_name("other.html"))
