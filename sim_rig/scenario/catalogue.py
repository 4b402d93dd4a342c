"""The scenarios that come with the rig, without the schema that checks them."""

from pathlib import Path

import yaml

SCENARIOS = Path(__file__).parents[1] / "scenarios"


def scenario_names() -> list[str]:
    """Names of the scenarios that come with the rig."""
    return sorted(path.stem for path in SCENARIOS.glob("*.yaml"))


def scenario_titles() -> dict[str, str]:
    """Their titles by name, sorted."""
    return {name: _title(SCENARIOS / f"{name}.yaml") for name in scenario_names()}


def _title(path: Path) -> str:
    with path.open("rb") as file:
        return str(yaml.load(file, yaml.CSafeLoader)["title"])
