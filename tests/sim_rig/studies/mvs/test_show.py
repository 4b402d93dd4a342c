"""The page of a run: its data, and the summary of the run."""

import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from onboard.errors import UserError
from sim_rig.roads.driver import ReactionSettings
from sim_rig.roads.events import TrafficEventKind
from sim_rig.studies.campaigns.campaign import Workers
from sim_rig.studies.mvs.collisions import CollisionSettings
from sim_rig.studies.mvs.encounter import EncounterSettings, Method
from sim_rig.studies.mvs.mvs_figure9_study import STUDY
from sim_rig.studies.mvs.scenes import SceneName
from sim_rig.studies.mvs.show import show_run

pytestmark = pytest.mark.long

SETTINGS = CollisionSettings(
    seed=4,
    runs=1,
    kinds=(TrafficEventKind.RED_LIGHT,),
    shares=(0.3,),
    methods=(Method.OWN,),
    compared_at=None,
    encounter=EncounterSettings(
        scenes=(SceneName.OWN_CROSSING,),
        warm_s=0.5,
        watched_s=1.6,
        after_s=4.0,
        near_m=20.0,
        reactions=ReactionSettings(warned_median_s=5.0),
    ),
)
"""Warned drivers react too late, so that the crash happens."""
WITHOUT, WITH = 0, 4
"""The runs: in both a red-light runner is run into; in the second both cars have a radio."""

Animation = dict[str, Any]


def animation_of(page: Path) -> Animation:
    animation: Animation = json.loads(
        page.read_text("utf-8").split("const animation = ")[1].split(";\n")[0]
    )
    return animation


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("study")
    STUDY.rows(SETTINGS, folder, Workers(), [WITHOUT, WITH])
    return folder


Pages = dict[int, tuple[str, Animation]]
"""By run: its summary and its animation."""


@pytest.fixture(scope="module")
def shown(study: Path) -> Pages:
    page = study / "run.html"
    return {
        number: (show_run(study, number, page), animation_of(page)) for number in (WITHOUT, WITH)
    }


@pytest.fixture(scope="module")
def animation(shown: Pages) -> Animation:
    return shown[WITH][1]


def test_the_animation_contains_perceived_objects_and_messages(animation: Animation) -> None:
    radios = [frame for frame in animation["frames"] if frame["equipped"] is not None]
    assert len(radios) == pytest.approx(21, abs=1)
    assert all(len(frame["sent"]) <= len(frame["equipped"]) for frame in radios)
    perceived = [(name, *pair) for name, cars in radios[-1]["perceived"].items() for pair in cars]
    # What the own sensors do not see any more counts as shared.
    assert {"sensor", "bsm"} <= {source for _, _, source in perceived}
    with_radio = set(radios[-1]["equipped"])
    assert all(other in with_radio for _, other, source in perceived if source == "bsm")


@pytest.mark.parametrize("number", [WITHOUT, WITH])
def test_cars_move_in_every_frame_until_they_crash(shown: Pages, number: int) -> None:
    """Also while no radios are simulated: in a run without them, and after `watched_s`."""
    _, animation = shown[number]
    frames, crash = animation["frames"], animation["crash"]
    assert np.allclose(np.diff([frame["at"] for frame in frames]), 0.1)
    assert crash["at_s"] <= frames[-1]["at"] < crash["at_s"] + 0.1
    other = next(name for name in crash["names"] if name != animation["event_car"])
    places = [tuple(frame["cars"][other][:2]) for frame in frames]
    assert len(set(places)) == len(places)


def test_the_animation_contains_the_motion_of_the_two_cars_without_radios(shown: Pages) -> None:
    (_, without), (_, animation) = shown[WITHOUT], shown[WITH]
    assert animation["crash_without_radios"] == without["crash"]
    last = without["frames"][-1]
    assert animation["frames_without_radios"][-1]["cars"] == {
        name: last["cars"][name] for name in without["crash"]["names"]
    }
    assert without["frames_without_radios"] == []


