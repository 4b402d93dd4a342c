"""Invalid settings of studies are errors before anything runs."""

from collections.abc import Iterator
from pathlib import Path
from typing import get_args

import pytest
from pydantic import BaseModel

from onboard.errors import UserError
from onboard.settings import parse_settings, parse_yaml
from sim_rig.studies.campaigns.campaign import Workers
from sim_rig.studies.campaigns.catalogue import (
    run_study,
    settings_schema,
    study_names,
    study_settings,
)
from sim_rig.studies.campaigns.lists_of_one import with_lists_of_one
from sim_rig.studies.campaigns.settings_help import meanings
from sim_rig.studies.faults.faults_study import FaultsSettings
from sim_rig.studies.mvs.collisions import CollisionSettings, encounter_cases
from sim_rig.studies.mvs.encounter import Method
from sim_rig.studies.mvs.scenes import SceneName


@pytest.mark.parametrize(
    ("study", "given", "message"),
    [
        ("lcca-chain", {"shares": []}, "shares: must have at least one value"),
        ("lcca-chain", {"shares": [0.5, 0.5]}, "shares: must not repeat a value"),
        ("lcca-chain", {"shares": [1.5]}, "shares.0: Input should be less than or equal to 1"),
        ("lcca-chain", {"cars": [0]}, "cars.0: Input should be greater than or equal to 2"),
        ("lcca-chain", {"speed_m_s": [32, 22]}, "speed_m_s: must be in ascending order"),
        ("lcca-chain", {"deceleration_m_s2": [0, 0]}, "deceleration_m_s2.0: Input should be gre"),
        ("lcca-chain", {"reaction_medians_s": [-1]}, "reaction_medians_s.0: Input should be"),
        ("mvs-figure9", {"kinds": []}, "kinds: must have at least one value"),
        ("mvs-figure9", {"shares": [-0.1]}, "shares.0: Input should be greater than or equal to 0"),
        ("mvs-figure9", {"entries": [65]}, "entries.0: Input should be less than or equal to 64"),
        ("mvs-figure3", {"shares": [1.1]}, "shares.0: Input should be less than or equal to 1"),
        (
            "mvs-figure9",
            {"encounter": {"reactions": {"braking_m_s2": [8, 4]}}},
            "encounter.reactions.braking_m_s2: must be in ascending order",
        ),
        (
            "mvs-figure9",
            {"encounter": {"world": "radar-9"}},
            "encounter.world: no such profile of sensors (given 'radar-9'): paper, all-round-60",
        ),
        ("mvs-ablation", {"profiles": ["radar-9"]}, "profiles.0: no such profile of sensors"),
        ("mvs-figure8", {"scene": 5}, "mvs-figure8: scene: is a text, write it in quotes"),
        ("mvs-figure8", {"shares": []}, "shares: must have at least one value"),
        ("mvs-figure8", {"entries": [-5]}, "entries.0: Input should be greater than or equal to 0"),
        ("mvs-figure8", {"begin_s": [240, 60]}, "begin_s: must be in ascending order"),
        ("rakhshan-csma", {"intervals_s": [0]}, "intervals_s.0: Input should be greater than 0"),
        ("faults", {"cases": ["unknown"]}, "cases.0: no fault 'unknown'; there are: "),
        ("faults", {"seeds": [-1]}, "seeds.0: Input should be greater than or equal to 0"),
    ],
)
def test_invalid_settings_are_an_error(
    tmp_path: Path, study: str, given: dict[str, object], message: str
) -> None:
    with pytest.raises(UserError) as error:
        run_study(study, tmp_path, None, Workers(), given)

    assert message in str(error.value)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("study", "given", "several"),
    [
        ("lcca-chain", {"cars": 10}, (10,)),
        ("lcca-chain", {"shares": 0.5}, (0.5,)),
        ("lcca-chain", {"sights": "rig"}, ("rig",)),
        ("mvs-figure9", {"methods": "mvs"}, (Method.MVS,)),
        ("faults", {"cases": "none"}, ("none",)),
        ("mvs-figure9", {"entries": 5}, (5,)),
        ("following-alarms", {"files": "one.csv"}, (Path("one.csv"),)),
        ("platoons", {"files": "one.csv"}, (Path("one.csv"),)),
    ],
)
def test_a_single_value_is_a_list_of_one(
    study: str, given: dict[str, object], several: tuple[object, ...]
) -> None:
    schema = settings_schema(study)
    assert schema is not None

    (name,) = given
    settings = parse_settings(with_lists_of_one(given, schema), schema, study)
    assert getattr(settings, name) == several


