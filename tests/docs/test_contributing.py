"""The contributor's page: its recipes work as they stand there."""

import re

import pytest
import yaml

from sim_rig.reporting.verdict import Outcome, verdict
from sim_rig.runs.virtual import run_virtual
from sim_rig.scenario.schema import load_scenario
from tests.docs.test_pages import ROOT

PAGE = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
MAKEFILE = (ROOT / "Makefile").read_text(encoding="utf-8")


def test_the_scenario_of_the_recipe_passes(tmp_path):
    (recipe,) = re.findall(r"(?ms)^```yaml\n(.*?)^```", PAGE)
    file = tmp_path / "recipe.yaml"
    file.write_text(recipe, encoding="utf-8")
    scenario = load_scenario(str(file))
    judged = verdict(scenario, run_virtual(scenario))
    assert scenario.expect
    assert judged.outcome is Outcome.PASSED, judged.failures


@pytest.mark.parametrize("path", sorted(set(re.findall(r"`([\w]+/[\w./]+)`", PAGE))))
def test_every_file_and_folder_that_a_recipe_names_exists(path):
    assert (ROOT / path).exists()


def test_make_help_names_every_target():
    phony = {name for line in re.findall(r"(?m)^\.PHONY: (.*)$", MAKEFILE) for name in line.split()}
    described = set(re.findall(r"(?m)^([a-z-]+):.*?## ", MAKEFILE))
    assert phony == described


def test_the_templates_and_the_workflow_are_yaml():
    files = [*sorted((ROOT / ".github").rglob("*.yml")), ROOT / ".pre-commit-config.yaml"]
    assert len(files) == 5
    for file in files:
        assert yaml.safe_load(file.read_text(encoding="utf-8")), file
