"""The page of a run: what it is given, and what is told of the run."""

import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from onboard.errors import UserError
from sim_rig.roads.events import TrafficEventKind
from sim_rig.studies.campaign import Workers, run_campaign
from sim_rig.studies.mvs_collisions import CollisionSettings, run_one
from sim_rig.studies.mvs_encounter import EncounterSettings, Method
from sim_rig.studies.mvs_scenes import SceneName
from sim_rig.studies.show import show_run

SETTINGS = CollisionSettings(
    seed=3,
    runs=1,
    kinds=(TrafficEventKind.RED_LIGHT,),
    shares=(0.3,),
    methods=(Method.OWN,),
    compared_at=None,
    encounter=EncounterSettings(
        scene=SceneName.OWN_CROSSING, warm_s=0.5, watched_s=1.6, after_s=4.0, near_m=40.0
    ),
)
WITHOUT, WITH = 0, 1
"""The runs: in both a red-light runner is run into."""

Film = dict[str, Any]


def film_of(page: Path) -> Film:
    film: Film = json.loads(page.read_text("utf-8").split("const film = ")[1].split(";\n")[0])
    return film


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("study")
    run_campaign(run_one, SETTINGS, [WITHOUT, WITH], folder / "runs", Workers())
    return folder


Shown = dict[int, tuple[str, Film]]
"""By run: what is told of it, and its film."""


@pytest.fixture(scope="module")
def shown(study: Path) -> Shown:
    page = study / "run.html"
    return {number: (show_run(study, number, page), film_of(page)) for number in (WITHOUT, WITH)}


@pytest.fixture(scope="module")
def film(shown: Shown) -> Film:
    return shown[WITH][1]


def test_the_film_holds_what_was_known_and_sent(film: Film) -> None:
    radios = [frame for frame in film["frames"] if frame["radio"] is not None]
    assert len(radios) == pytest.approx(21, abs=1)
    assert all(len(frame["sent"]) <= len(frame["radio"]) for frame in radios)
    known = [(name, *pair) for name, cars in radios[-1]["known"].items() for pair in cars]
    assert {"sensor", "bsm"} == {how for _, _, how in known}
    with_radio = set(radios[-1]["radio"])
    assert all(other in with_radio for _, other, how in known if how == "bsm")


@pytest.mark.parametrize("number", [WITHOUT, WITH])
def test_cars_drive_in_every_picture_until_they_crash(shown: Shown, number: int) -> None:
    """Also while no radios are simulated: in a run without, and after the watched time."""
    _, film = shown[number]
    frames, crash = film["frames"], film["crash"]
    assert np.allclose(np.diff([frame["at"] for frame in frames]), 0.1)
    assert crash["at_s"] <= frames[-1]["at"] < crash["at_s"] + 0.1
    other = next(name for name in crash["names"] if name != film["event_car"])
    places = [tuple(frame["cars"][other][:2]) for frame in frames]
    assert len(set(places)) == len(places)


def test_the_film_shows_how_the_two_drive_without_radios(shown: Shown) -> None:
    (_, without), (_, film) = shown[WITHOUT], shown[WITH]
    assert film["crash_without_radios"] == without["crash"]
    last = without["frames"][-1]
    assert film["ghosts"][-1]["cars"] == {
        name: last["cars"][name] for name in without["crash"]["names"]
    }
    assert without["ghosts"] == []


def test_who_is_being_warned_is_warned_of_the_same_car_as_it_moves_on(film: Film) -> None:
    one, other = film["crash"]["names"]
    told = [w for frame in film["frames"] for w in frame["warned"] if w[0] == one]

    assert len(told) > 5
    assert {(right, of) for _, _, right, of, _ in told} == {(True, other)}
    assert len({tuple(place_m) for *_, place_m in told}) > 5


def test_every_car_has_a_way_that_it_drives_along(film: Film) -> None:
    names = list(film["sizes"])
    for name, car in film["frames"][0]["cars"].items():
        way_m = np.array(film["ways"][names.index(name)])
        assert np.hypot(*(way_m - car[:2]).T).min() < 6.0


def test_it_is_told_what_happened_with_radios_and_without(shown: Shown) -> None:
    (without, _), (told, _) = shown[WITHOUT], shown[WITH]
    assert without.startswith("Run 0: red-light runner, no radios\n")
    assert told.startswith("Run 1: red-light runner, 30 % radios, own sensing\n")
    crash = "car594 and car654 crash 1.9 s later at 11.0 m/s."
    assert without.endswith(f"car654 sets off at a red light. Without radios {crash}")
    assert f"car654 sets off at a red light. Without radios {crash} With them it happens" in told
    assert "Who could act knew of the other 2.3 s before that crash, and was warned" in told


def copied(study: Path, to: Path) -> Path:
    """The study in a folder of its own, to be spoilt."""
    return Path(shutil.copytree(study, to / "study"))


def test_a_run_that_no_longer_ends_as_it_did_is_told(study: Path, tmp_path: Path) -> None:
    folder = copied(study, tmp_path)
    kept = folder / "runs" / "runs.jsonl"
    kept.write_text(kept.read_text().replace('"crash": true', '"crash": false'))

    assert "HAS KEPT IT OTHERWISE" in show_run(folder, WITHOUT, tmp_path / "run.html")


def test_runs_that_cannot_be_read_are_told(study: Path, tmp_path: Path) -> None:
    folder = copied(study, tmp_path)
    (folder / "runs" / "runs.jsonl").unlink()
    with pytest.raises(UserError, match=r"runs\.jsonl: cannot be read: No such file"):
        show_run(folder, WITHOUT, tmp_path / "run.html")


def test_a_page_does_not_take_the_place_of_a_folder(study: Path, tmp_path: Path) -> None:
    with pytest.raises(UserError, match="is a folder; name the file to write"):
        show_run(study, WITHOUT, tmp_path)


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


def test_a_run_that_was_not_done_is_told(study: Path) -> None:
    with pytest.raises(UserError, match="no run 7 was done: it holds 2, the last is 1"):
        show_run(study, 7, study / "other.html")
