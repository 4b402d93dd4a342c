"""The pages' figures that also stand in code are those of the code.

A page states the value of a constant or setting behind its name, as in `RELEASE_S` (1.0 s).
"""

import dataclasses
import importlib
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
from pydantic import BaseModel

from tests.docs.test_pages import PAGES, ROOT, name_of

NUMBER = r"(-?[\d.,]*\d)"
STATED = rf"`(?:\w+\.)*(\w+)`\s\({NUMBER}(?:\sto\s{NUMBER})?(?:\s[^\s()|]{{1,8}})?\)"
"""A name in code, and a number or a range with or without a unit in brackets."""


@cache
def sources() -> dict[str, str]:
    """The text of every module of both programs, by its name."""
    paths = [path for program in ("onboard", "sim_rig") for path in (ROOT / program).rglob("*.py")]
    return {
        ".".join(path.relative_to(ROOT).with_suffix("").parts): path.read_text(encoding="utf-8")
        for path in paths
        if path.name != "__main__.py"
    }


def defaults(kind: type) -> dict[str, Any]:
    """The defaults of the fields of settings or of a dataclass."""
    if issubclass(kind, BaseModel):
        return {name: field.default for name, field in kind.model_fields.items()}
    if dataclasses.is_dataclass(kind):
        return {field.name: field.default for field in dataclasses.fields(kind)}
    return {}


def values_in(module: ModuleType, name: str) -> Iterator[Any]:
    """The values that a module gives a name: of a constant, and of fields of its classes."""
    if name in vars(module):
        yield vars(module)[name]
    for kind in vars(module).values():
        if isinstance(kind, type) and name in (fields := defaults(kind)):
            yield fields[name]


def values_of(name: str, package: str = "") -> list[Any]:
    """All values that the code gives a name where it is assigned, in the package if it does."""
    assigned = re.compile(rf"(?m)^(?:    |.*, )?{name}(?:, [\w, ]+)?(?:: [^=\n]+)? = ")
    modules = [each for each, text in sources().items() if name in text and assigned.search(text)]
    modules = [each for each in modules if each.split(".")[1] == package] or modules
    return [value for each in modules for value in values_in(importlib.import_module(each), name)]


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_a_number_behind_a_name_is_its_value_in_the_code(page: Path) -> None:
    for name, least, most in re.findall(STATED, page.read_text(encoding="utf-8")):
        values = values_of(name, page.stem)
        stated = tuple(float(each.replace(",", "")) for each in (least, most) if each)

        assert values, f"{name} has no value"
        assert stated in values or stated in [(each,) for each in values], f"{name} is {values}"


def test_a_name_that_the_code_does_not_give_a_value_is_found() -> None:
    assert not values_of("NO_SUCH_LIMIT_S")


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("after `SPEED_VALID_S` (1.0 s) it", [("SPEED_VALID_S", "1.0", "")]),
        ("`lcca.leave_headway_s` (2.2 s)", [("leave_headway_s", "2.2", "")]),
        ("of `QUEUE_RECORDS` (20,000).", [("QUEUE_RECORDS", "20,000", "")]),
        ("from `PLATE_PX` (84 to 96 px)", [("PLATE_PX", "84", "96")]),
        ("`OTHER` (in the page), `f` (1.2 times as large)", []),
    ],
)
def test_numbers_behind_names_are_found(text: str, found: list[tuple[str, str, str]]) -> None:
    assert re.findall(STATED, text) == found