def test_a_single_value_within_a_section_is_a_list_of_one() -> None:
    tree = with_lists_of_one({"encounter": {"scenes": "city"}}, CollisionSettings)

    settings = parse_settings(tree, CollisionSettings, "mvs-figure9")
    assert settings.encounter.scenes == (SceneName.CITY,)


def test_a_study_takes_a_single_value(tmp_path: Path) -> None:
    given = {"runs": 1, "cars": 2, "shares": 0.0, "sights": "rig", "reaction_medians_s": 1.0}

    run_study("lcca-chain", tmp_path, None, Workers(), given)

    assert len((tmp_path / "runs/runs.jsonl").read_text("utf-8").splitlines()) == 1


@pytest.mark.parametrize("study", study_names())
def test_the_help_of_a_study_is_a_file_of_its_default_settings(study: str) -> None:
    text, schema = study_settings(study), settings_schema(study)

    if schema is None:
        assert text == f"# {study} takes no settings"
    else:
        required = {"files": ["trace.csv"]} if "files" in schema.model_fields else {}
        tree = parse_yaml(text, study)
        assert isinstance(tree, dict)
        assert parse_settings(tree | required, schema, study) == parse_settings(
            required, schema, study
        )


def test_the_help_of_a_study_says_what_a_setting_means_and_allows() -> None:
    lines = study_settings("mvs-figure9").splitlines()

    assert lines[lines.index("runs: 500") - 1] == "# Events of each kind."
    assert "# Of: none, dsrc, own, mo, rs, mvs, onset, observer, in_view" in lines
    assert "  near_m: 80.0" in lines


def schemas_in(annotation: object) -> Iterator[type[BaseModel]]:
    """The settings that a value of this type holds, with those inside them."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
        for field in annotation.model_fields.values():
            yield from schemas_in(field.annotation)
    for part in get_args(annotation):
        yield from schemas_in(part)


@pytest.mark.parametrize("study", study_names())
def test_every_setting_of_a_study_has_a_text(study: str) -> None:
    bare = [
        f"{schema.__name__}.{name}"
        for schema in schemas_in(settings_schema(study))
        for name in schema.model_fields
        if not meanings(schema).get(name)
    ]

    assert not bare


def test_a_text_stands_below_its_own_setting() -> None:
    lines = study_settings("lcca-chain").splitlines()

    assert "`reach_m` and `loss`" in lines[lines.index("csma: null") - 1]
    assert lines[lines.index("sidelink: null") - 1] == "# C-V2X, where `csma` is not given."


def test_a_world_may_be_given_by_the_name_of_its_sensors() -> None:
    tree = {"encounter": {"world": "radar-150"}}
    world = parse_settings(tree, CollisionSettings, "mvs-figure9").encounter.world

    assert (world.sensing_range_m, world.view_deg, world.range_rate_sigma_m_s) == (150.0, 40.0, 0.1)


def test_a_case_that_settings_name_twice_is_run_once() -> None:
    """M = 10 is what every method has at every share, 0.4 the share that is compared."""
    settings = CollisionSettings(methods=(Method.MVS, Method.RANDOM), entries=(10, 20, 20))

    found = encounter_cases(settings)

    assert len(found) == len(set(found))


def test_all_faults_have_names() -> None:
    assert FaultsSettings(cases=("GNSS jump", "slow CPU")).cases == ("GNSS jump", "slow CPU")
