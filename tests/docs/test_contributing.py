"""The contributor's page: its recipes work as they stand there."""

import re
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, ClassVar

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from onboard.messages import fields
from onboard.messages.record import Record
from sim_rig.reporting.verdict import Outcome, verdict
from sim_rig.runs.virtual import run_virtual
from sim_rig.scenario.schema import load_scenario
from tests.docs.test_pages import ROOT
from tests.messages.strategies import values

PAGE = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
MAKEFILE = (ROOT / "Makefile").read_text(encoding="utf-8")


def test_the_scenario_of_the_recipe_passes(tmp_path: Path) -> None:
    (recipe,) = re.findall(r"(?ms)^```yaml\n(.*?)^```", PAGE)
    file = tmp_path / "recipe.yaml"
    file.write_text(recipe, encoding="utf-8")
    scenario = load_scenario(str(file))
    judged = verdict(scenario, run_virtual(scenario))
    assert scenario.expect
    assert judged.outcome is Outcome.PASSED, judged.failures


@pytest.mark.parametrize("path", sorted(set(re.findall(r"`([\w]+/[\w./]+)`", PAGE))))
def test_every_file_and_folder_that_a_recipe_names_exists(path: str) -> None:
    assert (ROOT / path).exists()


def test_make_help_names_every_target() -> None:
    phony = {name for line in re.findall(r"(?m)^\.PHONY: (.*)$", MAKEFILE) for name in line.split()}
    described = set(re.findall(r"(?m)^([a-z-]+):.*?## ", MAKEFILE))
    assert phony == described


def test_the_templates_and_the_workflow_are_yaml() -> None:
    files = [*sorted((ROOT / ".github").rglob("*.yml")), ROOT / ".pre-commit-config.yaml"]
    assert len(files) == 5
    for file in files:
        assert yaml.safe_load(file.read_text(encoding="utf-8")), file


@given(data=st.data())
def test_the_message_of_the_recipe_comes_back_from_the_wire(data: st.DataObject) -> None:
    (recipe,) = re.findall(r"(?ms)^```python\n(.*?)^```", PAGE)
    names = (
        vars(fields)
        | {each.__name__: each for each in (dataclass, Record)}
        | {"Annotated": Annotated, "ClassVar": ClassVar, "__name__": __name__}
    )
    exec(recipe, names)  # noqa: S102 (our own page)
    message = names["MESSAGE"]
    sent = data.draw(values(message))

    assert message.decode(message.encode(sent)) == sent
    assert message.as_dict(sent).keys() == {"sender_id", "speed_m_s"}


def test_the_workflow_runs_all_tests_on_every_supported_python_and_the_gate_on_arm_too() -> None:
    workflow = yaml.safe_load((ROOT / ".github/workflows/test.yml").read_text(encoding="utf-8"))
    with (ROOT / "pyproject.toml").open("rb") as file:
        project = tomllib.load(file)["project"]
    supported = [each for each in project["classifiers"] if re.search(r":: 3\.\d+$", each)]
    python = [each.rpartition(" ")[2] for each in supported]
    run = {
        name: [step["run"] for step in job["steps"] if "run" in step]
        for name, job in workflow["jobs"].items()
    }

    assert workflow["jobs"]["test"]["strategy"]["matrix"] == {
        "python": python,
        "runner": ["ubuntu-24.04", "ubuntu-24.04-arm"],
    }
    assert workflow["jobs"]["long"]["strategy"]["matrix"] == {"python": python}
    assert run == {"test": ["make test"], "long": ["make test-long", "make test-pages"]}


def test_the_hooks_before_a_commit_are_those_of_the_gate_and_fetch_nothing() -> None:
    text = (ROOT / ".pre-commit-config.yaml").read_text(encoding="utf-8")
    (repository,) = yaml.safe_load(text)["repos"]
    lint = re.findall(r"\$\(PYTHON\) (-m (?:ruff|mypy).*)", MAKEFILE)

    assert repository["repo"] == "local"
    assert [f".venv/bin/python {each.removesuffix(' .')}" for each in lint] == [
        each["entry"] for each in repository["hooks"]
    ]