def test_a_warning_keeps_its_target_while_the_target_moves(animation: Animation) -> None:
    names = animation["crash"]["names"]
    warned = [(w, frame["cars"]) for frame in animation["frames"] for w in frame["warned"]]

    assert sum(name in names and right for (name, _, right, *_), _ in warned) > 5
    for (_, _, _, of, place_m), cars in warned:
        assert np.hypot(*np.subtract(place_m, cars[of][:2])) < 3.0


def test_every_car_has_a_path_that_it_follows(animation: Animation) -> None:
    names = list(animation["sizes"])
    for name, car in animation["frames"][0]["cars"].items():
        path_m = np.array(animation["paths"][names.index(name)])
        assert np.hypot(*(path_m - car[:2]).T).min() < 6.0


def test_the_summary_states_the_outcome_with_and_without_radios(shown: Pages) -> None:
    (without, _), (with_radios, _) = shown[WITHOUT], shown[WITH]
    assert without.startswith("Run 0: red-light runner, no radios\n")
    assert with_radios.startswith(
        "Run 4: red-light runner, 30 % radios (both of the two cars), own sensing\n"
    )
    crash = "car219 and car221 crash 2.4 s later at 11.6 m/s."
    assert without.endswith(f"car219 sets off at a red light. Without radios {crash}")
    assert (
        f"car219 sets off at a red light. Without radios {crash} With them it happens"
        in with_radios
    )
    lead = "A car that could act perceived the other 2.8 s before that crash, and was warned"
    assert lead in with_radios


def copied(study: Path, to: Path) -> Path:
    """A copy of the study's folder, to be damaged."""
    return Path(shutil.copytree(study, to / "study"))


def test_a_run_whose_result_differs_from_the_study_is_reported(study: Path, tmp_path: Path) -> None:
    folder = copied(study, tmp_path)
    stored = folder / "runs" / "runs.jsonl"
    stored.write_text(stored.read_text().replace('"crash": true', '"crash": false'))

    assert "THE STUDY'S RESULT DIFFERS" in show_run(folder, WITHOUT, tmp_path / "run.html")


def test_runs_that_cannot_be_read_are_an_error(study: Path, tmp_path: Path) -> None:
    folder = copied(study, tmp_path)
    (folder / "runs" / "runs.jsonl").unlink()
    with pytest.raises(UserError, match=r"runs\.jsonl: cannot be read: No such file"):
        show_run(folder, WITHOUT, tmp_path / "run.html")


def test_the_page_is_not_written_to_a_folder(study: Path, tmp_path: Path) -> None:
    with pytest.raises(UserError, match="is a folder; name the file to write"):
        show_run(study, WITHOUT, tmp_path)


def test_a_folder_without_a_study_is_a_user_error(tmp_path: Path) -> None:
    with pytest.raises(UserError, match=r"campaign\.yaml: cannot be read"):
        show_run(tmp_path, 1, tmp_path / "run.html")


@pytest.mark.parametrize(
    ("claim", "message"),
    [
        ("", "something else"),
        ("[1]", "something else"),
        ("a: [", "not YAML"),
        (
            "run: radio",
            "runs of radio cannot",
        ),
        ("run: mvs-figure9", "needs a line `key: value`"),
    ],
)
def test_a_folder_that_holds_no_collision_campaign_is_an_error(
    tmp_path: Path, claim: str, message: str
) -> None:
    (tmp_path / "runs").mkdir()
    (tmp_path / "runs" / "campaign.yaml").write_text(claim)
    with pytest.raises(UserError, match=message):
        show_run(tmp_path, 1, tmp_path / "run.html")


def test_a_run_that_was_not_done_is_an_error(study: Path) -> None:
    with pytest.raises(UserError, match="run 7 was not done: it holds 2, the last is 4"):
        show_run(study, 7, study / "other.html")
