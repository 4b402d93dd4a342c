"""The allowed imports on the design page are those of the code: none more, and none less."""

import re
from collections import defaultdict
from pathlib import PurePath

import pytest

from tests.architecture.imports import imports_of
from tests.architecture.syntax import ROOT

PAGE = ROOT / "docs/design/README.md"
PROGRAMS = ("onboard", "sim_rig")
MOST_LOOSE_MODULES = 8
"""Files of `onboard` beside its packages, `__init__` and `__main__` included."""


def allowed(program: str) -> dict[str, list[str]]:
    """What each package may import, in the order of the page."""
    text = PAGE.read_text(encoding="utf-8").partition(f"### Of {program}\n")[2]
    rows = re.findall(r"(?m)^    (\S+)(.*(?:\n {8}.*)*)$", text.partition("\n### ")[0])
    return {package: imported.split() for package, imported in rows}


def loose_modules(program: str) -> set[str]:
    return {path.stem for path in (ROOT / program).glob("*.py")}


def package_of(parts: tuple[str, ...]) -> str:
    """Of a module, `studies/lcca` for those of the studies."""
    return "/".join(parts[1:3]) if parts[1] == "studies" else parts[1]


def imported_by(program: str) -> dict[str, set[str]]:
    """The other packages that each package imports."""
    found: dict[str, set[str]] = defaultdict(set)
    for each in imports_of(program):
        importer = package_of(PurePath(each.importer).with_suffix("").parts)
        parts = tuple(each.module.split("."))
        if parts[0] == program and len(parts) > 1 and importer not in loose_modules(program):
            found[importer].add(package_of(parts))
    return {each: them - loose_modules(program) - {each} for each, them in found.items()}


@pytest.mark.parametrize("program", PROGRAMS)
def test_a_package_imports_what_its_row_allows_and_uses_all_of_it(program: str) -> None:
    found = {each: sorted(them) for each, them in imported_by(program).items() if them}

    assert found == {each: sorted(them) for each, them in allowed(program).items() if them}


@pytest.mark.parametrize("program", PROGRAMS)
def test_every_package_has_a_row(program: str) -> None:
    folders = {path.parent for path in (ROOT / program).rglob("*.py")} - {ROOT / program}
    packages = {package_of(path.relative_to(ROOT).parts) for path in folders} - {"studies"}

    assert packages == set(allowed(program))


@pytest.mark.parametrize("program", PROGRAMS)
def test_the_table_has_each_package_below_those_that_it_imports(program: str) -> None:
    order = list(allowed(program))

    assert [
        (package, each)
        for package, imported in allowed(program).items()
        for each in imported
        if order.index(each) >= order.index(package)
    ] == []


def test_few_modules_stand_beside_the_packages_of_the_vehicle() -> None:
    assert len(loose_modules("onboard")) <= MOST_LOOSE_MODULES
